"""What any policy says and asks, replaced by a rule: so that its own choice can be priced (docs/calibration.md).

A name such as "planner+always-asks" flies the planner, whose queries are chosen by the rule instead.
"""

from typing import NamedTuple

import numpy as np

from ..base.kernels import kernel
from ..base.terms import NOBODY
from ..mission.batch import MissionBatch
from ..mission.randomness import uniform
from .random import ASK, POLICY
from .schedule import longest_unheard


class Talk(NamedTuple):
    """Which choices are replaced, and by what."""

    broadcasts: bool = True  # the policy's own; else by `period`
    period: float = np.inf  # s between broadcasts
    queries: bool = True  # the policy's own; else by `chance`
    chance: float = 0.0  # of asking where a query is open, in each decision


TALKS = {
    "no-broadcast": Talk(broadcasts=False),
    "no-query": Talk(queries=False),
    "always-asks": Talk(queries=False, chance=1.0),
}
NUMBERED = {  # what stands before the number, its bounds, and the rule that it makes
    "broadcasts-every-": (1.0, np.inf, lambda period: Talk(broadcasts=False, period=period)),
    "asks-at-random-": (0.0, 1.0, lambda chance: Talk(queries=False, chance=chance)),
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


class Talking:
    """Callable policy: another one's decisions, but for what a `Talk` replaces."""

    def __init__(self, batch: MissionBatch, make, talk: Talk):
        self.policy, self.talk, self.seeds = make(batch), talk, np.array(batch.seeds, np.uint64)

    def __call__(self, observations):
        decisions = self.policy(observations)
        if not self.talk.broadcasts:
            broadcast_by_clock(observations, self.talk.period, decisions)
        if not self.talk.queries:
            ask_by_chance(self.seeds, observations, self.talk.chance, decisions)
        return decisions


@kernel
def broadcast_by_clock(observations, period, decisions):
    """Broadcast wherever the last one is so old."""
    for i in range(observations.robots.shape[0]):
        robot = observations.robots[i]
        decisions.broadcast[i] = robot.can_broadcast and robot.since_broadcast >= period


@kernel
def ask_by_chance(seeds, observations, chance, decisions):
    """Ask the operator that was not heard of for longest with that chance; a query takes the place of a request."""
    for i in range(observations.robots.shape[0]):
        robot = observations.robots[i]
        is_asking = uniform(seeds[robot.mission], POLICY, int(robot.time), robot.robot, ASK) < chance
        decisions.query[i] = longest_unheard(observations.robot_operators[i]) if is_asking else NOBODY
        decisions.assist[i] = decisions.assist[i] and decisions.query[i] == NOBODY
