"""Missions of human operators, aerial and ground robots under limited communication, in MuJoCo worlds.

>>> missions = commhg_mj.make_vec("large", num_missions=64, seed=0)
>>> observations = missions.observations
>>> while not missions.over.all():
...     observations = missions.step(policy(observations))
>>> [score.twcr for score in missions.scores()]
"""

from .base.arguments import check_seed, missions_of
from .base.terms import IDLE, KEEP, NOBODY, REST
from .base.version import __version__  # noqa: F401
from .learning import pretrained  # noqa: F401  learned policies are found by name, too
from .mission.batch import MissionBatch, stay
from .mission.decide import Decisions
from .mission.observe import Observations
from .mission.score import Score
from .mission.trace import Trace, load_trace, make_traces, save_trace
from .models.world import World, make_world
from .policies import POLICIES, PolicyInfo, policy
from .radio import DEFAULT_LINKS, LINK_MODELS, link_model
from .radio.world_links import WorldLinks
from .scenarios import LIMITATIONS, SCENARIOS, Scenario, load_scenario, with_heightmap
from .tasks.registration import register_missions

register_missions()

__all__ = [
    "IDLE", "KEEP", "LIMITATIONS", "LINK_MODELS", "NOBODY", "POLICIES", "REST", "SCENARIOS", "Decisions",
    "MissionBatch", "Observations", "PolicyInfo", "Scenario", "Score", "Trace", "World", "WorldLinks", "link_model",
    "load_scenario", "load_trace", "make_traces", "make_vec", "make_world", "policy", "save_trace", "stay",
    "with_heightmap",
]  # fmt: skip


def make_vec(scenario, num_missions=1, seed=0, links=DEFAULT_LINKS, limitation="nominal", record=False) -> MissionBatch:
    """Missions with the seeds `seed`, `seed + 1`, …, stepped together to their next decision epochs.

    Args and errors as for `MissionBatch`.
    """
    seed, n = check_seed(seed), missions_of("num_missions", num_missions)
    return MissionBatch(scenario, range(seed, seed + n), links, limitation, record)
