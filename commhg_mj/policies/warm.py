"""What the first start on a machine runs, so that every kernel is compiled; later starts load them from disk."""

from functools import partial

from ..base.kernels import FIRST_START
from ..mission.batch import MissionBatch
from .cbba import Cbba
from .greedy import Greedy
from .omniscient import Omniscient
from .planner import Planner
from .random import Random
from .talk import Talk, Talking
from .whole_missions import fly_whole

EVERYTHING = Talk(broadcasts=False, queries=False)


def fly_a_little() -> None:
    """Some seconds of a mission with every reference policy, and a whole one inside a kernel."""
    batch = MissionBatch("small", seeds=[0], record=True)
    for make in (Random, Greedy, Cbba, Planner, Omniscient, partial(Talking, make=Greedy, talk=EVERYTHING)):
        policy, observations = make(batch), batch.reset()
        for _ in range(20):
            observations = batch.step(policy(observations))
    fly_whole(batch)


FIRST_START.append(fly_a_little)
