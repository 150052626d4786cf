"""Observations: what due actors can know, and the masks that follow from it (docs/benchmark.md, section 10).

Own state, own resources, public attributes of released tasks, sensed tasks and records; nothing else.
Unknown records have age UNKNOWN and zeros.
"""

from typing import NamedTuple

import numpy as np

from ..base.elementary_functions import distance
from ..base.kernels import kernel
from ..base.terms import NOBODY, Activity, Embodiment, Kind, Mode, Session
from ..models.routes import measure_goals
from .accessors import (
    known_operator,
    known_robot,
    known_task,
    routes_of,
    scratch_of,
    true_operator,
    true_robot,
    true_task,
    uplink_of,
)
from .messages import count_waiting
from .records import DONE, OPEN, believed_type, is_compatible, is_ruled_out
from .state import record

UNKNOWN = -1.0
UGV, CONTROLLED = int(Embodiment.UGV), int(Mode.CONTROLLED)
RESTING, HELD, FAILED = int(Session.REST), int(Session.HELD), int(Activity.FAILED)
BROADCAST, REQUEST = int(Kind.BROADCAST), int(Kind.REQUEST)

ROBOT_SEES = record(  # itself; times in s, bytes in B
    mission="i4", robot="i4", time="f4", embodiment="i1", activity="i1", mode="i1", controller="i1", x="f4", y="f4", speed="f4",
    task="i4", progress="f4", lease_left="f4", handover_left="f4", stand_left="f4", tokens="f4", broadcast_tokens="f4",
    since_broadcast="f4", since_request="f4", query_waits="i1", request_waits="i1", prescribed="i1",
    can_keep="i1", can_idle="i1", can_broadcast="i1", can_assist="i1",
)  # fmt: skip
TASK_SEEN = record(  # by a robot; distance in m (ground robots: route), claimed_by the peer reported on its way there
    legal="i1", released="i1", type="i1", status="i1", refused="i1", claimed_by="i2", x="f4", y="f4", distance="f4",
    difficulty="f4", value="f4", deadline="f4", decay="f4", progress="f4", age="f4", claim_age="f4",
)  # fmt: skip
PEER_SEEN = record(  # by a robot: a peer's own report
    age="f4", x="f4", y="f4", task="i4", activity="i1", mode="i1", controller="i1", embodiment="i1",
)  # fmt: skip
OPERATOR_SEEN = record(  # by a robot: an operator's resource report
    legal="i1", session="i1", fatigue_class="i1", age="f4", tokens="f4", queue="i4", robot="i4",
)  # fmt: skip
OPERATOR_SEES = record(  # itself
    mission="i4", operator="i4", time="f4", proficiency=("f4", (2,)), capacity="f4", fatigue="f4", session="i1", robot="i4",
    lease_left="f4", since_bid="f4", tokens="f4", queue="i4", exempt="i1", can_keep="i1",
)  # fmt: skip
REPORT_SEEN = record(  # by an operator: a robot's report, and what is public and the station believes of the task it names
    legal="i1", embodiment="i1", activity="i1", mode="i1", controller="i1", age="f4", x="f4", y="f4", task="i4", progress="f4",
    request_age="f4", difficulty="f4", value="f4", deadline="f4", decay="f4", distance="f4",
    task_type="i1", task_status="i1", compatible="i1", task_progress="f4", task_age="f4",
)  # fmt: skip


class Observations(NamedTuple):
    """Rows of the actors that are due, over all missions of the batch, in the order of mission and index."""

    robots: np.ndarray  # [robots due] ROBOT_SEES
    robot_tasks: np.ndarray  # [robots due, T] TASK_SEEN
    robot_peers: np.ndarray  # [robots due, R] PEER_SEEN
    robot_operators: np.ndarray  # [robots due, H] OPERATOR_SEEN
    operators: np.ndarray  # [operators due] OPERATOR_SEES
    operator_reports: np.ndarray  # [operators due, R] REPORT_SEEN


def new_observations(n_missions: int, scenario) -> Observations:
    """Room for every actor of a batch; memory is taken only for the rows that are written."""
    n, k = n_missions * scenario.n_robots, n_missions * scenario.n_operators
    return Observations(
        np.empty(n, ROBOT_SEES),
        np.empty((n, scenario.n_tasks), TASK_SEEN),
        np.empty((n, scenario.n_robots), PEER_SEEN),
        np.empty((n, scenario.n_operators), OPERATOR_SEEN),
        np.empty(k, OPERATOR_SEES),
        np.empty((k, scenario.n_robots), REPORT_SEEN),
    )


@kernel
def age(now, time):
    """Seconds since the evidence was true, or UNKNOWN."""
    return now - time if time >= 0.0 else UNKNOWN


@kernel
def observe_robot(m, r, seen, tasks, peers, operators):
    """Everything that robot r can know."""
    robot, now = true_robot(m, r), m.now
    seen.robot = r
    seen.time = now
    seen.embodiment, seen.activity, seen.mode, seen.controller = robot.embodiment, robot.activity, robot.mode, robot.controller
    seen.x, seen.y, seen.task, seen.tokens = robot.x, robot.y, robot.task, robot.tokens
    seen.speed = m.rules.speed[1 if robot.mode == CONTROLLED else 0, robot.embodiment]
    seen.progress = known_task(m, r, robot.task).progress if robot.task != NOBODY else 0.0
    seen.lease_left = robot.lease_until - now if robot.controller != NOBODY else 0.0
    seen.handover_left = max(0.0, robot.handover_until - now) if robot.controller != NOBODY else 0.0
    seen.stand_left = max(0.0, robot.stands_until - now)
    seen.broadcast_tokens = robot.broadcast_tokens
    seen.since_broadcast = now - robot.last_broadcast
    seen.since_request = age(now, robot.last_request)
    seen.query_waits = uplink_of(m, r, 0).since >= 0.0
    seen.request_waits = uplink_of(m, r, 1).since >= 0.0
    seen.can_keep = robot.task != NOBODY and not is_ruled_out(m, r, robot.task)
    seen.prescribed = robot.prescribed and seen.can_keep
    seen.can_idle = not seen.prescribed
    has_tokens = robot.broadcast_tokens >= m.rules.message_bytes[BROADCAST]
    seen.can_broadcast = now > robot.last_broadcast and m.n_robots > 1 and has_tokens
    seen.can_assist = (
        robot.task != NOBODY
        and robot.controller == NOBODY
        and not seen.request_waits
        and m.n_operators > 0
        and robot.tokens >= m.rules.message_bytes[REQUEST]
    )
    observe_tasks(m, r, seen.can_idle and seen.stand_left == 0.0, tasks)
    observe_peers(m, r, tasks, peers)
    for h in range(m.n_operators):
        report, row = known_operator(m, r, h), operators[h]
        row.legal = not seen.query_waits
        row.age = age(now, report.time)
        row.session, row.robot, row.fatigue_class = report.session, report.robot, report.fatigue_class
        row.tokens, row.queue = report.tokens, report.queue


@kernel
def observe_tasks(m, r, is_free, rows):
    """Public attributes, robot r's belief, the way there and the mask, task by task."""
    robot, now, n_routes = true_robot(m, r), m.now, 0
    is_ground, place = robot.embodiment == UGV, robot.place
    wanted, between = scratch_of(m).found, routes_of(m).between
    for j in range(m.n_tasks):
        task, belief, row = true_task(m, j), known_task(m, r, j), rows[j]
        show_claim(m, r, j, row)
        row.released = task.released
        row.legal = 0
        row.age = age(now, belief.time)
        row.refused = belief.refused_until > now
        if not task.released:
            hide_task(row)
            continue
        row.type = believed_type(m, r, j)
        row.status = belief.status if belief.time >= 0.0 else OPEN
        row.progress = belief.progress if belief.time >= 0.0 else 0.0
        row.x, row.y = task.x, task.y
        row.difficulty, row.value, row.deadline, row.decay = task.difficulty, task.value, task.deadline, task.decay
        row.distance = distance(task.x - robot.x, task.y - robot.y)
        if row.status == DONE or not is_compatible(robot.embodiment, row.type):
            continue
        row.legal = j != robot.task and not row.refused and is_free
        if is_ground and place != NOBODY:
            row.distance = between[place, j]
        elif is_ground:
            wanted[m.n_corners + n_routes] = j
            n_routes += 1
    if n_routes > 0:
        measure_routes(m, robot, n_routes, rows)


@kernel
def show_claim(m, r, j, row):
    """The claim on task j that a reply told robot r of, if its claimer has not been heard of since."""
    belief = known_task(m, r, j)
    row.claimed_by, row.claim_age = NOBODY, UNKNOWN
    if belief.claim_time >= 0.0 and known_robot(m, r, belief.claimed_by).time < belief.claim_time:
        row.claimed_by, row.claim_age = belief.claimed_by, m.now - belief.claim_time


@kernel
def measure_routes(m, robot, n_routes, rows):
    """Route lengths from between POIs to the tasks listed at the end of the scratch."""
    scratch = scratch_of(m)
    wanted, lengths = scratch.found[m.n_corners :], scratch.distance[m.n_corners :]
    measure_goals(routes_of(m), robot.x, robot.y, wanted, n_routes, lengths, scratch)
    for k in range(n_routes):
        rows[wanted[k]].distance = lengths[k]


@kernel
def hide_task(row):
    """A task that is not announced yet shows nothing."""
    row.type, row.status, row.progress, row.x, row.y, row.distance = 0, 0, 0.0, 0.0, 0.0, 0.0
    row.difficulty, row.value, row.deadline, row.decay = 0.0, 0.0, 0.0, 0.0


@kernel
def observe_peers(m, r, tasks, rows):
    """Cached reports of the other robots; a fresh claim of a task is noted beside the task."""
    now = m.now
    for other in range(m.n_robots):
        peer, row = known_robot(m, r, other), rows[other]
        row.age = age(now, peer.time)
        row.embodiment = true_robot(m, other).embodiment
        row.x, row.y, row.task = peer.x, peer.y, peer.task
        row.activity, row.mode, row.controller = peer.activity, peer.mode, peer.controller
        if peer.time >= 0.0 and peer.task != NOBODY:
            claimed = tasks[peer.task]
            if claimed.claimed_by == NOBODY or row.age < claimed.claim_age:
                claimed.claimed_by, claimed.claim_age = other, row.age


@kernel
def observe_operator(m, h, seen, rows):
    """Everything that operator h can know: itself, its session, and the station's reports."""
    operator, now = true_operator(m, h), m.now
    station = m.n_robots
    seen.operator = h
    seen.time = now
    seen.proficiency[0], seen.proficiency[1] = operator.proficiency[0], operator.proficiency[1]
    seen.capacity, seen.fatigue, seen.tokens = operator.capacity, operator.fatigue, operator.tokens
    seen.session, seen.robot, seen.exempt = operator.session, operator.robot, operator.exempt
    # Whether its last renewal arrived, the operator cannot know.
    seen.lease_left = operator.lease_sent + m.rules.lease - now if operator.session == HELD else 0.0
    seen.since_bid = age(now, operator.bid_at) if operator.session != RESTING else UNKNOWN
    seen.queue = count_waiting(m, h)
    seen.can_keep = operator.session != RESTING
    for r in range(m.n_robots):
        report, row = known_robot(m, station, r), rows[r]
        row.legal = r != operator.robot and report.time >= 0.0 and report.activity != FAILED
        row.embodiment = true_robot(m, r).embodiment
        row.age = age(now, report.time)
        row.activity, row.mode, row.controller = report.activity, report.mode, report.controller
        row.x, row.y, row.task, row.progress = report.x, report.y, report.task, report.progress
        row.request_age = age(now, report.request_time)
        observe_reported_task(m, report, row)


@kernel
def observe_reported_task(m, report, row):
    """What is public of the task that a report names, and what the station believes of it."""
    row.difficulty, row.value, row.deadline, row.decay, row.distance = 0.0, 0.0, 0.0, 0.0, 0.0
    row.task_type, row.task_status, row.compatible, row.task_progress, row.task_age = 0, 0, 0, 0.0, UNKNOWN
    if report.task == NOBODY:
        return
    station, j = m.n_robots, int(report.task)
    task, belief = true_task(m, j), known_task(m, station, j)
    row.difficulty, row.value, row.deadline, row.decay = task.difficulty, task.value, task.deadline, task.decay
    row.distance = distance(task.x - report.x, task.y - report.y)
    row.task_type = believed_type(m, station, j)
    row.compatible = is_compatible(row.embodiment, row.task_type)
    row.task_age = age(m.now, belief.time)
    if belief.time >= 0.0:
        row.task_status, row.task_progress = belief.status, belief.progress
