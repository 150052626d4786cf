"""The tick: one second of one mission, rule by rule."""

from ..kernels import kernel
from ..radio.links import PERFECT
from ..terms import NOBODY, Activity, Kind, Mode, Status
from .control import advance_sessions, break_robot, receive_command, tire
from .log import log_tick
from .randomness import Event, uniform
from .records import age_records, learn_peer, learn_task, sense
from .service import drop_task, serve, travel
from .state import NEVER
from .transport import close, enqueue, land, queue_telemetry, serve_downlink, serve_uplink

FAILED, TRAVELLING, SERVICING = int(Activity.FAILED), int(Activity.TRAVELLING), int(Activity.SERVICING)
AUTONOMOUS, DONE = int(Mode.AUTONOMOUS), int(Status.DONE)
BROADCAST, TELEMETRY, QUERY, REQUEST = int(Kind.BROADCAST), int(Kind.TELEMETRY), int(Kind.QUERY), int(Kind.REQUEST)
CONTROL, RENEWAL, REPLY = int(Kind.CONTROL), int(Kind.RENEWAL), int(Kind.REPLY)
MALFUNCTION = int(Event.MALFUNCTION)


@kernel
def tick(m):
    """Advance the mission by one second."""
    info = m.info[0]
    now = info.now
    malfunctions(m, now)
    work(m, now)
    for h in range(m.operators.shape[0]):
        tire(m, h)
    now += 1
    info.now = now
    release_and_change(m, now)
    advance_sessions(m, now)
    deliver(m, now)
    look_around(m, now)
    communicate(m, now)
    age_records(m, now)
    mark_due(m, now)
    pay(m)
    log_tick(m)
    info.tick_reward[0] = 0.0
    info.tick_reward[1] = 0.0
    if is_over(m, now):
        info.over = 1
        close(m, now)


@kernel
def malfunctions(m, now):
    """Each robot may fail for good; under control the hazard is lower."""
    rules, info = m.rules[0], m.info[0]
    for r in range(m.robots.shape[0]):
        robot = m.robots[r]
        if robot.activity == FAILED:
            continue
        hazard = rules.hazard if robot.mode == AUTONOMOUS else rules.controlled_hazard
        if uniform(info.seed, MALFUNCTION, now, r, 0) < hazard:
            drop_task(m, r)
            break_robot(m, r, now)


@kernel
def work(m, now):
    """Robots travel and service."""
    for r in range(m.robots.shape[0]):
        activity = m.robots[r].activity
        if activity == TRAVELLING:
            travel(m, r)
        elif activity == SERVICING:
            serve(m, r, now)


@kernel
def release_and_change(m, now):
    """Tasks are announced; unserviced general tasks turn robot-exclusive without notice."""
    info = m.info[0]
    for j in range(m.tasks.shape[0]):
        task = m.tasks[j]
        if not task.released and now >= task.release:
            task.released = 1
            info.pending_value += task.value
        if task.change_at >= 0.0 and now >= task.change_at:
            if task.progress == 0.0 and task.status == 0:
                task.type = task.changes_to
                task.changed_at = now
            task.change_at = NEVER


@kernel
def deliver(m, now):
    """Messages that are due reach their receivers."""
    n_robots = m.robots.shape[0]
    for k in range(m.info[0].flying - 1, -1, -1):
        message = m.air[m.flying[k]]
        if message.due > now:
            continue
        is_heard = message.receiver >= n_robots or m.robots[message.receiver].activity != FAILED
        if is_heard:
            receive(m, message, now)
        land(m, k, is_heard, now)


@kernel
def receive(m, message, now):
    """What a delivered message does to its receiver."""
    kind, sender, receiver = message.kind, message.sender, message.receiver
    station = m.robots.shape[0]  # row of the station's tables, and address of operator 0
    if kind == BROADCAST:
        learn_peer(m, receiver, sender, message.robot)
        learn_records(m, receiver, message)
    elif kind == TELEMETRY:
        if learn_peer(m, station, sender, message.robot):
            for h in range(m.operators.shape[0]):
                if m.operators[h].robot == sender:
                    m.operators[h].due = 1
        learn_records(m, station, message)
    elif kind == QUERY:
        waiting = m.downlinks[receiver - station, 1 + sender]
        if waiting.since < 0.0:
            enqueue(m, waiting, REPLY, receiver, sender, now)
    elif kind == REQUEST:
        report = m.peers[station, sender]
        report.request_time = max(report.request_time, message.robot.request_time)
    elif kind == REPLY:
        held = m.resources[receiver, sender - station]
        if message.resource.time > held.time:
            m.resources[receiver, sender - station] = message.resource
        learn_records(m, receiver, message)
    else:
        receive_command(m, sender - station, receiver, kind, now)


@kernel
def learn_records(m, receiver, message):
    """Merge the task records that a message carries; their evidence times stay as they are."""
    for k in range(message.records):
        b = message.belief[k]
        learn_task(m, receiver, message.task[k], b.type, b.status, b.progress, b.time, 0)


@kernel
def look_around(m, now):
    """Every robot senses the tasks around it."""
    for r in range(m.robots.shape[0]):
        if m.robots[r].activity != FAILED:
            sense(m, r, now)


@kernel
def communicate(m, now):
    """Telemetry falls due, and queues send what their tokens permit."""
    if m.rules[0].link_model == PERFECT:
        for r in range(m.robots.shape[0]):
            m.robots[r].tokens = m.rules[0].bucket
        for h in range(m.operators.shape[0]):
            m.operators[h].tokens = m.rules[0].bucket
    for r in range(m.robots.shape[0]):
        if m.robots[r].activity != FAILED:
            queue_telemetry(m, r, now)
            serve_uplink(m, r, now)
    for h in range(m.operators.shape[0]):
        serve_downlink(m, h, now)


@kernel
def mark_due(m, now):
    """Everybody decides at least once a period; the prescribed first targets run out."""
    rules = m.rules[0]
    for r in range(m.robots.shape[0]):
        robot = m.robots[r]
        if robot.activity == FAILED:
            continue
        if robot.prescribed and now >= rules.initial_phase_end:
            robot.prescribed = 0
            robot.due = 1
        if now >= robot.next_decision:
            robot.due = 1
    for h in range(m.operators.shape[0]):
        if now >= m.operators[h].next_decision:
            m.operators[h].due = 1


@kernel
def pay(m):
    """The team reward of this second (paper, eq. 4): mission part and coordination part."""
    info = m.info[0]
    info.tick_reward[0] -= m.rules[0].pending_cost * info.pending_value / info.total_value
    info.reward[0] += info.tick_reward[0]
    info.reward[1] += info.tick_reward[1]


@kernel
def is_over(m, now):
    """At the time limit, or when nothing can be completed any more."""
    if now >= m.rules[0].time_limit:
        return True
    alive = False
    for r in range(m.robots.shape[0]):
        alive = alive or m.robots[r].activity != FAILED
    pending = False
    for j in range(m.tasks.shape[0]):
        pending = pending or m.tasks[j].status != DONE
    return not (alive and pending)


@kernel
def is_anybody_due(m):
    """Whether some actor has to decide now."""
    for r in range(m.robots.shape[0]):
        if m.robots[r].due:
            return True
    for h in range(m.operators.shape[0]):
        if m.operators[h].due:
            return True
    return False


@kernel
def advance(m):
    """Tick until somebody is due or the mission is over."""
    while not m.info[0].over and not is_anybody_due(m):
        tick(m)
