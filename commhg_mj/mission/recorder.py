"""What a recorded mission writes down as it goes; mission/trace.py turns it into a file."""

from typing import NamedTuple

import numpy as np

from ..base.kernels import kernel
from ..base.terms import NOBODY, Kind
from ..radio.links import fates
from . import state as s
from .accessors import (
    belief_row,
    known_operator,
    known_robot,
    known_task,
    link_row,
    message_row,
    operator_row,
    peer_row,
    resource_row,
    reward_row,
    robot_row,
    true_operator,
    true_robot,
    true_task,
)
from .propagation import link_between, link_to_station

SAMPLE_PERIOD = 5  # s between samples of links and records
BROADCAST, TELEMETRY = int(Kind.BROADCAST), int(Kind.TELEMETRY)
NOT_DECIDED = -9  # a choice column where the actor did not decide in that second


class Log(NamedTuple):
    """Rows of a batch; arrays without rows when nothing is recorded."""

    robots: np.ndarray  # [E, ticks + 1, R] ROBOT_ROW
    operators: np.ndarray  # [E, ticks + 1, H] OPERATOR_ROW
    messages: np.ndarray  # [E, capacity] MESSAGE_ROW
    rewards: np.ndarray  # [E, ticks] REWARD_ROW
    links: np.ndarray  # [E, samples, R, R + 1] LINK_ROW
    beliefs: np.ndarray  # [E, samples, R + 1, T] BELIEF_ROW
    peers: np.ndarray  # [E, samples, R + 1, R] PEER_ROW
    resources: np.ndarray  # [E, samples, R, H] RESOURCE_ROW


def new_log(n_missions: int, scenario, recording: bool) -> Log:
    """Room for every row that a mission can write; without recording, rooms without rows."""
    r, h, t, limit = scenario.n_robots, scenario.n_operators, scenario.n_tasks, scenario.time_limit
    e, ticks, samples = n_missions, limit * recording, (limit // SAMPLE_PERIOD + 1) * recording
    # Per second a robot broadcasts once and queues one message of each uplink kind; replies answer queries. An operator
    # queues a release and a command where it decides, and once more where a report or its clock ends what it had.
    lines = ticks * (r * (scenario.communication.out_degree + 4) + 4 * h)
    return Log(
        robots=np.zeros((e, ticks + recording, r), s.ROBOT_ROW),
        operators=np.zeros((e, ticks + recording, h), s.OPERATOR_ROW),
        messages=np.zeros((e, lines), s.MESSAGE_ROW),
        links=np.zeros((e, samples, r, r + 1), s.LINK_ROW),
        beliefs=np.zeros((e, samples, r + 1, t), s.BELIEF_ROW),
        peers=np.zeros((e, samples, r + 1, r), s.PEER_ROW),
        resources=np.zeros((e, samples, r, h), s.RESOURCE_ROW),
        rewards=np.zeros((e, ticks), s.REWARD_ROW),
    )


@kernel
def log_message(m, kind, sender, receiver, now):
    """Open the line of a new message; returns its number."""
    line = m.messages
    m.messages += 1
    if line < m.n_log_messages:
        row = message_row(m, line)
        row.queued, row.sent, row.ended = now, -1, -1
        row.sender, row.receiver, row.kind = sender, receiver, kind
    return line


@kernel
def log_sent(m, line, late, now):
    """The message left its antenna; `late` if its delivery is delayed."""
    if line < m.n_log_messages:
        row = message_row(m, line)
        row.sent, row.late = now, late


@kernel
def log_end(m, line, fate, now):
    """The message met its fate."""
    if line < m.n_log_messages:
        row = message_row(m, line)
        row.fate, row.ended = fate, now


@kernel
def log_robot_decision(m, r, choice, broadcast, query, request):
    """What robot r chose in this second; where arbitration takes no time, a refused robot decides twice."""
    now = m.now
    if now < m.n_log_ticks:
        row = robot_row(m, now, r)
        row.choice = choice
        row.broadcast |= broadcast
        row.request |= request
        if query != NOBODY:
            row.query = query


@kernel
def log_operator_decision(m, h, choice):
    """What operator h chose in this second."""
    now = m.now
    if now < m.n_log_ticks:
        operator_row(m, now, h).choice = choice


@kernel
def log_tick(m):
    """Write the state at the mission's current second."""
    now = m.now
    if now >= m.n_log_ticks:
        return
    for r in range(m.n_robots):
        robot, row = true_robot(m, r), robot_row(m, now, r)
        row.x, row.y, row.tokens, row.broadcast_tokens = robot.x, robot.y, robot.tokens, robot.broadcast_tokens
        row.stand_left = max(0.0, robot.stands_until - now)
        row.task, row.activity, row.mode, row.controller = robot.task, robot.activity, robot.mode, robot.controller
        row.progress = true_task(m, robot.task).progress if robot.task != NOBODY else 0.0
        row.choice = NOT_DECIDED
        row.query = NOBODY
    for h in range(m.n_operators):
        operator, row = true_operator(m, h), operator_row(m, now, h)
        row.fatigue, row.tokens = operator.fatigue, operator.tokens
        row.session, row.robot, row.choice = operator.session, operator.robot, NOT_DECIDED
    if now > 0:
        row = reward_row(m, now - 1)
        row.mission, row.coordination = m.tick_reward[0], m.tick_reward[1]
    if now % SAMPLE_PERIOD == 0:
        sample_links(m, now // SAMPLE_PERIOD)
        sample_records(m, now // SAMPLE_PERIOD, now)


@kernel
def sample_links(m, k):
    """Percent of messages that each link would deliver now, broadcasts or telemetry; 0 out of range."""
    n = m.n_robots
    for a in range(n):
        for b in range(a):
            percent = percent_delivered(m, link_between(m, a, b, BROADCAST))
            link_row(m, k * n + a, b).percent = percent
            link_row(m, k * n + b, a).percent = percent
        link_row(m, k * n + a, n).percent = percent_delivered(m, link_to_station(m, a, TELEMETRY))


@kernel
def percent_delivered(m, passing):
    """Percent of messages that arrive, in time or late."""
    on_time, late = fates(m.rules.radio, passing)
    return np.uint8(100.0 * (on_time + late) + 0.5)


@kernel
def sample_records(m, k, now):
    """What every receiver holds now."""
    n = m.n_robots
    for receiver in range(n + 1):
        for j in range(m.n_tasks):
            belief, row = known_task(m, receiver, j), belief_row(m, k * (n + 1) + receiver, j)
            row.time, row.type, row.status = belief.time, belief.type, belief.status
            row.progress = np.uint8(255.0 * belief.progress + 0.5)
            row.refused = belief.refused_until > now
            row.claim_time, row.claimed_by = belief.claim_time, belief.claimed_by
        for r in range(n):
            peer, row = known_robot(m, receiver, r), peer_row(m, k * (n + 1) + receiver, r)
            row.time, row.task, row.x, row.y = peer.time, peer.task, peer.x, peer.y
            row.activity, row.mode, row.controller = peer.activity, peer.mode, peer.controller
    for r in range(n):
        for h in range(m.n_operators):
            report, row = known_operator(m, r, h), resource_row(m, k * n + r, h)
            row.time, row.tokens, row.queue, row.robot = report.time, report.tokens, report.queue, report.robot
            row.session, row.fatigue_class = report.session, report.fatigue_class
