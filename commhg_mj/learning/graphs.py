"""Local graphs: what one due actor knows, as features of nodes and edges (paper, section III-B; docs/learning.md).

Everything is scaled by the scenario's own side, limit and rules, so that one set of weights reads any scale. Edges are
ragged: only released tasks that are not believed done, and peers that have been heard of. Unknown is a flag of its own.
"""

from typing import NamedTuple

import numpy as np

from ..base.kernels import kernel, record
from ..base.terms import NOBODY, Activity, Embodiment, Mode, Session, Status
from ..mission.batch import MissionBatch
from ..mission.estimate import attempt, control_gain
from ..mission.observe import Observations

UGV, DONE, SERVICED = int(Embodiment.UGV), int(Status.DONE), int(Status.SERVICED)
TRAVELLING, SERVICING = int(Activity.TRAVELLING), int(Activity.SERVICING)
HANDOVER, CONTROLLED = int(Mode.HANDOVER), int(Mode.CONTROLLED)
BID, HELD = int(Session.BID), int(Session.HELD)

SCALE = record(side="f8", limit="f8", value="f8", speed="f8", bucket="f8", lease="f8", handover="f8", decay="f8")
SHORT, LONG = 30.0, 200.0  # s: ages enter as exp(-age / each)
MINUTE = 60.0  # s

N_PUBLIC = 6  # features of a task that all know once it is released
N_ROBOT, N_TASK_EDGE, N_PEER, N_RESOURCE = 26, 22, 16, 10
N_OPERATOR, N_REPORT = 14, 25
IS_KNOWN = 0  # a resource report's feature
VALUE_RATE, IS_HELD = 5, 18  # the task edge's features that say what it promises per second, and that it is the robot's own


class RobotGraphs(NamedTuple):
    """N due robots with E task edges and P peer edges; edges of row i are ptr[i]:ptr[i + 1]."""

    itself: np.ndarray  # [N, N_ROBOT] f4
    task_ptr: np.ndarray  # [N + 1] i8
    task: np.ndarray  # [E] i8 index of the task in the mission
    task_edge: np.ndarray  # [E, N_TASK_EDGE] f4
    task_legal: np.ndarray  # [E] bool
    own_edge: np.ndarray  # [N] i8 edge of the held task, -1: none
    peer_ptr: np.ndarray  # [N + 1] i8
    peer_edge: np.ndarray  # [P, N_PEER] f4
    resource: np.ndarray  # [N, H, N_RESOURCE] f4
    keep_idle: np.ndarray  # [N, 2] bool legal
    gate: np.ndarray  # [N] bool: a broadcast is open
    query: np.ndarray  # [N, H] bool legal
    assist: np.ndarray  # [N] bool legal
    mission: np.ndarray  # [N] i8
    robot: np.ndarray  # [N] i8


class OperatorGraphs(NamedTuple):
    """K due operators with R robots' reports each."""

    itself: np.ndarray  # [K, N_OPERATOR] f4
    report: np.ndarray  # [K, R, N_REPORT] f4
    known: np.ndarray  # [K, R] bool
    legal: np.ndarray  # [K, R] bool
    keep_rest: np.ndarray  # [K, 2] bool legal
    held: np.ndarray  # [K] i8 robot of the session, -1: none
    mission: np.ndarray  # [K] i8
    operator: np.ndarray  # [K] i8


class GraphBuilder:
    """Turns observations of one batch's scenario into local graphs."""

    def __init__(self, batch: MissionBatch):
        scenario, rules = batch.scenario, batch.scenario.robots
        self.rules = batch.rules
        self.scale = np.zeros(1, SCALE)
        fastest = max(*rules.autonomous_speed, *rules.controlled_speed)
        self.scale[0] = (
            scenario.map_side, scenario.time_limit, max(scenario.tasks.values), fastest, scenario.communication.bucket,
            scenario.operators.lease, max(1.0, scenario.operators.handover), scenario.tasks.decay[1],
        )  # fmt: skip

    def public(self, tasks: np.ndarray) -> np.ndarray:
        """[E, T, N_PUBLIC] f4 of tasks [E, T] of the state: what everybody knows of them from their release on."""
        scale = self.scale[0]
        columns = [
            tasks["x"] / scale["side"], tasks["y"] / scale["side"], tasks["difficulty"], tasks["value"] / scale["value"],
            tasks["deadline"] / scale["limit"], tasks["decay"] / scale["decay"],
        ]  # fmt: skip
        return np.stack(columns, axis=-1).astype(np.float32)

    def robots(self, seen: Observations) -> RobotGraphs:
        """Graphs of the robots that are due."""
        n, tasks = seen.robot_tasks.shape
        peers, operators = seen.robot_peers.shape[1], seen.robot_operators.shape[1]
        graphs = RobotGraphs(
            np.zeros((n, N_ROBOT), np.float32), np.zeros(n + 1, np.int64), np.empty(n * tasks, np.int64),
            np.zeros((n * tasks, N_TASK_EDGE), np.float32), np.empty(n * tasks, bool), np.full(n, NOBODY),
            np.zeros(n + 1, np.int64), np.zeros((n * peers, N_PEER), np.float32),
            np.zeros((n, operators, N_RESOURCE), np.float32), np.empty((n, 2), bool), np.empty(n, bool),
            np.empty((n, operators), bool), np.empty(n, bool), np.empty(n, np.int64), np.empty(n, np.int64),
        )  # fmt: skip
        edges, peers = fill_robots(self.rules[0], self.scale[0], seen, graphs)
        return graphs._replace(
            task=graphs.task[:edges], task_edge=graphs.task_edge[:edges], task_legal=graphs.task_legal[:edges],
            peer_edge=graphs.peer_edge[:peers],
        )  # fmt: skip

    def operators(self, seen: Observations) -> OperatorGraphs:
        """Graphs of the operators that are due."""
        k, r = seen.operator_reports.shape
        graphs = OperatorGraphs(
            np.zeros((k, N_OPERATOR), np.float32), np.zeros((k, r, N_REPORT), np.float32), np.empty((k, r), bool),
            np.empty((k, r), bool), np.empty((k, 2), bool), np.empty(k, np.int64), np.empty(k, np.int64), np.empty(k, np.int64),
        )  # fmt: skip
        fill_operators(self.rules[0], self.scale[0], seen, graphs)
        return graphs


@kernel
def write_age(features, k, age):
    """Known, and two bounded transforms of an age; all 0 where it is unknown."""
    if age >= 0.0:
        features[k] = 1.0
        features[k + 1] = np.exp(-age / SHORT)
        features[k + 2] = np.exp(-age / LONG)


@kernel
def fill_robots(rules, scale, seen, graphs):
    """Write the graphs of all due robots; returns (task edges, peer edges)."""
    edges, peers = 0, 0
    for i in range(seen.robots.shape[0]):
        robot = seen.robots[i]
        graphs.mission[i], graphs.robot[i] = robot.mission, robot.robot
        graphs.keep_idle[i, 0], graphs.keep_idle[i, 1] = robot.can_keep, robot.can_idle
        graphs.gate[i], graphs.assist[i] = robot.can_broadcast, robot.can_assist
        write_robot(scale, robot, graphs.itself[i])
        for j in range(seen.robot_tasks.shape[1]):
            row = seen.robot_tasks[i, j]
            if row.released and row.status != DONE:
                write_task_edge(rules, scale, robot, j, row, graphs.task_edge[edges])
                graphs.task[edges], graphs.task_legal[edges] = j, row.legal
                if j == robot.task:
                    graphs.own_edge[i] = edges
                edges += 1
        for other in range(seen.robot_peers.shape[1]):
            row = seen.robot_peers[i, other]
            if row.age >= 0.0:
                write_peer(scale, robot, row, graphs.peer_edge[peers])
                peers += 1
        for h in range(seen.robot_operators.shape[1]):
            row = seen.robot_operators[i, h]
            graphs.query[i, h] = row.legal
            write_resource(scale, robot, h, row, graphs.resource[i, h])
        graphs.task_ptr[i + 1], graphs.peer_ptr[i + 1] = edges, peers
    return edges, peers


@kernel
def write_robot(scale, robot, out):
    """A robot's own state and resources."""
    out[0], out[1] = robot.embodiment == UGV, robot.embodiment != UGV
    out[2], out[3] = robot.x / scale.side, robot.y / scale.side
    out[4], out[5] = robot.activity == TRAVELLING, robot.activity == SERVICING
    out[6], out[7] = robot.mode == HANDOVER, robot.mode == CONTROLLED
    out[8] = robot.speed / scale.speed
    out[9], out[10] = robot.task != NOBODY, robot.progress
    out[11], out[12] = robot.lease_left / scale.lease, robot.handover_left / scale.handover
    out[13] = robot.tokens / scale.bucket
    out[14] = min(1.0, robot.since_broadcast / MINUTE)
    write_age(out, 15, robot.since_request)
    out[18], out[19] = robot.query_waits, robot.request_waits
    out[20], out[21] = robot.prescribed, robot.can_keep
    out[22], out[23] = robot.can_broadcast, robot.can_assist
    out[24], out[25] = robot.time / scale.limit, np.exp(-(scale.limit - robot.time) / LONG)


@kernel
def write_task_edge(rules, scale, robot, j, row, out):
    """What a robot knows of a task, and the way there."""
    gain, seconds = attempt(rules, row.distance, robot.speed, row.difficulty, row.deadline, row.decay, robot.time)
    arrival = robot.time + row.distance / robot.speed
    out[0] = row.distance / scale.side
    out[1], out[2] = (row.x - robot.x) / scale.side, (row.y - robot.y) / scale.side
    out[3] = seconds / LONG
    out[4] = row.value * gain / scale.value
    out[5] = 60.0 * row.value * gain / scale.value / seconds
    slack = row.deadline - arrival
    out[6], out[7] = np.tanh(slack / LONG), slack < 0.0
    out[8] = max(-1.0, (scale.limit - robot.time - seconds) / scale.limit)
    out[9], out[10], out[11] = row.type == 0, row.type == 1, row.type == 2
    out[12], out[13] = row.status == SERVICED, row.progress
    write_age(out, 14, row.age)
    out[17], out[18] = row.refused, j == robot.task
    if row.claimed_by != NOBODY:
        write_age(out, 19, row.claim_age)


@kernel
def write_peer(scale, robot, row, out):
    """A cached report of a peer."""
    out[0], out[1] = row.embodiment == UGV, row.embodiment != UGV
    dx, dy = (row.x - robot.x) / scale.side, (row.y - robot.y) / scale.side
    out[2], out[3], out[4] = dx, dy, np.sqrt(dx * dx + dy * dy)
    out[5], out[6], out[7] = row.activity == 0, row.activity == TRAVELLING, row.activity == SERVICING
    out[8], out[9] = row.mode == HANDOVER, row.mode == CONTROLLED
    out[10], out[11] = row.task != NOBODY, row.task != NOBODY and row.task == robot.task
    out[12] = row.controller != NOBODY
    write_age(out, 13, row.age)


@kernel
def write_resource(scale, robot, h, row, out):
    """An operator's last resource report."""
    write_age(out, 0, row.age)
    if row.age >= 0.0:
        out[3], out[4] = row.tokens / scale.bucket, np.tanh(row.queue / 4.0)
        out[5], out[6] = row.session == BID, row.session == HELD
        out[7] = row.robot == robot.robot
        out[8] = row.fatigue_class / 2.0
    out[9] = robot.controller == h


@kernel
def fill_operators(rules, scale, seen, graphs):
    """Write the graphs of all due operators."""
    for i in range(seen.operators.shape[0]):
        operator = seen.operators[i]
        graphs.mission[i], graphs.operator[i], graphs.held[i] = operator.mission, operator.operator, operator.robot
        graphs.keep_rest[i, 0], graphs.keep_rest[i, 1] = operator.can_keep, True
        out = graphs.itself[i]
        out[0], out[1], out[2] = operator.proficiency[0], operator.proficiency[1], operator.capacity
        out[3] = operator.fatigue
        out[4], out[5] = operator.session == BID, operator.session == HELD
        out[6] = max(-1.0, operator.lease_left / scale.lease)
        write_age(out, 7, operator.since_bid)
        out[10], out[11] = operator.tokens / scale.bucket, operator.exempt
        out[12], out[13] = operator.time / scale.limit, np.exp(-(scale.limit - operator.time) / LONG)
        for r in range(seen.operator_reports.shape[1]):
            row = seen.operator_reports[i, r]
            graphs.known[i, r], graphs.legal[i, r] = row.age >= 0.0, row.legal
            if row.age >= 0.0:
                write_report(rules, scale, operator, r, row, graphs.report[i, r])


@kernel
def write_report(rules, scale, operator, r, row, out):
    """The station's report of a robot, and what control of it would gain."""
    out[0], out[1] = row.embodiment == UGV, row.embodiment != UGV
    out[2], out[3], out[4] = row.activity == 0, row.activity == TRAVELLING, row.activity == SERVICING
    out[5], out[6] = row.mode == HANDOVER, row.mode == CONTROLLED
    out[7] = row.controller != NOBODY and row.controller != operator.operator
    out[8] = row.controller == operator.operator
    out[9], out[10] = row.x / scale.side, row.y / scale.side
    write_age(out, 11, row.age)
    write_age(out, 14, row.request_age)
    out[17] = r == operator.robot
    if row.task != NOBODY:
        out[18], out[19], out[20] = 1.0, row.progress, row.difficulty
        out[21] = row.value / scale.value
        out[22] = np.tanh((row.deadline - operator.time) / LONG)
        out[23] = row.distance / scale.side
        gain = control_gain(
            rules, operator.proficiency[row.embodiment], operator.fatigue, row.embodiment, row.distance, row.progress,
            row.difficulty, row.value, row.deadline, row.decay, operator.time,
        )  # fmt: skip
        out[24] = np.tanh(60.0 * gain)
