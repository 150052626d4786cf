"""Gymnasium's register of the missions: `gymnasium.make("commhg_mj/Surveillance-medium-v0")`."""

import gymnasium

from ..scenarios import SCENARIOS

ID = "commhg_mj/Surveillance-{}-v0"
ENTRY_POINTS = {"entry_point": "commhg_mj.tasks.gym:MissionEnv", "vector_entry_point": "commhg_mj.tasks.vector:MissionVectorEnv"}


def register_missions() -> None:
    """Every scenario under its own id."""
    for name in SCENARIOS:
        gymnasium.register(ID.format(name), **ENTRY_POINTS, kwargs={"scenario": name})
