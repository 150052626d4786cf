"""What a recorded mission writes down as it goes; mission/trace.py turns it into a file."""

import numpy as np

from ..kernels import kernel
from ..radio.links import robot_link, station_link
from ..terms import NOBODY
from .state import record
from .view import Log

SAMPLE_PERIOD = 5  # s between samples of links and records
NOT_DECIDED = -9  # a choice column where the actor did not decide in that second


ROBOT_ROW = record(
    x="f4", y="f4", progress="f4", tokens="f4", task="i2", choice="i2", activity="i1", mode="i1", controller="i1", broadcast="i1",
    query="i1", request="i1",
)  # fmt: skip
OPERATOR_ROW = record(fatigue="f4", tokens="f4", robot="i2", choice="i2", session="i1")
MESSAGE_ROW = record(
    queued="i4", sent="i4", ended="i4", sender="i2", receiver="i2", kind="i1", fate="i1", late="i1",
)  # fmt: skip
BELIEF_ROW = record(time="i4", progress="u1", type="i1", status="i1", refused="i1")
PEER_ROW = record(time="i4", task="i2", x="f4", y="f4", activity="i1", mode="i1", controller="i1")
RESOURCE_ROW = record(time="i4", tokens="i2", queue="i2", robot="i2", session="i1", fatigue_class="i1")


def new_log(n_missions: int, scenario, recording: bool) -> Log:
    """Room for every row that a mission can write; without recording, rooms without rows."""
    r, h, t, limit = scenario.n_robots, scenario.n_operators, scenario.n_tasks, scenario.time_limit
    e, ticks, samples = n_missions, limit * recording, (limit // SAMPLE_PERIOD + 1) * recording
    # Per second a robot broadcasts once and queues one message of each uplink kind; replies answer queries.
    lines = ticks * (r * (scenario.communication.out_degree + 4) + h)
    return Log(
        robots=np.zeros((e, ticks + recording, r), ROBOT_ROW),
        operators=np.zeros((e, ticks + recording, h), OPERATOR_ROW),
        messages=np.zeros((e, lines), MESSAGE_ROW),
        links=np.zeros((e, samples, r, r + 1), np.uint8),
        beliefs=np.zeros((e, samples, r + 1, t), BELIEF_ROW),
        peers=np.zeros((e, samples, r + 1, r), PEER_ROW),
        resources=np.zeros((e, samples, r, h), RESOURCE_ROW),
        rewards=np.zeros((e, ticks, 2)),
    )


@kernel
def log_message(m, kind, sender, receiver, now):
    """Open the line of a new message; returns its number."""
    line = m.info[0].messages
    m.info[0].messages += 1
    if line < m.log.messages.shape[0]:
        row = m.log.messages[line]
        row.queued, row.sent, row.ended = now, -1, -1
        row.sender, row.receiver, row.kind = sender, receiver, kind
    return line


@kernel
def log_sent(m, line, late, now):
    """The message left its antenna; `late` if its delivery is delayed."""
    if line < m.log.messages.shape[0]:
        m.log.messages[line].sent, m.log.messages[line].late = now, late


@kernel
def log_end(m, line, fate, now):
    """The message met its fate."""
    if line < m.log.messages.shape[0]:
        row = m.log.messages[line]
        row.fate, row.ended = fate, now


@kernel
def log_robot_decision(m, r, choice, broadcast, query, request):
    """What robot r chose in this second (written into the row that the next log_tick completes)."""
    now = m.info[0].now
    if now < m.log.robots.shape[0]:
        row = m.log.robots[now, r]
        row.choice, row.broadcast, row.query, row.request = choice, broadcast, query, request


@kernel
def log_operator_decision(m, h, choice):
    """What operator h chose in this second."""
    now = m.info[0].now
    if now < m.log.operators.shape[0]:
        m.log.operators[now, h].choice = choice


@kernel
def log_tick(m):
    """Write the state at the mission's current second."""
    now = m.info[0].now
    if now >= m.log.robots.shape[0]:
        return
    for r in range(m.robots.shape[0]):
        robot, row = m.robots[r], m.log.robots[now, r]
        row.x, row.y, row.tokens = robot.x, robot.y, robot.tokens
        row.task, row.activity, row.mode, row.controller = robot.task, robot.activity, robot.mode, robot.controller
        row.progress = m.tasks[robot.task].progress if robot.task != NOBODY else 0.0
        row.choice = NOT_DECIDED
        row.query = NOBODY
    for h in range(m.operators.shape[0]):
        operator, row = m.operators[h], m.log.operators[now, h]
        row.fatigue, row.tokens = operator.fatigue, operator.tokens
        row.session, row.robot, row.choice = operator.session, operator.robot, NOT_DECIDED
    if now > 0:
        m.log.rewards[now - 1] = m.info[0].tick_reward
    if now % SAMPLE_PERIOD == 0:
        sample_links(m, now // SAMPLE_PERIOD)
        sample_records(m, now // SAMPLE_PERIOD, now)


@kernel
def sample_links(m, k):
    """Percent of messages that each link would deliver now; 0 out of range."""
    rules = m.rules[0]
    clear = 50.0 * (1.0 + rules.on_time)
    n = m.robots.shape[0]
    for a in range(n):
        one = m.robots[a]
        for b in range(a):
            other = m.robots[b]
            percent = np.uint8(clear * robot_link(rules, m.ground, one.x, one.y, other.x, other.y) + 0.5)
            m.log.links[k, a, b] = percent
            m.log.links[k, b, a] = percent
        m.log.links[k, a, n] = np.uint8(clear * station_link(rules, m.ground, one.x, one.y) + 0.5)


@kernel
def sample_records(m, k, now):
    """What every receiver holds now."""
    n = m.robots.shape[0]
    for receiver in range(n + 1):
        for j in range(m.tasks.shape[0]):
            belief, row = m.beliefs[receiver, j], m.log.beliefs[k, receiver, j]
            row.time, row.type, row.status = belief.time, belief.type, belief.status
            row.progress = np.uint8(255.0 * belief.progress + 0.5)
            row.refused = belief.refused_until > now
        for r in range(n):
            peer, row = m.peers[receiver, r], m.log.peers[k, receiver, r]
            row.time, row.task, row.x, row.y = peer.time, peer.task, peer.x, peer.y
            row.activity, row.mode, row.controller = peer.activity, peer.mode, peer.controller
    for r in range(n):
        for h in range(m.operators.shape[0]):
            report, row = m.resources[r, h], m.log.resources[k, r, h]
            row.time, row.tokens, row.queue, row.robot = report.time, report.tokens, report.queue, report.robot
            row.session, row.fatigue_class = report.session, report.fatigue_class
