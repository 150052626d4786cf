"""Policies by name: the references, learned ones, and whatever others add. A policy maps observations to decisions.

A policy of one's own is made for one batch of missions, and flies wherever a name does:

>>> @commhg_mj.policy("mine")
... class Mine:
...     def __init__(self, batch): ...
...     def __call__(self, observations): return commhg_mj.stay(observations)
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from ..base.arguments import said
from ..base.registries import Registry
from ..mission.batch import MissionBatch
from ..radio import DEFAULT_LINKS
from ..scenarios import Scenario, load_scenario
from . import warm  # noqa: F401  says what the first start runs
from .cbba import Cbba, with_bids
from .greedy import Greedy
from .omniscient import Omniscient, every_second
from .planner import ABLATIONS, Planner
from .random import Random
from .talk import NUMBERED, TALKS, Talking, split_talk

__all__ = ["POLICIES", "SOURCES", "PolicyInfo", "Source", "conditions_of", "find_policy", "label_of", "policy", "prepare"]


def as_it_is(scenario: Scenario) -> Scenario:
    return scenario


class PolicyInfo(NamedTuple):
    make: Callable  # (MissionBatch) -> policy
    is_privileged: bool = False  # reads the true state and communicates for free; marked as such everywhere
    flown_in: Callable[[Scenario], Scenario] = as_it_is  # what is asked for -> what it flies in; privileged: every_second


class Source(NamedTuple):
    """Where policies come from beside the registry: names that carry more than a name, such as files of weights."""

    find: Callable[[str], PolicyInfo | None]  # None: not of this source; ValueError: refused
    label: Callable[[str], str | None]  # what one is called in titles and names of files
    also: str  # what else a name may be, for messages


def policy(name: str, is_privileged: bool = False) -> Callable[[Callable], Callable]:
    """Register the decorated callable, (MissionBatch) -> policy, under a name in this process.

    Args:
      is_privileged: it reads the true state; such a policy is marked wherever its name appears.

    Raises:
      ValueError: no name, or that of a reference.
    """
    if not isinstance(name, str) or not name or name in REFERENCES:
        raise ValueError(f"policy {said(name)}: the name must be a word other than {', '.join(REFERENCES)}")

    def register(make):
        POLICIES[name] = PolicyInfo(make, is_privileged)
        return make

    return register


REFERENCES = {
    "random": PolicyInfo(Random),
    "greedy": PolicyInfo(Greedy),
    "greedy+no-query": PolicyInfo(partial(Greedy, asks=False)),
    "cbba": PolicyInfo(Cbba, flown_in=with_bids),
    "planner": PolicyInfo(Planner),
    "omniscient": PolicyInfo(Omniscient, True),
}
POLICIES = Registry("policy", "commhg_mj.policies", REFERENCES, lambda name, make: policy(name)(make))
ABLATED = {f"planner+{name}": PolicyInfo(partial(Planner, plan=plan)) for name, plan in ABLATIONS.items()}
SOURCES = [  # and learning/pretrained.py's
    Source(lambda name: ABLATED.get(str(name)), lambda name: None, f", planner+ one of {', '.join(ABLATIONS)}")
]


def find_talking(name: str) -> PolicyInfo | None:
    """A policy of which a rule of `talk.py` replaces what it says or asks."""
    base, _, talk = split_talk(str(name))
    if talk is None:
        return None
    info = find_policy(base)
    return info._replace(make=partial(Talking, make=info.make, talk=talk))


def label_talking(name: str) -> str | None:
    """The label of the policy, and the rule."""
    base, ending, talk = split_talk(name)
    return f"{label_of(base)}+{ending}" if talk else None


TALKING = Source(  # what is not a whole name elsewhere
    find_talking, label_talking, f", any+ of {', '.join([*TALKS, *NUMBERED])}"
)


def find_policy(name: str) -> PolicyInfo:
    """The policy of that name: a reference, a method whose weights come along, a path to weights, or one that was added.

    A learned one may lack something: "weights.safetensors+no-query", "weights.safetensors+random-gates".

    Raises:
      ValueError: there is none, or its weights are refused or retired; the message names it.
    """
    if isinstance(name, str) and name in POLICIES:
        return POLICIES[name]
    for source in [*SOURCES, TALKING]:
        info = source.find(name)
        if info is not None:
            return info
    return POLICIES.find(name, "".join(source.also for source in [*SOURCES, TALKING]))


def label_of(name: str) -> str:
    """What a policy is called in titles and names of files.

    Raises:
      ValueError: a file of weights cannot be read; the message names it.
    """
    return next(filter(None, (source.label(name) for source in [*SOURCES, TALKING])), name)


def prepare(
    name: str, scenario, seeds, links=DEFAULT_LINKS, limitation="nominal", record=False
) -> tuple[MissionBatch, Callable]:
    """(batch, policy) for missions of a scenario, under the policy's own conditions: a privileged one's are idealised."""
    info = find_policy(name)
    scenario, links = conditions_of(name, load_scenario(scenario), links)
    batch = MissionBatch(scenario, seeds, links, limitation, record)
    return batch, info.make(batch)


def conditions_of(name: str, scenario: Scenario, links: str) -> tuple[Scenario, str]:
    """(scenario, links) that a policy flies under when these are asked for."""
    info = find_policy(name)
    return (every_second(scenario), "perfect") if info.is_privileged else (info.flown_in(scenario), links)
