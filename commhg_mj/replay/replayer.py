"""A recorded mission flown again by its policy: what every robot saw, how things stood, and what it chose."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..base.arguments import instance, number, said, second
from ..base.terms import KEEP, NOBODY, Activity
from ..mission.observe import Observations
from ..mission.trace import Trace
from ..policies import POLICIES, find_policy, prepare


class Truth(NamedTuple):
    """The mission's state before anybody's choice of that second took effect; records of mission/state.py."""

    tasks: np.ndarray  # [T] TASK
    robots: np.ndarray  # [R] ROBOT
    operators: np.ndarray  # [H] OPERATOR
    queues: np.ndarray  # [H] messages that wait at each operator


@dataclass(frozen=True)
class Decision:
    """One robot's decision."""

    robot: int
    time: int  # s
    seen: Observations  # the robot's row alone
    truth: Truth
    task: int  # KEEP, IDLE or the task chosen
    broadcast: bool
    query: int  # the operator asked, or NOBODY
    assist: bool

    @property
    def itself(self) -> np.ndarray:
        """ROBOT_SEES: the robot's own state."""
        return self.seen.robots[0]

    @property
    def tasks(self) -> np.ndarray:
        """[T] TASK_SEEN."""
        return self.seen.robot_tasks[0]

    @property
    def peers(self) -> np.ndarray:
        """[R] PEER_SEEN."""
        return self.seen.robot_peers[0]

    @property
    def operators(self) -> np.ndarray:
        """[H] OPERATOR_SEEN."""
        return self.seen.robot_operators[0]

    @property
    def plan(self) -> int:
        """The task that the robot means to do from now on, or NOBODY."""
        return int(self.itself["task"]) if self.task == KEEP else max(self.task, NOBODY)


class Replayer:
    """A trace's mission under its own conditions, alone.

    Args:
      policy: name of the policy; None is the one that the trace names.
      name: what messages call the trace.

    Raises:
      ValueError: there is no such policy; the message names it and the trace.
    """

    def __init__(self, trace: Trace, policy: str | None = None, name="the trace"):
        self.trace, self.name = instance("trace", trace, Trace), name
        self.policy = trace.policy if policy is None else policy
        try:
            find_policy(self.policy)
        except ValueError as error:
            hint = "" if policy is not None else f"{name} was flown by {trace.policy!r}; name its policy or weights by --policy: "
            raise ValueError(f"{hint}{error}") from None
        self._act: Any
        batch, self._act = prepare(self.policy, trace.scenario, [trace.seed], trace.links, trace.limitation, record=True)
        self._batch = batch
        self._columns = list(_columns(trace, batch.log))

    def decisions(self, until=np.inf) -> Iterator[Decision]:
        """The robots' decisions in order of time, up to those at `until` [s]; to be called once.

        Raises:
          ValueError: the mission goes another way than the trace; the message names the trace and the policy.
        """
        batch, now, until = self._batch, 0, number("until", until, 0, np.inf)
        seen = batch.observations
        while not batch.over[0] and now <= until:
            chosen, truth = self._act(seen), _truth_of(batch)
            for i in range(len(seen.robots)):
                yield _decision(seen, chosen, truth, i)
            seen, start, now = batch.step(chosen), now, int(batch.time[0])
            self._compare(start, now + bool(batch.over[0]))

    def preferences(self) -> Callable | None:
        """`look(seen)` gives the `Preferences` of a decision's `seen`; None for a policy without heads."""
        if self.policy in POLICIES:
            return None
        from functools import partial

        from ..learning.preferences import robot_preferences

        return partial(robot_preferences, self._act)

    def _compare(self, start, stop):
        """Seconds `start` to `stop` - 1, over and done with, must be the trace's."""
        if not all(np.array_equal(flown[start:stop], kept[start:stop]) for flown, kept in self._columns):
            raise ValueError(f"{self.name} was not flown by {self.policy}: the missions part between {start} and {stop} s")


def last_decision(flight: Replayer, robot: str, at: float) -> Decision:
    """The last decision of a robot at or before second `at`.

    Raises:
      ValueError: no such robot or second, the robot has failed by then, or the trace is another policy's.
    """
    trace, names = flight.trace, flight.trace.scenario.robot_names
    if not isinstance(robot, str) or robot not in names:
        raise ValueError(f"--robot must be one of {', '.join(names)}, is {said(robot)}")
    at = second("--at", at, trace.ticks)
    r = names.index(robot)
    failed = np.flatnonzero(trace.robot_activity[: int(at) + 1, r] == Activity.FAILED)
    if len(failed):
        raise ValueError(f"--at {at:g}: {robot} failed at {failed[0]} s")
    return [decision for decision in flight.decisions(at) if decision.robot == r][-1]


def _decision(seen, chosen, truth, i):
    rows = slice(i, i + 1)
    own = Observations(*(table[rows].copy() for table in seen))._replace(
        operators=seen.operators[:0], operator_reports=seen.operator_reports[:0]
    )
    return Decision(
        int(own.robots["robot"][0]), int(own.robots["time"][0]), own, truth, int(chosen.task[i]), bool(chosen.broadcast[i]),
        int(chosen.query[i]), bool(chosen.assist[i]),
    )  # fmt: skip


def _truth_of(batch):
    state = batch.state
    queues = (state.downlinks["since"][0] >= 0).sum(axis=-1)
    return Truth(state.tasks[0].copy(), state.robots[0].copy(), state.operators[0].copy(), queues)


def _columns(trace, log):
    """(flown, kept) arrays, by seconds, of all that a trace holds second by second of robots and operators."""
    for prefix, rows in (("robot", log.robots[0]), ("operator", log.operators[0])):
        for name in rows.dtype.names:
            kept = trace.robot_xy[..., "xy".index(name)] if name in "xy" else getattr(trace, f"{prefix}_{name}")
            yield rows[name], kept
