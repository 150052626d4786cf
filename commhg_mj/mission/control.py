"""Operators: bids, handover, leases and fatigue (docs/benchmark.md, section 5).

Robot and operator keep a record each and meet in messages alone. A lease counts from the second in which its command or
renewal was sent, so the operator's clock never runs out before the robot's, and another robot is commanded only when no
lease can be in force any more: one robot a human holds in every second, whatever is lost or late.
"""

from ..base.kernels import kernel
from ..base.terms import NOBODY, Activity, Kind, Mode, Session
from .accessors import command_of, downlink_of, known_robot, true_operator, true_robot, true_task, uplink_of
from .records import stop_ageing
from .state import NEVER
from .transport import displace, enqueue

AUTONOMOUS, HANDOVER, CONTROLLED = int(Mode.AUTONOMOUS), int(Mode.HANDOVER), int(Mode.CONTROLLED)
RESTING, BID, HELD = int(Session.REST), int(Session.BID), int(Session.HELD)
SERVICING, FAILED = int(Activity.SERVICING), int(Activity.FAILED)
CONTROL, RENEWAL, RELEASE = int(Kind.CONTROL), int(Kind.RENEWAL), int(Kind.RELEASE)

# The operator's end.


@kernel
def bid(m, h, r, now):
    """Operator h wants robot r; what it held before is given up, at a cost unless exempt."""
    operator = true_operator(m, h)
    leave(m, h, now)
    if operator.left != NOBODY and operator.left != r and now - operator.left_at <= m.rules.switch_window:
        m.switches += 1
        m.tick_reward[1] -= m.rules.switch_cost
    operator.left = NOBODY
    operator.session = BID
    operator.robot = r
    operator.bid_at = now
    operator.queued_at = NEVER
    command(m, h, now)


@kernel
def command(m, h, now):
    """Queue the command of a bid, once no lease of another robot can be in force."""
    operator = true_operator(m, h)
    if operator.session == BID and operator.queued_at == NEVER:
        if operator.leased == operator.robot or not is_lease_open(m, h, now):
            operator.queued_at = now
            enqueue(m, downlink_of(m, h, 0), CONTROL, m.n_robots + h, operator.robot, now)


@kernel
def is_lease_open(m, h, now):
    """Whether a lease that operator h sent may still be in force, as far as it knows."""
    operator = true_operator(m, h)
    return operator.leased != NOBODY and now < operator.lease_sent + m.rules.lease


@kernel
def renew(m, h, now):
    """KEEP: queue a renewal of the held lease when the last one is old enough."""
    operator = true_operator(m, h)
    if operator.session == HELD and now - operator.lease_sent >= m.rules.renewal_period:
        if downlink_of(m, h, 0).since < 0.0:
            enqueue(m, downlink_of(m, h, 0), RENEWAL, m.n_robots + h, operator.robot, now)


@kernel
def is_renewal_due(m, h, now):
    """Whether this is the second from which on operator h may renew its lease: its next regular decision may be too late."""
    operator, period = true_operator(m, h), m.rules.renewal_period
    return operator.session == HELD and period <= now - operator.lease_sent < period + 1.0


@kernel
def leave(m, h, now):
    """Operator h lets go: a command that still waits is taken back, a lease that may be in force released."""
    operator, waiting = true_operator(m, h), downlink_of(m, h, 0)
    if operator.session == HELD and not operator.exempt:
        operator.left, operator.left_at = operator.robot, now
    if waiting.since >= 0.0 and waiting.kind != RELEASE:
        displace(m, waiting, now)
    is_released = operator.ordered_at > operator.lease_sent or waiting.since >= 0.0
    if is_lease_open(m, h, now) and not is_released:
        enqueue(m, waiting, RELEASE, m.n_robots + h, operator.leased, now)
    end_session(m, h)


@kernel
def end_session(m, h):
    """Operator h rests, and may choose anew."""
    operator = true_operator(m, h)
    operator.session = RESTING
    operator.robot = NOBODY
    operator.exempt = 0
    operator.due = 1


@kernel
def learn_control(m, r, report):
    """What a report of robot r, newer than the one that is held, tells operators of their leases and sessions."""
    held = known_robot(m, m.n_robots, r)
    if report.time <= held.time:
        return
    for h in range(m.n_operators):
        operator = true_operator(m, h)
        # The robot heard the last command of this operator, or fails: none in the air takes effect any more.
        is_answered = report.activity == FAILED or (report.command_from == h and report.command_sent >= operator.ordered_at)
        if operator.leased == r and report.controller != h and is_answered:
            operator.leased = NOBODY
            command(m, h, m.now)
        if operator.robot == r and operator.session == HELD:
            learn_session(m, h, held, report)
        elif operator.robot == r and operator.session == BID:
            learn_answer(m, h, report, is_answered)


@kernel
def learn_session(m, h, held, report):
    """The robot that operator h holds obeys somebody else or nobody: the session is over. Or it has left its task."""
    operator = true_operator(m, h)
    if report.controller != h and report.time > operator.accepted_at:
        operator.leased = NOBODY  # the command was accepted once, and renewals begin no session
        end_session(m, h)
    elif held.task != NOBODY and report.task != held.task:
        operator.exempt = 1


@kernel
def learn_answer(m, h, report, is_answered):
    """Operator h's command is accepted, another holds the robot, or there is no answer yet."""
    operator = true_operator(m, h)
    is_sent = operator.queued_at != NEVER and operator.lease_sent >= operator.queued_at
    if report.activity == FAILED:
        leave(m, h, m.now)
    elif not is_sent or report.time <= operator.ordered_at:
        return
    elif report.controller == h:
        operator.session = HELD
        operator.accepted_at = report.time
        operator.due = 1
    elif is_answered or report.controller != NOBODY:
        leave(m, h, m.now)


# The robot's end.


@kernel
def receive_command(m, h, r, kind, sent, now):
    """A command, a renewal or a release of operator h reaches robot r; one that is older than another it heard is void."""
    robot, heard, rules = true_robot(m, r), command_of(m, r, h), m.rules
    if robot.activity == FAILED or sent <= heard.sent:
        return
    heard.sent = sent
    if kind == RELEASE:
        if robot.controller == h:
            let_go(m, r, now)
    elif robot.controller == h:
        robot.lease_until = sent + rules.lease
    elif kind == CONTROL and now < sent + rules.lease:
        if robot.controller != NOBODY:
            m.conflicts += 1
            m.tick_reward[1] -= rules.conflict_cost
        else:
            robot.controller = h
            robot.mode = HANDOVER
            robot.handover_until = now + rules.handover
            robot.lease_until = sent + rules.lease
            robot.due = 1
            robot.next_telemetry = now


@kernel
def let_go(m, r, now):
    """Robot r is autonomous again, and says so."""
    robot = true_robot(m, r)
    robot.controller = NOBODY
    robot.mode = AUTONOMOUS
    robot.due = 1
    robot.next_telemetry = now


@kernel
def break_robot(m, r, now):
    """A malfunction removes robot r for the rest of the mission."""
    robot = true_robot(m, r)
    robot.controller = NOBODY
    robot.mode = AUTONOMOUS
    for place in range(m.n_uplink_places):
        displace(m, uplink_of(m, r, place), now)
    stop_ageing(m, r)
    robot.activity = FAILED
    robot.failed_at = now
    robot.due = 0
    robot.prescribed = 0


# Both.


@kernel
def advance_sessions(m, now):
    """Handovers end; leases run out by the clocks of both ends; bids wait for their turn or are given up."""
    for r in range(m.n_robots):
        robot = true_robot(m, r)
        if robot.mode == HANDOVER and now >= robot.handover_until:
            robot.mode = CONTROLLED
        if robot.controller != NOBODY and now >= robot.lease_until:
            let_go(m, r, now)
    for h in range(m.n_operators):
        operator = true_operator(m, h)
        if operator.session == HELD and not is_lease_open(m, h, now):
            end_session(m, h)
        command(m, h, now)
        if operator.session == BID and operator.queued_at != NEVER and now - operator.queued_at >= m.rules.bid_timeout:
            leave(m, h, now)


@kernel
def tire(m, h):
    """One second of work or rest as operator h knows it: df/dt = k_a w(D)/c (1 - f), or -k_r c f."""
    operator, rules = true_operator(m, h), m.rules
    if operator.session != HELD:
        operator.fatigue *= max(0.0, 1.0 - rules.recovery_rate * operator.capacity)
        return
    report = known_robot(m, m.n_robots, operator.robot)
    workload = rules.travel_workload
    if report.activity == SERVICING:
        workload = rules.service_workload[0] + rules.service_workload[1] * true_task(m, int(report.task)).difficulty
    operator.fatigue += min(1.0, rules.fatigue_rate * workload / operator.capacity) * (1.0 - operator.fatigue)
    operator.control_time += 1.0
