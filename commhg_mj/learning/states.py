"""The full true state as features of robots, operators and tasks, for the critic alone."""

from typing import NamedTuple

import numpy as np

from ..base.elementary_functions import distance
from ..base.kernels import kernel
from ..base.terms import NOBODY, Activity, Embodiment, Kind, Mode, Session, Status
from ..mission.accessors import (
    flying_of,
    known_robot,
    known_task,
    message_at,
    routes_of,
    true_operator,
    true_robot,
    true_task,
    uplink_of,
)
from ..mission.batch import MissionBatch
from ..mission.estimate import attempt
from ..mission.messages import count_waiting
from ..mission.records import is_compatible
from .features import LONG, columns_of
from .graphs import MINUTE
from .state_features import STATE_MISSION, STATE_OPERATOR, STATE_ROBOT, STATE_TASK

UGV, FAILED, SERVICED, DONE = int(Embodiment.UGV), int(Activity.FAILED), int(Status.SERVICED), int(Status.DONE)
TRAVELLING, SERVICING = int(Activity.TRAVELLING), int(Activity.SERVICING)
HANDOVER, CONTROLLED = int(Mode.HANDOVER), int(Mode.CONTROLLED)
BID, HELD = int(Session.BID), int(Session.HELD)
N_KINDS, BROADCAST, TELEMETRY = len(Kind), int(Kind.BROADCAST), int(Kind.TELEMETRY)
QUERY, REQUEST, REPLY = int(Kind.QUERY), int(Kind.REQUEST), int(Kind.REPLY)
CONTROL, RENEWAL, RELEASE = int(Kind.CONTROL), int(Kind.RENEWAL), int(Kind.RELEASE)


class States(NamedTuple):
    """S states of missions with R robots, H operators and T tasks."""

    robot: np.ndarray  # [S, R, STATE_ROBOT.width] f4
    operator: np.ndarray  # [S, H, STATE_OPERATOR.width] f4
    task: np.ndarray  # [S, T, STATE_TASK.width] f4
    is_open: np.ndarray  # [S, T] bool: released and not done
    mission: np.ndarray  # [S, STATE_MISSION.width] f4


def read_states(batch: MissionBatch, scale, missions: np.ndarray) -> States:
    """The states of some missions [S]."""
    s, scenario = len(missions), batch.scenario
    r, h, t = scenario.n_robots, scenario.n_operators, scenario.n_tasks
    states = States(
        STATE_ROBOT.zeros(s, r), STATE_OPERATOR.zeros(s, h), STATE_TASK.zeros(s, t), np.zeros((s, t), bool),
        STATE_MISSION.zeros(s),
    )  # fmt: skip
    fill_states(batch.state.missions, missions, scale, states)
    return States(*(records if records.dtype == bool else columns_of(records) for records in states))


@kernel
def fill_states(missions, which, scale, states):
    """Write the features of some missions."""
    for s in range(which.shape[0]):
        m = missions[which[s]]
        for r in range(m.n_robots):
            write_state_robot(m, r, scale, states.robot[s, r])
        for h in range(m.n_operators):
            write_state_operator(m, h, scale, states.operator[s, h])
        for j in range(m.n_tasks):
            task = true_task(m, j)
            if task.released and task.status != DONE:
                states.is_open[s, j] = True
                write_state_task(m, task, scale, states.task[s, j])
        out = states.mission[s]
        out.time, out.time_left = m.now / scale.limit, np.exp(-(scale.limit - m.now) / LONG)
        out.pending = m.pending_value / m.total_value
        out.flying = m.flying / 64.0
        write_messages(m, out)


@kernel
def write_messages(m, out):
    """Messages under way, by kind."""
    counts = np.zeros(N_KINDS)
    for k in range(m.flying):
        counts[message_at(m, flying_of(m, k).slot).kind] += 1.0 / 16.0
    out.flying_broadcast, out.flying_telemetry = counts[BROADCAST], counts[TELEMETRY]
    out.flying_query, out.flying_request, out.flying_reply = counts[QUERY], counts[REQUEST], counts[REPLY]
    out.flying_control, out.flying_renewal, out.flying_release = counts[CONTROL], counts[RENEWAL], counts[RELEASE]


@kernel
def write_state_robot(m, r, scale, out):
    """A robot as it is."""
    robot, now = true_robot(m, r), m.now
    out.is_ugv, out.is_uav = robot.embodiment == UGV, robot.embodiment != UGV
    out.x, out.y = robot.x / scale.side, robot.y / scale.side
    out.failed = robot.activity == FAILED
    out.travelling, out.servicing = robot.activity == TRAVELLING, robot.activity == SERVICING
    out.handover, out.controlled = robot.mode == HANDOVER, robot.mode == CONTROLLED
    out.tokens, out.broadcast_tokens = robot.tokens / scale.bucket, robot.broadcast_tokens / scale.broadcast_bucket
    out.stand_left = min(1.0, max(0.0, robot.stands_until - now) / MINUTE)
    out.since_broadcast = min(1.0, (now - robot.last_broadcast) / MINUTE)
    out.prescribed, out.due = robot.prescribed, robot.due
    if robot.controller != NOBODY:
        out.lease_left = (robot.lease_until - now) / scale.lease
    if robot.task != NOBODY:
        task = true_task(m, robot.task)
        speed = m.rules.speed[1 if robot.mode == CONTROLLED else 0, robot.embodiment]
        way = distance(task.x - robot.x, task.y - robot.y)
        gain, seconds = attempt(m.rules, way, speed, task.difficulty, task.deadline, task.decay, float(now))
        out.has_task, out.distance, out.progress = 1.0, way / scale.side, task.progress
        out.difficulty, out.value, out.expected_value = task.difficulty, task.value / scale.value, task.value * gain / scale.value
        out.seconds, out.slack = seconds / LONG, np.tanh((task.deadline - now) / LONG)
        out.incompatible = task.type != 2 and (task.type == 1) != (robot.embodiment == UGV)
        out.is_sure = known_task(m, r, robot.task).time >= 0.0
    write_knowledge(m, r, robot, scale, out)
    out.query_waits, out.request_waits = uplink_of(m, r, 0).since >= 0.0, uplink_of(m, r, 1).since >= 0.0
    out.telemetry_waits = uplink_of(m, r, 2).since >= 0.0
    write_choices(m, robot, scale, out)


@kernel
def write_knowledge(m, r, robot, scale, out):
    """How new and how true the records of robot r are, and the station's of it."""
    known, wrong, age = 0, 0, 0.0
    for other in range(m.n_robots):
        peer = known_robot(m, r, other)
        if other != r and peer.time >= 0.0:
            known += 1
            wrong += peer.task != true_robot(m, other).task
            age += newness(m.now, peer.time)
    others = max(1, m.n_robots - 1)
    out.known_peers, out.peers_age, out.wrong_peers = known / others, age / max(1, known), wrong / others
    mistaken, pending = 0, 0
    for j in range(m.n_tasks):
        task, belief = true_task(m, j), known_task(m, r, j)
        if task.released and task.status != DONE:
            pending += 1
            mistaken += belief.time >= 0.0 and belief.status != task.status
    out.wrong_tasks = mistaken / max(1, pending)
    report = known_robot(m, m.n_robots, r)
    if report.time >= 0.0:
        out.station_age = newness(m.now, report.time)
        out.station_error = distance(report.x - robot.x, report.y - robot.y) / scale.side


@kernel
def newness(now, time):
    """How new evidence is; 0: there is none."""
    return np.exp(-(now - time) / LONG) if time >= 0.0 else 0.0


@kernel
def write_choices(m, robot, scale, out):
    """Open tasks that nobody has and the robot can do: how many, and the way to the nearest."""
    nearest, n, between = 1.0, 0, routes_of(m).between
    for j in range(m.n_tasks):
        task = true_task(m, j)
        if task.released and task.status != DONE and task.owner == NOBODY and is_compatible(robot.embodiment, task.type):
            way = distance(task.x - robot.x, task.y - robot.y)
            if robot.embodiment == UGV and robot.place != NOBODY:
                way = between[robot.place, j]
            nearest, n = min(nearest, way / scale.side), n + 1
    out.best_way, out.choices = nearest, np.tanh(n / 4.0)


@kernel
def write_state_operator(m, h, scale, out):
    """An operator as it is."""
    operator = true_operator(m, h)
    out.uav_proficiency, out.ugv_proficiency = operator.proficiency[0], operator.proficiency[1]
    out.capacity, out.fatigue = operator.capacity, operator.fatigue
    out.bidding, out.holding = operator.session == BID, operator.session == HELD
    out.tokens, out.exempt = operator.tokens / scale.bucket, operator.exempt
    if operator.robot != NOBODY:
        robot = true_robot(m, operator.robot)
        out.robot_is_ugv, out.robot_servicing = robot.embodiment == UGV, robot.activity == SERVICING
        out.has_control = robot.controller == h
        out.report_age = newness(m.now, known_robot(m, m.n_robots, operator.robot).time)
        if robot.task != NOBODY:
            task = true_task(m, robot.task)
            out.robot_difficulty, out.robot_value = task.difficulty, task.value / scale.value
            out.robot_way = distance(task.x - robot.x, task.y - robot.y) / scale.side
            out.robot_due = np.tanh((task.deadline - m.now) / LONG)
    asked = 0
    for r in range(m.n_robots):
        asked += known_robot(m, m.n_robots, r).request_time >= max(0.0, m.now - MINUTE)
    out.queue, out.requests = np.tanh(count_waiting(m, h) / 4.0), asked / m.n_robots


@kernel
def write_state_task(m, task, scale, out):
    """An open task as it is."""
    now = m.now
    late = max(0.0, now - task.deadline)
    out.x, out.y = task.x / scale.side, task.y / scale.side
    out.difficulty, out.value = task.difficulty, task.value / scale.value
    out.slack, out.is_late = np.tanh((task.deadline - now) / LONG), late > 0.0
    out.value_now, out.decay = np.exp(-late / task.decay) * task.value / scale.value, task.decay / scale.decay
    out.uav_only, out.ugv_only, out.general = task.type == 0, task.type == 1, task.type == 2
    out.serviced, out.progress, out.owned = task.status == SERVICED, task.progress, task.owner != NOBODY
    out.since_release = np.exp(-max(0.0, now - task.release) / LONG)
