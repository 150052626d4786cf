"""Decisions take effect: the resolver, communication choices and supervision (benchmark, section 8)."""

from typing import NamedTuple

import numpy as np

from ..kernels import kernel
from ..terms import IDLE, KEEP, NOBODY, REST, Kind, Session
from .access import belief_of, operator_of, robot_of, task_of, uplink_of
from .control import bid, renew, withdraw
from .log import log_operator_decision, log_robot_decision
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
ILLEGAL = (
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


@kernel
def find_illegal(observations, decisions):
    """(row, rule) of the first decision that its mask forbids; (-1, 0) when all are legal."""
    tasks, operators = observations.robot_tasks, observations.robot_operators
    for i in range(observations.robots.shape[0]):
        robot, task, query = observations.robots[i], decisions.task[i], decisions.query[i]
        if task >= tasks.shape[1] or task < IDLE:
            return i, 0
        if task >= 0 and not tasks[i, task].legal:
            return i, 1
        if task == KEEP and not robot.can_keep:
            return i, 2
        if task == IDLE and not robot.can_idle:
            return i, 3
        if decisions.broadcast[i] and not robot.can_broadcast:
            return i, 4
        if query >= operators.shape[1] or query < NOBODY:
            return i, 5
        if query != NOBODY and not operators[i, query].legal:
            return i, 6
        if decisions.assist[i] and query != NOBODY:
            return i, 7
        if decisions.assist[i] and not robot.can_assist:
            return i, 8
    reports = observations.operator_reports
    for i in range(observations.operators.shape[0]):
        choice = decisions.operator[i]
        if choice >= reports.shape[1] or choice < REST:
            return i, 9
        if choice >= 0 and not reports[i, choice].legal:
            return i, 10
        if choice == KEEP and not observations.operators[i].can_keep:
            return i, 11
    return -1, 0


@kernel
def apply_decisions(missions, robots, operators, decisions):
    """Let every due actor's decision take effect, robots before operators, in the order of their indices.

    Tasks that are given up become free before any new claim is heard (the resolver).
    """
    for i in range(robots.shape[0]):
        m, r = missions[robots[i].mission], robots[i].robot
        choice = int(decisions.task[i])
        if choice == IDLE or (choice >= 0 and choice != robot_of(m, r).task):
            drop_task(m, r)
    for i in range(robots.shape[0]):
        m, r = missions[robots[i].mission], robots[i].robot
        robot_of(m, r).due = 0
        robot_of(m, r).next_decision = m.now + m.rules.robot_period
        log_robot_decision(m, r, decisions.task[i], decisions.broadcast[i], decisions.query[i], decisions.assist[i])
        claim(m, r, int(decisions.task[i]))
        speak(m, r, decisions.broadcast[i], int(decisions.query[i]), decisions.assist[i])
    for i in range(operators.shape[0]):
        m, h = missions[operators[i].mission], operators[i].operator
        log_operator_decision(m, h, decisions.operator[i])
        supervise(m, h, int(decisions.operator[i]))


@kernel
def claim(m, r, choice):
    """Take the chosen task unless somebody owns it; the later claim loses and decides again at once."""
    if choice < 0 or choice == robot_of(m, r).task:
        return
    if task_of(m, choice).owner == NOBODY:
        take_task(m, r, choice)
    else:
        belief_of(m, r, choice).refused_until = m.now + m.rules.refusal
        m.refusals += 1
        robot_of(m, r).due = 1


@kernel
def speak(m, r, wants_broadcast, query, assist):
    """Broadcast now; a query or a request queues and displaces telemetry that waits."""
    robot, now = robot_of(m, r), m.now
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
    operator, now = operator_of(m, h), m.now
    if choice == KEEP:
        operator.exempt = 0
        renew(m, h, now)
    elif choice == REST:
        if operator.session != RESTING:
            withdraw(m, h, now)
    elif choice != operator.robot:
        bid(m, h, choice, now)
    operator.due = 0
    operator.next_decision = now + m.rules.operator_period
