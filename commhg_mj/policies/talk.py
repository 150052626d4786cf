"""What any policy says and asks, replaced by a rule: so that its own choice can be priced (docs/calibration.md).

A name such as "planner+always-asks" flies the planner, whose queries are chosen by the rule instead.
"""

from typing import NamedTuple

import numpy as np

from ..base.kernels import kernel
from ..base.terms import NOBODY
from ..mission.batch import MissionBatch
from ..mission.randomness import uniform
from .random import ASK, POLICY, SPEAK
from .schedule import longest_unheard


class Talk(NamedTuple):
    """Which choices are replaced, and by what."""

    broadcasts: bool = True  # the policy's own; else by `period`, and by `speaking`
    period: float = np.inf  # s between broadcasts
    speaking: float = 0.0  # chance of a broadcast where one is open, in each decision
    queries: bool = True  # the policy's own; else by `asking`
    asking: float = 0.0  # chance of a query where one is open, in each decision


TALKS = {
    "no-broadcast": Talk(broadcasts=False),
    "no-query": Talk(queries=False),
    "always-asks": Talk(queries=False, asking=1.0),
}
NUMBERED = {  # what stands before the number, its bounds, and the rule that it makes
    "broadcasts-every-": (1.0, np.inf, lambda period: Talk(broadcasts=False, period=period)),
    "broadcasts-at-random-": (0.0, 1.0, lambda chance: Talk(broadcasts=False, speaking=chance)),
    "asks-at-random-": (0.0, 1.0, lambda chance: Talk(queries=False, asking=chance)),
}


def find_talk(name: str) -> Talk | None:
    """The rule of that name; None: there is none.

    Raises:
      ValueError: its number is none, or out of bounds; the message names it.
    """
    for start, (low, high, make) in NUMBERED.items():
        if name.startswith(start):
            try:
                number = float(name.removeprefix(start))
            except ValueError:
                number = np.nan
            if not low <= number <= high:
                raise ValueError(f"{name}: {start} needs a number in {low:g}..{high:g}")
            return make(number)
    return TALKS.get(name)


def split_talk(name: str) -> tuple[str, str, Talk | None]:
    """(policy, its ending, the rule of that name); without a rule (name, "", None)."""
    base, _, ending = name.rpartition("+")
    talk = find_talk(ending) if base else None
    return (base, ending, talk) if talk else (name, "", None)


class Talking:
    """Callable policy: another one's decisions, but for what a `Talk` replaces."""

    def __init__(self, batch: MissionBatch, make, talk: Talk):
        self.policy, self.talk, self.seeds = make(batch), talk, np.array(batch.seeds, np.uint64)

    def __call__(self, observations):
        decisions = self.policy(observations)
        if not self.talk.broadcasts:
            broadcast_by_rule(self.seeds, observations, self.talk.period, self.talk.speaking, decisions)
        if not self.talk.queries:
            ask_by_chance(self.seeds, observations, self.talk.asking, decisions)
        return decisions


@kernel
def broadcast_by_rule(seeds, observations, period, chance, decisions):
    """Broadcast wherever the last one is so old, and elsewhere with that chance."""
    for i in range(observations.robots.shape[0]):
        robot = observations.robots[i]
        is_speaking = uniform(seeds[robot.mission], POLICY, int(robot.time), robot.robot, SPEAK) < chance
        decisions.broadcast[i] = robot.can_broadcast and (robot.since_broadcast >= period or is_speaking)


@kernel
def ask_by_chance(seeds, observations, chance, decisions):
    """Ask the operator that was not heard of for longest with that chance; a query takes the place of a request."""
    for i in range(observations.robots.shape[0]):
        robot = observations.robots[i]
        is_asking = uniform(seeds[robot.mission], POLICY, int(robot.time), robot.robot, ASK) < chance
        decisions.query[i] = longest_unheard(observations.robot_operators[i]) if is_asking else NOBODY
        decisions.assist[i] = decisions.assist[i] and decisions.query[i] == NOBODY
