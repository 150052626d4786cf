"""Local graphs: what one due actor knows, as features of nodes and edges (paper, section III-B; docs/learning.md).

Everything is scaled by the scenario's own side, limit and rules, so that one set of weights reads any scale. Edges are
ragged: only released tasks that are not believed done, and peers that have been heard of. Unknown is a flag of its own.
What few methods need beside it, they say in `Wants`.
"""

from typing import NamedTuple

import numpy as np

from ..base.elementary_functions import distance
from ..base.kernels import kernel, record
from ..base.terms import KEEP, NOBODY, Activity, Embodiment, Mode, Session, Status
from ..mission.batch import MissionBatch
from ..mission.decide import Decisions
from ..mission.estimate import attempt, control_gain
from ..mission.observe import Observations
from ..policies.planner import WHOLE, new_desk, new_memory, supervise, talk
from ..policies.schedule import follow_schedule
from .features import LONG, OPERATOR, PEER, PLAN, PLAN_EDGE, PUBLIC, REPORT, RESOURCE, ROBOT, SHORT, TASK_EDGE, columns_of
from .memory import Memory, forget, recall
from .plan_numbers import fill_plans

UGV, DONE, SERVICED = int(Embodiment.UGV), int(Status.DONE), int(Status.SERVICED)
TRAVELLING, SERVICING = int(Activity.TRAVELLING), int(Activity.SERVICING)
HANDOVER, CONTROLLED = int(Mode.HANDOVER), int(Mode.CONTROLLED)
BID, HELD = int(Session.BID), int(Session.HELD)

SCALE = record(
    side="f8", limit="f8", value="f8", speed="f8", bucket="f8", broadcast_bucket="f8", lease="f8", handover="f8", decay="f8"
)
MINUTE = 60.0  # s


class Wants(NamedTuple):
    """What a method's graphs hold beside what all get."""

    every_record: bool = False  # unheard peers and reports, too: zeros, but for the public roster's embodiment
    n_past: int = 0  # earlier reports of each robot that the actor has decided with
    plans: bool = False  # the planner's numbers


NOTHING_MORE = Wants()


class RobotGraphs(NamedTuple):
    """N due robots with E task edges and P peer edges; edges of row i are ptr[i]:ptr[i + 1]."""

    itself: np.ndarray  # [N, ROBOT.width] f4
    task_ptr: np.ndarray  # [N + 1] i8
    task: np.ndarray  # [E] i8 index of the task in the mission
    task_edge: np.ndarray  # [E, TASK_EDGE.width] f4
    task_legal: np.ndarray  # [E] bool
    own_edge: np.ndarray  # [N] i8 edge of the held task, -1: none
    peer_ptr: np.ndarray  # [N + 1] i8
    peer_edge: np.ndarray  # [P, PEER.width] f4
    peer: np.ndarray  # [P] i8 whose report it is
    peer_task: np.ndarray  # [P] i8 the task that it names, -1: none
    peer_past: np.ndarray  # [P, n_past, PAST.width] f4 the last reports, newest last
    resource: np.ndarray  # [N, H, RESOURCE.width] f4
    keep_idle: np.ndarray  # [N, 2] bool legal
    gate: np.ndarray  # [N] bool: a broadcast is open
    query: np.ndarray  # [N, H] bool legal
    assist: np.ndarray  # [N] bool legal
    mission: np.ndarray  # [N] i8
    robot: np.ndarray  # [N] i8
    plan: np.ndarray  # [N, PLAN.width] f4; no columns where nobody wants plans
    plan_edge: np.ndarray  # [E, PLAN_EDGE.width] f4; likewise


class OperatorGraphs(NamedTuple):
    """K due operators with R robots' reports each."""

    itself: np.ndarray  # [K, OPERATOR.width] f4
    report: np.ndarray  # [K, R, REPORT.width] f4
    known: np.ndarray  # [K, R] bool
    legal: np.ndarray  # [K, R] bool
    keep_rest: np.ndarray  # [K, 2] bool legal
    held: np.ndarray  # [K] i8 robot of the session, -1: none
    past: np.ndarray  # [K, R, n_past, PAST.width] f4 the last reports, newest last
    mission: np.ndarray  # [K] i8
    operator: np.ndarray  # [K] i8
    plan: np.ndarray  # [K] i8 the planner's choice: KEEP, REST or a robot; KEEP where nobody wants plans


class GraphBuilder:
    """Turns observations of one batch's scenario into local graphs; what its actors remember is kept here.

    Args:
      wants: a method's.
    """

    def __init__(self, batch: MissionBatch, wants: Wants = NOTHING_MORE):
        scenario, rules = batch.scenario, batch.scenario.robots
        self.wants, self.memory = wants, Memory(len(batch.seeds), scenario, wants.n_past)
        self.desk, self.plans = new_desk(scenario), new_memory(len(batch.seeds) if wants.plans else 0, scenario)
        self.rules = batch.rules
        self.scale = np.zeros(1, SCALE)
        fastest = max(*rules.autonomous_speed, *rules.controlled_speed)
        self.scale[0] = (
            scenario.map_side, scenario.time_limit, max(scenario.tasks.values), fastest, scenario.communication.bucket,
            scenario.communication.broadcast_bucket, scenario.operators.lease, max(1.0, scenario.operators.handover),
            scenario.tasks.decay[1],
        )  # fmt: skip

    def public(self, tasks: np.ndarray) -> np.ndarray:
        """[E, T, PUBLIC.width] f4 of tasks [E, T] of the state: what everybody knows of them from their release on."""
        scale, public = self.scale[0], PUBLIC.zeros(*tasks.shape)
        public["x"], public["y"] = tasks["x"] / scale["side"], tasks["y"] / scale["side"]
        public["difficulty"], public["value"] = tasks["difficulty"], tasks["value"] / scale["value"]
        public["deadline"], public["decay"] = tasks["deadline"] / scale["limit"], tasks["decay"] / scale["decay"]
        return columns_of(public)

    def robots(self, seen: Observations) -> RobotGraphs:
        """Graphs of the robots that are due."""
        n, tasks = seen.robot_tasks.shape
        peers, operators = seen.robot_peers.shape[1], seen.robot_operators.shape[1]
        graphs = RobotGraphs(
            ROBOT.zeros(n), np.zeros(n + 1, np.int64), np.empty(n * tasks, np.int64), TASK_EDGE.zeros(n * tasks),
            np.empty(n * tasks, bool), np.full(n, NOBODY), np.zeros(n + 1, np.int64), PEER.zeros(n * peers),
            np.empty(n * peers, np.int64), np.empty(n * peers, np.int64), self.memory.room(n * peers),
            RESOURCE.zeros(n, operators), np.empty((n, 2), bool), np.empty(n, bool), np.empty((n, operators), bool),
            np.empty(n, bool), np.empty(n, np.int64), np.empty(n, np.int64),
            np.zeros((n, 0), np.float32), np.zeros((n * tasks, 0), np.float32),
        )  # fmt: skip
        memory, every_record = self.memory.of_robots, self.wants.every_record
        edges, peers = fill_robots(self.rules[0], self.scale[0], seen, graphs, memory, every_record)
        plan, plan_edge = graphs.plan, graphs.plan_edge[:edges]
        if self.wants.plans:
            plans, plan_edges = PLAN.zeros(n), PLAN_EDGE.zeros(edges)
            fill_plans(self.rules[0], self.scale[0], self.desk, self.plans, seen, graphs.task_ptr, plans, plan_edges)
            plan, plan_edge = columns_of(plans), columns_of(plan_edges)
        return graphs._replace(
            itself=columns_of(graphs.itself), task=graphs.task[:edges], task_edge=columns_of(graphs.task_edge[:edges]),
            task_legal=graphs.task_legal[:edges], peer_edge=columns_of(graphs.peer_edge[:peers]), peer=graphs.peer[:peers],
            peer_task=graphs.peer_task[:peers], peer_past=columns_of(graphs.peer_past[:peers]),
            resource=columns_of(graphs.resource), plan=plan, plan_edge=plan_edge,
        )  # fmt: skip

    def remembered(self) -> list[np.ndarray]:
        """All that actors remember, in the same memory."""
        return [*self.memory.columns(), *self.plans]

    def talk(self, seen: Observations, decisions: Decisions, asks: bool) -> None:
        """Fill in what is said by rule on choices that are made: by the planner's where plans are read, else by the schedule."""
        if self.wants.plans:
            talk(WHOLE._replace(asks=asks), self.plans, seen, decisions)
        else:
            follow_schedule(seen, decisions, asks)

    def operators(self, seen: Observations) -> OperatorGraphs:
        """Graphs of the operators that are due."""
        k, r = seen.operator_reports.shape
        graphs = OperatorGraphs(
            OPERATOR.zeros(k), REPORT.zeros(k, r), np.empty((k, r), bool), np.empty((k, r), bool), np.empty((k, 2), bool),
            np.empty(k, np.int64), self.memory.room(k, r), np.empty(k, np.int64), np.empty(k, np.int64), np.full(k, KEEP),
        )  # fmt: skip
        if self.wants.plans:
            supervise(self.rules, WHOLE, seen, graphs.plan)
        fill_operators(self.rules[0], self.scale[0], seen, graphs, self.memory.of_operators, self.wants.every_record)
        return graphs._replace(itself=columns_of(graphs.itself), report=columns_of(graphs.report), past=columns_of(graphs.past))


@kernel
def age_features(age):
    """(known, two bounded transforms) of an age; all 0 where it is unknown."""
    if age < 0.0:
        return 0.0, 0.0, 0.0
    return 1.0, np.exp(-age / SHORT), np.exp(-age / LONG)


@kernel
def fill_robots(rules, scale, seen, graphs, memory, every_record):
    """Write the graphs of all due robots; returns (task edges, peer edges)."""
    edges, peers = 0, 0
    for i in range(seen.robots.shape[0]):
        robot = seen.robots[i]
        graphs.mission[i], graphs.robot[i] = robot.mission, robot.robot
        graphs.keep_idle[i, 0], graphs.keep_idle[i, 1] = robot.can_keep, robot.can_idle
        graphs.gate[i], graphs.assist[i] = robot.can_broadcast, robot.can_assist
        write_robot(scale, robot, graphs.itself[i])
        if robot.time == 0.0:
            forget(memory[robot.mission, robot.robot])
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
            if row.age >= 0.0 or every_record and other != robot.robot:
                write_peer(scale, robot, row, graphs.peer_edge[peers])
                graphs.peer[peers], graphs.peer_task[peers] = other, row.task if row.age >= 0.0 else NOBODY
                if row.age >= 0.0:
                    recall(memory[robot.mission, robot.robot, other], row, robot.time, scale, graphs.peer_past[peers])
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
    out.is_ugv, out.is_uav = robot.embodiment == UGV, robot.embodiment != UGV
    out.x, out.y = robot.x / scale.side, robot.y / scale.side
    out.travelling, out.servicing = robot.activity == TRAVELLING, robot.activity == SERVICING
    out.handover, out.controlled = robot.mode == HANDOVER, robot.mode == CONTROLLED
    out.speed = robot.speed / scale.speed
    out.has_task, out.progress = robot.task != NOBODY, robot.progress
    out.lease_left, out.handover_left = robot.lease_left / scale.lease, robot.handover_left / scale.handover
    out.stand_left = min(1.0, robot.stand_left / MINUTE)
    out.tokens, out.broadcast_tokens = robot.tokens / scale.bucket, robot.broadcast_tokens / scale.broadcast_bucket
    out.since_broadcast = min(1.0, robot.since_broadcast / MINUTE)
    out.since_request_known, out.since_request_short, out.since_request_long = age_features(robot.since_request)
    out.query_waits, out.request_waits = robot.query_waits, robot.request_waits
    out.prescribed, out.can_keep = robot.prescribed, robot.can_keep
    out.can_broadcast, out.can_assist = robot.can_broadcast, robot.can_assist
    out.time, out.time_left = robot.time / scale.limit, np.exp(-(scale.limit - robot.time) / LONG)


@kernel
def write_task_edge(rules, scale, robot, j, row, out):
    """What a robot knows of a task, and the way there."""
    gain, seconds = attempt(rules, row.distance, robot.speed, row.difficulty, row.deadline, row.decay, robot.time)
    arrival = robot.time + row.distance / robot.speed
    out.distance = row.distance / scale.side
    out.dx, out.dy = (row.x - robot.x) / scale.side, (row.y - robot.y) / scale.side
    out.seconds = seconds / LONG
    out.expected_value = row.value * gain / scale.value
    out.value_rate = 60.0 * row.value * gain / scale.value / seconds
    slack = row.deadline - arrival
    out.slack, out.is_late = np.tanh(slack / LONG), slack < 0.0
    out.time_after = max(-1.0, (scale.limit - robot.time - seconds) / scale.limit)
    out.uav_only, out.ugv_only, out.general = row.type == 0, row.type == 1, row.type == 2
    out.serviced, out.progress = row.status == SERVICED, row.progress
    out.age_known, out.age_short, out.age_long = age_features(row.age)
    out.refused, out.is_held = row.refused, j == robot.task
    if row.claimed_by != NOBODY:
        out.claim_known, out.claim_short, out.claim_long = age_features(row.claim_age)


@kernel
def write_peer(scale, robot, row, out):
    """A cached report of a peer."""
    out.is_ugv, out.is_uav = row.embodiment == UGV, row.embodiment != UGV
    if row.age < 0.0:
        return
    dx, dy = (row.x - robot.x) / scale.side, (row.y - robot.y) / scale.side
    out.dx, out.dy, out.distance = dx, dy, distance(dx, dy)
    out.idle, out.travelling, out.servicing = row.activity == 0, row.activity == TRAVELLING, row.activity == SERVICING
    out.handover, out.controlled = row.mode == HANDOVER, row.mode == CONTROLLED
    out.has_task, out.same_task = row.task != NOBODY, row.task != NOBODY and row.task == robot.task
    out.has_controller = row.controller != NOBODY
    out.age_known, out.age_short, out.age_long = age_features(row.age)


@kernel
def write_resource(scale, robot, h, row, out):
    """An operator's last resource report."""
    out.age_known, out.age_short, out.age_long = age_features(row.age)
    if row.age >= 0.0:
        out.tokens, out.queue = row.tokens / scale.bucket, np.tanh(row.queue / 4.0)
        out.bidding, out.holding = row.session == BID, row.session == HELD
        out.has_me = row.robot == robot.robot
        out.fatigue_class = row.fatigue_class / 2.0
    out.controls_me = robot.controller == h


@kernel
def fill_operators(rules, scale, seen, graphs, memory, every_record):
    """Write the graphs of all due operators."""
    for i in range(seen.operators.shape[0]):
        operator = seen.operators[i]
        graphs.mission[i], graphs.operator[i], graphs.held[i] = operator.mission, operator.operator, operator.robot
        graphs.keep_rest[i, 0], graphs.keep_rest[i, 1] = operator.can_keep, True
        write_operator(scale, operator, graphs.itself[i])
        if operator.time == 0.0:
            forget(memory[operator.mission, operator.operator])
        for r in range(seen.operator_reports.shape[1]):
            row = seen.operator_reports[i, r]
            graphs.known[i, r], graphs.legal[i, r] = row.age >= 0.0, row.legal
            if row.age >= 0.0:
                write_report(rules, scale, operator, r, row, graphs.report[i, r])
                recall(memory[operator.mission, operator.operator, r], row, operator.time, scale, graphs.past[i, r])
            elif every_record:
                graphs.report[i, r].is_ugv, graphs.report[i, r].is_uav = row.embodiment == UGV, row.embodiment != UGV


@kernel
def write_operator(scale, operator, out):
    """An operator's own state and session."""
    out.uav_proficiency, out.ugv_proficiency = operator.proficiency[0], operator.proficiency[1]
    out.capacity, out.fatigue = operator.capacity, operator.fatigue
    out.bidding, out.holding = operator.session == BID, operator.session == HELD
    out.lease_left = max(-1.0, operator.lease_left / scale.lease)
    out.since_bid_known, out.since_bid_short, out.since_bid_long = age_features(operator.since_bid)
    out.tokens, out.queue = operator.tokens / scale.bucket, np.tanh(operator.queue / 4.0)
    out.exempt = operator.exempt
    out.time, out.time_left = operator.time / scale.limit, np.exp(-(scale.limit - operator.time) / LONG)


@kernel
def write_report(rules, scale, operator, r, row, out):
    """The station's report of a robot."""
    out.is_ugv, out.is_uav = row.embodiment == UGV, row.embodiment != UGV
    out.idle, out.travelling, out.servicing = row.activity == 0, row.activity == TRAVELLING, row.activity == SERVICING
    out.handover, out.controlled = row.mode == HANDOVER, row.mode == CONTROLLED
    out.by_another = row.controller != NOBODY and row.controller != operator.operator
    out.by_me = row.controller == operator.operator
    out.x, out.y = row.x / scale.side, row.y / scale.side
    out.age_known, out.age_short, out.age_long = age_features(row.age)
    out.request_known, out.request_short, out.request_long = age_features(row.request_age)
    out.is_held = r == operator.robot
    if row.task != NOBODY:
        write_reported_task(rules, scale, operator, row, out)


@kernel
def write_reported_task(rules, scale, operator, row, out):
    """The task that a report names, what the station knows of it, and what control would gain."""
    out.has_task, out.progress, out.difficulty = True, row.progress, row.difficulty
    out.value = row.value / scale.value
    out.slack = np.tanh((row.deadline - operator.time) / LONG)
    out.distance = row.distance / scale.side
    gain = control_gain(
        rules, operator.proficiency[row.embodiment], operator.fatigue, row.embodiment, row.distance, row.progress,
        row.difficulty, row.value, row.deadline, row.decay, operator.time,
    )  # fmt: skip
    out.gain = np.tanh(60.0 * gain)
    out.uav_only, out.ugv_only, out.general = row.task_type == 0, row.task_type == 1, row.task_type == 2
    out.compatible = row.compatible
    out.task_serviced, out.task_done, out.task_progress = row.task_status == SERVICED, row.task_status == DONE, row.task_progress
    out.task_known, out.task_short, out.task_long = age_features(row.task_age)
