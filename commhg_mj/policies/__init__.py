"""Reference policies: `policy(observations) -> decisions`, made for one batch of missions."""

from collections.abc import Callable
from typing import NamedTuple

from ..mission.batch import MissionBatch
from ..radio import find_link_model
from ..scenarios import load_scenario
from .greedy import Greedy
from .omniscient import Omniscient, every_second
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


def find_policy(name: str) -> PolicyInfo:
    """The registered policy of that name.

    Raises:
      ValueError: there is none.
    """
    if name not in POLICIES:
        raise ValueError(f"unknown policy {name!r}: use {', '.join(POLICIES)}")
    return POLICIES[name]


def prepare(name: str, scenario, seeds, links="abstract", limitation="nominal", record=False):
    """(batch, policy) for missions of a scenario; a privileged policy gets its idealised conditions."""
    info, scenario = find_policy(name), load_scenario(scenario)
    find_link_model(links)
    ensure_compiled(POLICIES.values())
    if info.is_privileged:
        scenario, links = every_second(scenario), "perfect"
    batch = MissionBatch(scenario, seeds, links, limitation, record)
    return batch, info.make(batch)
