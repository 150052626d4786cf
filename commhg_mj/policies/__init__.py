"""Reference policies: `policy(observations) -> decisions`, made for one batch of missions (by name: commhg_mj/pilots.py)."""

from collections.abc import Callable
from typing import NamedTuple

from .greedy import Greedy
from .omniscient import Omniscient
from .random import Random
from .warm import ensure_compiled


class PolicyInfo(NamedTuple):
    make: Callable  # (MissionBatch) -> policy
    is_privileged: bool  # reads the true state and communicates for free; marked as such everywhere


POLICIES = {
    "random": PolicyInfo(Random, False),
    "greedy": PolicyInfo(Greedy, False),
    "omniscient": PolicyInfo(Omniscient, True),
}

__all__ = ["POLICIES", "PolicyInfo", "ensure_compiled"]
