"""Decisions take effect: the resolver, communication choices and supervision (docs/benchmark.md, section 8)."""

from typing import NamedTuple

import numpy as np

from ..base.kernels import kernel
from ..base.terms import IDLE, KEEP, NOBODY, REST, Kind, Session
from .accessors import known_task, true_operator, true_robot, true_task, uplink_of
from .control import bid, leave, renew
from .observe import OPERATOR_SEES, ROBOT_SEES
from .recorder import log_operator_decision, log_robot_decision
from .records import is_compatible
from .service import drop_task, take_task
from .transport import broadcast, displace, enqueue

QUERY, REQUEST = int(Kind.QUERY), int(Kind.REQUEST)
RESTING = int(Session.REST)


class Decisions(NamedTuple):
    """One choice for every row of the observations that were decided on.

    `task`: KEEP, IDLE or a task. `query`: NOBODY or an operator. `operator`: KEEP, REST or a robot.
    """

    task: np.ndarray  # [robots due] i4
    broadcast: np.ndarray  # [robots due] bool
    query: np.ndarray  # [robots due] i4
    assist: np.ndarray  # [robots due] bool: request assistance
    operator: np.ndarray  # [operators due] i4


# What `find_illegal` answers besides "all legal": which rule a decision breaks.
N_ROBOT_RULES = 9
ILLEGAL = (  # the first N_ROBOT_RULES are for robots, the others for operators
    "task is not a released task",
    "task is masked",
    "there is no task to KEEP",
    "IDLE is not open while the first target is prescribed",
    "broadcast is not open",
    "query is not an operator",
    "query is masked",
    "assist is not open together with a query",
    "assist is not open",
    "choice is not a robot",
    "robot is masked",
    "there is no session to KEEP",
)


class Masks(NamedTuple):
    """Who was asked to decide and what was legal: the batch's own copy, whatever a policy does to its observations."""

    robots: np.ndarray  # [robots due] ROBOT_SEES
    tasks: np.ndarray  # [robots due, T] i1
    queries: np.ndarray  # [robots due, H] i1
    operators: np.ndarray  # [operators due] OPERATOR_SEES
    supervised: np.ndarray  # [operators due, R] i1


def new_masks(n_missions: int, scenario) -> Masks:
    """Room for every actor of a batch."""
    n, k = n_missions * scenario.n_robots, n_missions * scenario.n_operators
    return Masks(
        np.empty(n, ROBOT_SEES),
        np.empty((n, scenario.n_tasks), np.int8),
        np.empty((n, scenario.n_operators), np.int8),
        np.empty(k, OPERATOR_SEES),
        np.empty((k, scenario.n_robots), np.int8),
    )


@kernel
def copy_robot_masks(observations, masks, i):
    """Keep what robot row i was shown of itself and of its masks."""
    masks.robots[i] = observations.robots[i]
    for j in range(masks.tasks.shape[1]):
        masks.tasks[i, j] = observations.robot_tasks[i, j].legal
    for h in range(masks.queries.shape[1]):
        masks.queries[i, h] = observations.robot_operators[i, h].legal


@kernel
def copy_operator_masks(observations, masks, k):
    """The same for operator row k."""
    masks.operators[k] = observations.operators[k]
    for r in range(masks.supervised.shape[1]):
        masks.supervised[k, r] = observations.operator_reports[k, r].legal


@kernel
def find_illegal(masks, decisions):
    """(row, rule) of the first decision that its mask forbids; (-1, 0) when all are legal."""
    for i in range(masks.robots.shape[0]):
        robot, task, query = masks.robots[i], decisions.task[i], decisions.query[i]
        if task >= masks.tasks.shape[1] or task < IDLE:
            return i, 0
        if task >= 0 and not masks.tasks[i, task]:
            return i, 1
        if task == KEEP and not robot.can_keep:
            return i, 2
        if task == IDLE and not robot.can_idle:
            return i, 3
        if decisions.broadcast[i] and not robot.can_broadcast:
            return i, 4
        if query >= masks.queries.shape[1] or query < NOBODY:
            return i, 5
        if query != NOBODY and not masks.queries[i, query]:
            return i, 6
        if decisions.assist[i] and query != NOBODY:
            return i, 7
        if decisions.assist[i] and not robot.can_assist:
            return i, 8
    for i in range(masks.operators.shape[0]):
        choice = decisions.operator[i]
        if choice >= masks.supervised.shape[1] or choice < REST:
            return i, 9
        if choice >= 0 and not masks.supervised[i, choice]:
            return i, 10
        if choice == KEEP and not masks.operators[i].can_keep:
            return i, 11
    return -1, 0


@kernel
def apply_decisions(missions, masks, decisions):
    """Let every due actor's decision take effect, robots before operators, in the order of their indices.

    Tasks that are given up become free before any new claim is heard (the resolver).
    """
    for i in range(masks.robots.shape[0]):
        m, r = missions[masks.robots[i].mission], masks.robots[i].robot
        choice = int(decisions.task[i])
        if choice == IDLE or (choice >= 0 and choice != true_robot(m, r).task):
            drop_task(m, r)
    for i in range(masks.robots.shape[0]):
        m, r = missions[masks.robots[i].mission], masks.robots[i].robot
        true_robot(m, r).due = 0
        true_robot(m, r).next_decision = m.now + m.rules.robot_period
        log_robot_decision(m, r, decisions.task[i], decisions.broadcast[i], decisions.query[i], decisions.assist[i])
        claim(m, r, int(decisions.task[i]))
        speak(m, r, decisions.broadcast[i], int(decisions.query[i]), decisions.assist[i])
    for i in range(masks.operators.shape[0]):
        m, h = missions[masks.operators[i].mission], masks.operators[i].operator
        log_operator_decision(m, h, decisions.operator[i])
        supervise(m, h, int(decisions.operator[i]))


@kernel
def claim(m, r, choice):
    """The resolver: take the chosen task unless somebody owns it; the later claim loses, and stands until it knows.

    The one place where a decision meets a truth that nobody has delivered: who owns the task.
    """
    robot = true_robot(m, r)
    if choice < 0 or choice == robot.task:
        return
    task = true_task(m, choice)
    if task.owner == NOBODY:
        if not is_compatible(robot.embodiment, task.type):
            m.incompatibles += 1
            m.tick_reward[1] -= m.rules.incompatible_cost
        take_task(m, r, choice)
        if m.rules.picks_first and m.now == 0:
            robot.prescribed = m.rules.initial_phase_end > 0
    else:
        m.refusals += 1
        robot.stands_until = m.now + m.rules.arbitration
        known_task(m, r, choice).refused_until = robot.stands_until + m.rules.refusal
        robot.due = m.rules.arbitration == 0.0


@kernel
def speak(m, r, wants_broadcast, query, assist):
    """Broadcast now; a query or a request queues and displaces telemetry that waits."""
    robot, now = true_robot(m, r), m.now
    if wants_broadcast:
        broadcast(m, r, now)
    if query != NOBODY:
        enqueue(m, uplink_of(m, r, 0), QUERY, r, m.n_robots + query, now)
        displace(m, uplink_of(m, r, 2), now)
    elif assist:
        robot.last_request = now
        enqueue(m, uplink_of(m, r, 1), REQUEST, r, m.n_robots + m.n_operators, now)
        displace(m, uplink_of(m, r, 2), now)


@kernel
def supervise(m, h, choice):
    """Operator h keeps, rests or bids for a robot."""
    operator, now = true_operator(m, h), m.now
    if choice == KEEP:
        operator.exempt = 0
        renew(m, h, now)
    elif choice == REST:
        if operator.session != RESTING:
            leave(m, h, now)
    elif choice != operator.robot:
        bid(m, h, choice, now)
    operator.due = 0
    operator.next_decision = now + m.rules.operator_period
