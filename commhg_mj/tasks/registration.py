"""Gymnasium's register of the missions: `gymnasium.make("commhg_mj/Surveillance-medium-v0")`."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec

from ..scenarios import SCENARIOS, Scenario, to_json

ID = "commhg_mj/Surveillance-{}-v0"
ENTRY_POINTS = {"entry_point": "commhg_mj.tasks.gym:MissionEnv", "vector_entry_point": "commhg_mj.tasks.vector:MissionVectorEnv"}


def register_missions() -> None:
    """Every scenario under its own id."""
    for name in SCENARIOS:
        gymnasium.register(ID.format(name), **ENTRY_POINTS, kwargs={"scenario": name})


class PlainSpec:
    """An environment whose spec JSON can hold, whatever its options were given as: the options take that form as well."""

    _spec = None

    @property
    def spec(self) -> EnvSpec | None:
        """Gymnasium's `EnvSpec` of this environment, or None if Gymnasium has not made it."""
        return self._spec

    @spec.setter
    def spec(self, spec) -> None:
        options = spec and {name: plain(value) for name, value in spec.kwargs.items()}
        self._spec = spec and dataclasses.replace(spec, kwargs=options)


def plain(option) -> Any:
    """An option of `commhg_mj.tasks.Team` in words, numbers, lists and tables."""
    if isinstance(option, Scenario):
        return json.loads(to_json(option))
    if isinstance(option, range):
        return {"range": [option.start, option.stop, option.step]}
    if isinstance(option, (np.ndarray, np.generic)):
        return option.tolist()
    if isinstance(option, (list, tuple)):
        return [plain(item) for item in option]
    return str(option) if isinstance(option, Path) else option
