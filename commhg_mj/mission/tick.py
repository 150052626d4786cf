"""The tick: one second of one mission, rule by rule."""

import numpy as np

from ..base.kernels import kernel
from ..base.terms import Activity, Kind, Mode, Status
from ..radio.links import KNOWN, is_ideal
from .accessors import (
    copy_record,
    downlink_of,
    flying_of,
    known_operator,
    known_robot,
    known_task,
    message_at,
    tip_of,
    true_operator,
    true_robot,
    true_task,
)
from .control import advance_sessions, break_robot, is_renewal_due, learn_control, receive_command, tire
from .messages import write_peer, write_resource
from .randomness import Event, uniform
from .recorder import log_tick
from .records import age_records, is_compatible, learn_claim, learn_peer, learn_task, sense
from .service import drop_task, finish_task, serve, travel
from .state import NEVER, PEER
from .transport import close, enqueue, land, queue_telemetry, send_last_report, serve_downlink, serve_uplink

FAILED, TRAVELLING, SERVICING = int(Activity.FAILED), int(Activity.TRAVELLING), int(Activity.SERVICING)
CONTROLLED, OPEN, DONE = int(Mode.CONTROLLED), int(Status.OPEN), int(Status.DONE)
BROADCAST, TELEMETRY, QUERY, REQUEST = int(Kind.BROADCAST), int(Kind.TELEMETRY), int(Kind.QUERY), int(Kind.REQUEST)
REPLY = int(Kind.REPLY)
MALFUNCTION = int(Event.MALFUNCTION)


@kernel
def tick(m):
    """Advance the mission by one second."""
    now = m.now
    malfunctions(m, now)
    work(m, now)
    for h in range(m.n_operators):
        tire(m, h)
    now += 1
    m.now = now
    release_and_change(m, now)
    advance_sessions(m, now)
    deliver(m, now)
    look_around(m, now)
    communicate(m, now)
    if m.rules.radio.link_model == KNOWN:
        reveal(m, now)
    age_records(m, now)
    mark_due(m, now)
    pay(m)
    log_tick(m)
    m.tick_reward[0] = 0.0
    m.tick_reward[1] = 0.0
    if is_over(m, now):
        m.over = 1
        close(m, now)


@kernel
def malfunctions(m, now):
    """Each robot may fail for good; under control the hazard is lower."""
    rules = m.rules
    for r in range(m.n_robots):
        robot = true_robot(m, r)
        if robot.activity == FAILED:
            continue
        hazard = rules.controlled_hazard if robot.mode == CONTROLLED else rules.hazard
        if uniform(m.seed, MALFUNCTION, now, r, 0) < hazard:
            drop_task(m, r)
            break_robot(m, r, now + 1)


@kernel
def work(m, now):
    """Robots travel and service."""
    for r in range(m.n_robots):
        activity = true_robot(m, r).activity
        if activity == TRAVELLING:
            travel(m, r)
        elif activity == SERVICING:
            serve(m, r, now)


@kernel
def release_and_change(m, now):
    """Tasks are announced; unserviced general tasks turn robot-exclusive without notice."""
    for j in range(m.n_tasks):
        task = true_task(m, j)
        if not task.released and now >= task.release:
            task.released = 1
            m.pending_value += task.value
        if task.change_at >= 0.0 and now >= task.change_at:
            if task.progress == 0.0 and task.status == OPEN:
                task.type = task.changes_to
                task.changed_at = now
            task.change_at = NEVER


@kernel
def deliver(m, now):
    """Messages that are due reach their receivers."""
    n_robots = m.n_robots
    for k in range(m.flying - 1, -1, -1):
        message = message_at(m, flying_of(m, k).slot)
        if message.due > now:
            continue
        is_heard = message.receiver >= n_robots or true_robot(m, message.receiver).activity != FAILED
        if is_heard:
            receive(m, message, now)
        land(m, k, is_heard, now)


@kernel
def receive(m, message, now):
    """What a delivered message does to its receiver."""
    kind, sender, receiver = message.kind, message.sender, message.receiver
    station = m.n_robots  # row of the station's tables, and address of operator 0
    if kind == BROADCAST:
        learn_peer(m, receiver, sender, message.robot)
        learn_records(m, receiver, message)
    elif kind == TELEMETRY:
        hear_report(m, sender, message.robot)
        learn_records(m, station, message)
        for k in range(message.records):  # no tip tells a robot its own news
            tip = tip_of(m, sender, message.task[k])
            tip.time = max(tip.time, message.belief[k].time)
    elif kind == QUERY:
        waiting = downlink_of(m, receiver - station, 1 + sender)
        if waiting.since < 0.0:
            enqueue(m, waiting, REPLY, receiver, sender, now)
            waiting.about = message.about
    elif kind == REQUEST:
        report = known_robot(m, station, sender)
        report.request_time = max(report.request_time, message.robot.request_time)
    elif kind == REPLY:
        held = known_operator(m, receiver, sender - station)
        if message.resource.time > held.time:
            copy_record(held, message.resource)
        learn_records(m, receiver, message)
        if message.records > 0:
            learn_claim(m, receiver, message.task[0], message.belief[0])
        true_robot(m, receiver).due = 1
    else:
        receive_command(m, sender - station, receiver, kind, message.sent, now)


@kernel
def hear_report(m, r, report):
    """The station hears of robot r from itself; news makes its operator due."""
    learn_control(m, r, report)
    if learn_peer(m, m.n_robots, r, report):
        for h in range(m.n_operators):
            if true_operator(m, h).robot == r:
                true_operator(m, h).due = 1


@kernel
def learn_records(m, receiver, message):
    """Merge the task records that a message carries; their evidence times stay as they are."""
    for k in range(message.records):
        b = message.belief[k]
        learn_task(m, receiver, message.task[k], int(b.type), int(b.status), float(b.progress), float(b.time), 0)


@kernel
def look_around(m, now):
    """Every robot senses the tasks around it; it turns away from a task that it finds incompatible."""
    for r in range(m.n_robots):
        robot = true_robot(m, r)
        if robot.activity == FAILED:
            continue
        sense(m, r, now)
        if robot.activity == TRAVELLING and known_task(m, r, robot.task).time == now:
            if not is_compatible(robot.embodiment, known_task(m, r, robot.task).type):
                finish_task(m, r)


@kernel
def communicate(m, now):
    """Telemetry falls due, and queues send what their tokens permit."""
    if is_ideal(m.rules.radio):
        for r in range(m.n_robots):
            if true_robot(m, r).activity != FAILED:
                true_robot(m, r).tokens = m.rules.bucket
                true_robot(m, r).broadcast_tokens = m.rules.broadcast_bucket
        for h in range(m.n_operators):
            true_operator(m, h).tokens = m.rules.bucket
    for r in range(m.n_robots):
        robot = true_robot(m, r)
        if robot.activity != FAILED:
            queue_telemetry(m, r, now)
            serve_uplink(m, r, now)
        elif robot.failed_at == now:
            send_last_report(m, r, now)
    for h in range(m.n_operators):
        serve_downlink(m, h, now)


@kernel
def reveal(m, now):
    """Link model "known": all records become true."""
    n_robots, report = m.n_robots, np.zeros(1, PEER)[0]
    for r in range(n_robots):
        write_peer(m, report, r, now)
        hear_report(m, r, report)
        for other in range(n_robots):
            if other != r:
                learn_peer(m, other, r, report)
        for h in range(m.n_operators):
            write_resource(m, known_operator(m, r, h), h, now)
    for j in range(m.n_tasks):
        task = true_task(m, j)
        if task.released:
            for receiver in range(n_robots + 1):
                learn_task(m, receiver, j, task.type, task.status, task.progress, float(now), 0)


@kernel
def mark_due(m, now):
    """Everybody decides at least once a period; the prescribed first targets run out."""
    rules = m.rules
    for r in range(m.n_robots):
        robot = true_robot(m, r)
        if robot.activity == FAILED:
            continue
        if robot.prescribed and now >= rules.initial_phase_end:
            robot.prescribed = 0
            robot.due = 1
        stands_no_more = robot.stands_until <= now < robot.stands_until + 1.0
        if now >= robot.next_decision or stands_no_more:
            robot.due = 1
    for h in range(m.n_operators):
        if now >= true_operator(m, h).next_decision or is_renewal_due(m, h, now):
            true_operator(m, h).due = 1


@kernel
def pay(m):
    """The team reward of this second (paper, eq. 4): mission part and coordination part."""
    m.tick_reward[0] -= m.rules.pending_cost * m.pending_value / m.total_value
    m.reward[0] += m.tick_reward[0]
    m.reward[1] += m.tick_reward[1]


@kernel
def is_over(m, now):
    """At the time limit, or when nothing can be completed any more."""
    if now >= m.rules.time_limit:
        return True
    alive = False
    for r in range(m.n_robots):
        alive = alive or true_robot(m, r).activity != FAILED
    pending = False
    for j in range(m.n_tasks):
        pending = pending or true_task(m, j).status != DONE
    return not (alive and pending)


@kernel
def is_anybody_due(m):
    """Whether some actor has to decide now."""
    for r in range(m.n_robots):
        if true_robot(m, r).due:
            return True
    for h in range(m.n_operators):
        if true_operator(m, h).due:
            return True
    return False


@kernel
def advance(m, seconds, discount, earned):
    """Tick for so many `seconds`, whoever is due meanwhile, or with 0 until somebody is due; at most to the end.

    Args:
      earned: [2] is filled with both parts of the reward, each second's discounted by the seconds before it.
    """
    until, fade = m.now + seconds, 1.0
    earned[0], earned[1] = 0.0, 0.0
    while not m.over and (m.now < until or (seconds == 0 and not is_anybody_due(m))):
        mission, coordination = m.reward[0], m.reward[1]
        tick(m)
        earned[0] += fade * (m.reward[0] - mission)
        earned[1] += fade * (m.reward[1] - coordination)
        fade *= discount
