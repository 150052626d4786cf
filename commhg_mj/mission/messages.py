"""What messages carry: broadcasts, telemetry, and replies to queries (docs/benchmark.md, section 6)."""

from ..base.elementary_functions import distance
from ..base.kernels import kernel
from ..base.terms import NOBODY, Activity
from .accessors import command_of, copy_record, downlink_of, known_robot, known_task, tip_of, true_operator, true_robot, true_task
from .records import DONE, OPEN
from .state import NEVER

SERVICING = int(Activity.SERVICING)
FRESH = 60.0  # s: an older report does not say any more where its robot goes
AGAIN = 20.0  # s: a claim that a robot has been told of is news again by so much newer a report
# Fatigue is reported in three classes: fresh, tiring, tired.
TIRING, TIRED = 0.3, 0.6


@kernel
def write_broadcast(m, message, r, now):
    """Robot r's own state, and its freshest task records."""
    write_peer(m, message.robot, r, now)
    freshest(m, r, False, m.rules.broadcast_records, message)


@kernel
def write_telemetry(m, message, r, now):
    """Robot r's own state, and the freshest task records that it has sensed itself."""
    write_peer(m, message.robot, r, now)
    freshest(m, r, True, m.rules.telemetry_records, message)


@kernel
def copy_payload(source, target):
    """The same content for another receiver of one broadcast."""
    copy_record(target.robot, source.robot)
    target.records = source.records
    for k in range(source.records):
        target.task[k] = source.task[k]
        target.belief[k] = source.belief[k]


@kernel
def write_peer(m, record, r, time):
    """Fill a record with robot r's true state, as it reports it itself."""
    robot = true_robot(m, r)
    record.time = time
    record.x = robot.x
    record.y = robot.y
    record.activity = robot.activity
    record.mode = robot.mode
    record.controller = robot.controller
    record.task = robot.task
    # On its way a robot knows nothing of its task's progress.
    record.progress = true_task(m, robot.task).progress if robot.activity == SERVICING else 0.0
    record.request_time = NEVER
    record.command_from, record.command_sent = NOBODY, NEVER
    for h in range(m.n_operators):
        if command_of(m, r, h).sent > record.command_sent:
            record.command_from, record.command_sent = h, command_of(m, r, h).sent


@kernel
def freshness(belief, task, own_task):
    """Evidence time; the sender's own task goes before others of the same second."""
    return belief.time + (0.5 if task == own_task else 0.0)


@kernel
def freshest(m, r, only_sensed, limit, message):
    """Copy robot r's `limit` freshest task records into a message, newest first."""
    own, count = true_robot(m, r).task, 0
    for j in range(m.n_tasks):
        belief = known_task(m, r, j)
        if belief.time < 0.0 or (only_sensed and not belief.sensed) or limit == 0:
            continue
        rank = freshness(belief, j, own)
        if count == limit and rank <= freshness(message.belief[count - 1], message.task[count - 1], own):
            continue
        k = count if count < limit else limit - 1
        while k > 0 and freshness(message.belief[k - 1], message.task[k - 1], own) < rank:
            message.belief[k] = message.belief[k - 1]
            message.task[k] = message.task[k - 1]
            k -= 1
        message.belief[k] = belief
        message.task[k] = j
        count = min(count + 1, limit)
    message.records = count


@kernel
def count_waiting(m, h):
    """How many messages wait for operator h's tokens."""
    waiting = 0
    for place in range(m.n_downlink_places):
        waiting += downlink_of(m, h, place).since >= 0.0
    return waiting


@kernel
def write_reply(m, message, h, r, tip, now):
    """Operator h's resources, and for robot r the station's record of task `tip`, if any, with the claim on it."""
    write_resource(m, message.resource, h, now)
    if tip != NOBODY:
        message.records = 1
        message.task[0] = tip
        message.belief[0] = known_task(m, m.n_robots, tip)
        message.belief[0].claimed_by, message.belief[0].claim_time = newest_claim(m, r, tip, now)


@kernel
def write_resource(m, report, h, now):
    """Fill in operator h's resource report."""
    operator = true_operator(m, h)
    report.time = now
    report.tokens = operator.tokens
    report.robot = operator.robot
    report.session = operator.session
    report.fatigue_class = 0 if operator.fatigue < TIRING else (1 if operator.fatigue < TIRED else 2)
    report.queue = count_waiting(m, h)


@kernel
def choose_tip(m, r, about, now):
    """The task that a reply tells robot r of, or NOBODY: of those with news the one that its query named, else the nearest to it.

    A query that named no task is answered with the news that is nearest to where the robot was.
    """
    report = known_robot(m, m.n_robots, r)
    x, y = m.station_x, m.station_y  # where all robots start
    if about != NOBODY:
        x, y = true_task(m, about).x, true_task(m, about).y
    elif report.time >= 0.0:
        x, y = report.x, report.y
    tip, nearest = NOBODY, 1e300
    for j in range(m.n_tasks):
        if is_news(m, r, j, now):
            way = -1.0 if j == about else distance(true_task(m, j).x - x, true_task(m, j).y - y)
            if way < nearest:
                tip, nearest = j, way
    return tip


@kernel
def is_news(m, r, j, now):
    """Whether the station knows of task j what robot r was not sent: it is done, of a changed type, serviced, or another's."""
    station = m.n_robots
    belief, told, report = known_task(m, station, j), tip_of(m, r, j), known_robot(m, station, r)
    is_done = belief.status == DONE
    is_elses = belief.status != OPEN and report.task != j
    if belief.time > told.time and (is_done or belief.type != true_task(m, j).announced or is_elses):
        return True
    other, claimed_at = newest_claim(m, r, j, now)
    if is_done or other == NOBODY:
        return False
    return told.claim_time < 0.0 or claimed_at > told.claim_time + AGAIN


@kernel
def newest_claim(m, r, j, now):
    """(robot, when) of the freshest report that shows another robot than r on task j; (NOBODY, NEVER) if there is none."""
    who, newest = NOBODY, NEVER
    for k in range(m.n_robots):
        report = known_robot(m, m.n_robots, k)
        if k != r and report.task == j and report.time > max(newest, now - FRESH):
            who, newest = k, float(report.time)
    return who, newest


@kernel
def note_tip(m, r, j):
    """Robot r counts as told of task j, even if the reply is lost."""
    told = tip_of(m, r, j)
    told.time = max(told.time, known_task(m, m.n_robots, j).time)
    other, claimed_at = newest_claim(m, r, j, m.now)
    if other != NOBODY:
        told.claim_time = claimed_at
