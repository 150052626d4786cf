"""What actors may choose, as the numbers of a MultiDiscrete action.

A robot chooses three times: its task (KEEP, IDLE, then the tasks), whether to broadcast (no, yes), and its message
(none, a query to each operator, a request for assistance). An operator chooses once: KEEP, REST, then the robots.
Every choice's first number changes nothing, and is the only one open to an actor that is not due.
"""

import numpy as np

from ..base.kernels import kernel
from ..base.terms import IDLE, KEEP, NOBODY, REST
from ..scenarios import Scenario

PER_ROBOT = 3  # choices
LARGEST = 2.0**31


class Choices:
    """The action of a whole team: R robots (UAVs first), then H operators.

    Attributes:
      names: [3 R + H] of every choice, as "uav0 task".
      sizes: [3 R + H] i8 numbers that each may take, from 0.
      starts: [3 R + H] i8 where each choice's part of a flat mask begins.
    """

    def __init__(self, scenario: Scenario):
        robot = (2 + scenario.n_tasks, 2, 2 + scenario.n_operators)
        self.sizes = np.array(robot * scenario.n_robots + (2 + scenario.n_robots,) * scenario.n_operators)
        self.starts = np.concatenate([[0], np.cumsum(self.sizes)[:-1]])
        robots = [f"{name} {choice}" for name in scenario.robot_names for choice in ("task", "broadcast", "message")]
        self.names = robots + [f"operator{h} robot" for h in range(scenario.n_operators)]

    @property
    def n_numbers(self) -> int:
        """Length of a flat mask."""
        return int(self.sizes.sum())

    def split(self, mask: np.ndarray) -> tuple:
        """A flat mask [..., n_numbers] as one view [..., size] a choice."""
        return tuple(mask[..., start : start + size] for start, size in zip(self.starts, self.sizes))

    def whole(self, actions, missions: tuple) -> np.ndarray:
        """Actions as whole numbers [E, 3 R + H] i8, not yet known to exist.

        Args:
          actions: [*missions, 3 R + H].
          missions: (E,), or () of one alone.

        Raises:
          ValueError: of another shape, or no whole numbers; the message names the choice.
        """
        values, shape = as_array(actions), (*missions, len(self.sizes))
        if values.shape != shape or values.dtype.kind not in "iuf":
            raise ValueError(f"action must be whole numbers of shape {shape}, is {values.dtype} of shape {values.shape}")
        values = values.reshape(-1, len(self.sizes))
        if values.dtype.kind == "f":
            numbers = values.astype(float)  # LARGEST is no float16
            wrong = ~(np.abs(numbers) < LARGEST)
            wrong |= np.where(wrong, 0.0, numbers) % 1 != 0
            if wrong.any():
                e, k = np.argwhere(wrong)[0]
                raise ValueError(f"action: {self.names[k]} must be a whole number, is {values[e, k]}")
        return values.astype(np.int64, order="C")  # always a copy: kernels compile anew for read-only or strided arrays

    def say_wrong(self, actions, e: int, k: int) -> str:
        """What is wrong with choice k of mission e in the actions that `whole` took: the caller's, as i8 holds no large u8."""
        value = int(np.reshape(actions, (-1, len(self.sizes)))[e, k])
        return f"action: {self.names[k]} must lie in 0..{self.sizes[k] - 1}, is {value}"


def as_array(action) -> np.ndarray:
    """An array of an action, empty if it is ragged."""
    try:
        return np.asarray(action)
    except ValueError:
        return np.empty(0, object)


@kernel
def close_choices(mask, due, starts, n_robots):
    """Leave those who were due nothing but the first number of each of their choices."""
    for e in range(due.shape[0]):
        for actor in range(due.shape[1]):
            if due[e, actor]:
                due[e, actor] = 0
                first = choice_of(actor, n_robots)
                for k in range(first, first + (PER_ROBOT if actor < n_robots else 1)):
                    end = starts[k + 1] if k + 1 < starts.shape[0] else mask.shape[1]
                    mask[e, starts[k]] = 1
                    mask[e, starts[k] + 1 : end] = 0


@kernel
def choice_of(actor, n_robots):
    """The first choice of an actor: robots, then operators."""
    return PER_ROBOT * actor if actor < n_robots else PER_ROBOT * n_robots + actor - n_robots


@kernel
def open_choices(seen, mask, due, starts, n_robots):
    """Open to everybody who is due what the observations say is legal."""
    for i in range(seen.robots.shape[0]):
        robot, tasks, operators = seen.robots[i], seen.robot_tasks[i], seen.robot_operators[i]
        row, k = mask[robot.mission], PER_ROBOT * robot.robot
        due[robot.mission, robot.robot] = 1
        task, broadcast, message = starts[k], starts[k + 1], starts[k + 2]
        row[task], row[task + 1] = robot.can_keep, robot.can_idle
        for j in range(tasks.shape[0]):
            row[task + 2 + j] = tasks[j].legal
        row[broadcast + 1] = robot.can_broadcast
        for h in range(operators.shape[0]):
            row[message + 1 + h] = operators[h].legal
        row[message + 1 + operators.shape[0]] = robot.can_assist
    for i in range(seen.operators.shape[0]):
        operator, reports = seen.operators[i], seen.operator_reports[i]
        row, k = mask[operator.mission], PER_ROBOT * n_robots + operator.operator
        due[operator.mission, n_robots + operator.operator] = 1
        start = starts[k]
        row[start], row[start + 1] = operator.can_keep, 1
        for r in range(reports.shape[0]):
            row[start + 2 + r] = reports[r].legal


@kernel
def read_actions(seen, actions, mask, starts, sizes, n_robots, decisions, replaced):
    """Fill in the decisions that actions [E, choices] mean; what is masked is replaced by staying.

    Args:
      replaced: [E] is filled with the number of masked choices of each mission.

    Returns:
      (mission, choice) of the first number that does not exist, or (-1, 0).
    """
    for e in range(actions.shape[0]):
        replaced[e] = 0
        for k in range(actions.shape[1]):
            if not 0 <= actions[e, k] < sizes[k]:
                return e, k
            replaced[e] += mask[e, starts[k] + actions[e, k]] == 0
    for i in range(seen.robots.shape[0]):
        e, k = seen.robots[i].mission, PER_ROBOT * seen.robots[i].robot
        task, broadcast, message = actions[e, k], actions[e, k + 1], actions[e, k + 2]
        if not mask[e, starts[k] + task]:
            task = 0 if mask[e, starts[k]] else 1
        decisions.task[i] = task - 2 if task >= 2 else (KEEP if task == 0 else IDLE)
        decisions.broadcast[i] = broadcast == 1 and mask[e, starts[k + 1] + 1]
        is_open = mask[e, starts[k + 2] + message]
        n_operators = seen.robot_operators.shape[1]
        decisions.query[i] = message - 1 if is_open and 1 <= message <= n_operators else NOBODY
        decisions.assist[i] = is_open and message == n_operators + 1
    for i in range(seen.operators.shape[0]):
        e, k = seen.operators[i].mission, PER_ROBOT * n_robots + seen.operators[i].operator
        choice = actions[e, k]
        if not mask[e, starts[k] + choice]:
            choice = 0 if mask[e, starts[k]] else 1
        decisions.operator[i] = choice - 2 if choice >= 2 else (KEEP if choice == 0 else REST)
    return -1, 0
