"""Operators: bids, handover, leases and fatigue (docs/benchmark.md, section 5)."""

from ..base.kernels import kernel
from ..base.terms import NOBODY, Activity, Kind, Mode, Session
from .accessors import downlink_of, operator_of, robot_of, task_of, uplink_of
from .records import stop_ageing
from .state import NEVER
from .transport import displace, enqueue

AUTONOMOUS, HANDOVER, CONTROLLED = int(Mode.AUTONOMOUS), int(Mode.HANDOVER), int(Mode.CONTROLLED)
RESTING, BID, HELD = int(Session.REST), int(Session.BID), int(Session.HELD)
SERVICING, FAILED = int(Activity.SERVICING), int(Activity.FAILED)
CONTROL, RENEWAL = int(Kind.CONTROL), int(Kind.RENEWAL)


@kernel
def bid(m, h, r, now):
    """Operator h commands robot r; what it held before is given up, at a cost unless exempt."""
    operator = operator_of(m, h)
    if operator.session == HELD:
        if not operator.exempt:
            m.switches += 1
            m.tick_reward[1] -= m.rules.switch_cost
        end_session(m, h)
    operator.session = BID
    operator.robot = r
    operator.bid_at = now
    operator.exempt = 0
    enqueue(m, downlink_of(m, h, 0), CONTROL, m.n_robots + h, r, now)


@kernel
def renew(m, h, now):
    """KEEP: queue a renewal of the held lease when the last one is old enough."""
    operator = operator_of(m, h)
    if operator.session == HELD and now - operator.renewed_at >= m.rules.renewal_period:
        if downlink_of(m, h, 0).since < 0.0:
            operator.renewed_at = now
            enqueue(m, downlink_of(m, h, 0), RENEWAL, m.n_robots + h, operator.robot, now)


@kernel
def end_session(m, h):
    """The operator lets go: its robot, if it held one, is autonomous from now on."""
    operator = operator_of(m, h)
    if operator.session == HELD:
        robot = robot_of(m, operator.robot)
        robot.controller = NOBODY
        robot.mode = AUTONOMOUS
        robot.due = 1
    operator.session = RESTING
    operator.robot = NOBODY
    operator.due = 1


@kernel
def withdraw(m, h, now):
    """End the session and take back a command that still waits."""
    displace(m, downlink_of(m, h, 0), now)
    end_session(m, h)


@kernel
def receive_command(m, h, r, kind, now):
    """A control command or a renewal reaches robot r."""
    robot, operator, rules = robot_of(m, r), operator_of(m, h), m.rules
    if robot.activity == FAILED:
        return
    if robot.controller == h:
        robot.lease_until = now + rules.lease
        return
    if kind != CONTROL or operator.session != BID or operator.robot != r:  # withdrawn meanwhile
        return
    if robot.controller != NOBODY:
        m.conflicts += 1
        m.tick_reward[1] -= rules.conflict_cost
    else:
        robot.controller = h
        robot.mode = HANDOVER
        robot.handover_until = now + rules.handover
        robot.lease_until = now + rules.lease
        robot.due = 1
        operator.session = HELD
        operator.renewed_at = now
        operator.due = 1


@kernel
def advance_sessions(m, now):
    """Handovers end, leases and bids run out."""
    for r in range(m.n_robots):
        robot = robot_of(m, r)
        if robot.mode == HANDOVER and now >= robot.handover_until:
            robot.mode = CONTROLLED
        if robot.controller != NOBODY and now >= robot.lease_until:
            end_session(m, robot.controller)
    for h in range(m.n_operators):
        operator = operator_of(m, h)
        if operator.session == BID and now - operator.bid_at >= m.rules.bid_timeout:
            withdraw(m, h, now)


@kernel
def tire(m, h):
    """One second of work or rest: df/dt = k_a w(D)/c (1 - f), or -k_r c f."""
    operator, rules = operator_of(m, h), m.rules
    if operator.session != HELD:
        operator.fatigue *= max(0.0, 1.0 - rules.recovery_rate * operator.capacity)
        return
    robot = robot_of(m, operator.robot)
    workload = rules.travel_workload
    if robot.activity == SERVICING:
        workload = rules.service_workload[0] + rules.service_workload[1] * task_of(m, robot.task).difficulty
    operator.fatigue += min(1.0, rules.fatigue_rate * workload / operator.capacity) * (1.0 - operator.fatigue)
    operator.control_time += 1.0


@kernel
def break_robot(m, r, now):
    """A malfunction removes robot r for the rest of the mission; whoever controls it notices."""
    robot = robot_of(m, r)
    if robot.controller != NOBODY:
        end_session(m, robot.controller)
    for place in range(m.n_uplink_places):
        displace(m, uplink_of(m, r, place), now)
    stop_ageing(m, r)
    robot.activity = FAILED
    robot.failed_at = now
    robot.due = 0
    robot.prescribed = 0
    robot.next_telemetry = NEVER
