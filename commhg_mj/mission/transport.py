"""Transport: queues, token buckets, packet fates and delivery (benchmark, section 6).

Every message ends in exactly one `Fate`. Stations' ends of links are numbered after the robots: operator
h is address R + h, the station's shared table R + H.
"""

from ..kernels import kernel
from ..radio.links import robot_link, station_link
from ..terms import NOBODY, Activity, Fate, Kind
from .log import log_end, log_message, log_sent
from .randomness import Event, uniform
from .records import freshest, write_peer
from .state import NEVER

BROADCAST, TELEMETRY, REPLY = int(Kind.BROADCAST), int(Kind.TELEMETRY), int(Kind.REPLY)
DELIVERED, OUT_OF_RANGE, TERRAIN, LOST = (
    int(Fate.DELIVERED), int(Fate.OUT_OF_RANGE), int(Fate.TERRAIN), int(Fate.LOST),
)  # fmt: skip
NO_TOKENS, EXPIRED, UNDERWAY = int(Fate.NO_TOKENS), int(Fate.EXPIRED), int(Fate.UNDERWAY)
PACKET, PACKET_DELAY = int(Event.PACKET), int(Event.PACKET_DELAY)
FAILED = int(Activity.FAILED)
# Fatigue is reported in three classes: fresh, tiring, tired.
TIRING, TIRED = 0.3, 0.6


@kernel
def attempt(m, kind, sender, receiver, now):
    """Count a new message and open its line in the log; returns the line's number."""
    m.counters[kind].attempted += 1
    return log_message(m, kind, sender, receiver, now)


@kernel
def finish(m, kind, line, fate, now):
    """The one place where a message meets its fate."""
    m.counters[kind].fate[fate] += 1
    log_end(m, line, fate, now)


@kernel
def enqueue(m, waiting, kind, sender, target, now):
    """Queue a message; one that still waits in the same place is superseded."""
    if waiting.since >= 0.0:
        finish(m, waiting.kind, waiting.log, NO_TOKENS, now)
    waiting.since = now
    waiting.kind = kind
    waiting.target = target
    waiting.log = attempt(m, kind, sender, target, now)


@kernel
def displace(m, waiting, now):
    """Drop a waiting message in favour of a more urgent one."""
    if waiting.since >= 0.0:
        finish(m, waiting.kind, waiting.log, NO_TOKENS, now)
        waiting.since = NEVER


@kernel
def expire(m, waiting, now):
    """Drop a message whose time to live ran out in the queue."""
    if waiting.since >= 0.0 and now - waiting.since >= m.rules[0].time_to_live:
        finish(m, waiting.kind, waiting.log, EXPIRED, now)
        waiting.since = NEVER


@kernel
def transmit(m, kind, sender, receiver, clearance, line, now):
    """Put a message on the air over a link that lets `clearance` of the packets pass.

    Over clear ground a share `on_time` arrives in time, and half of the rest late; terrain scales both.
    Returns the slot whose content the caller fills in, or NOBODY when the packet is lost.
    """
    rules, info = m.rules[0], m.info[0]
    counters = m.counters[kind]
    counters.sent += 1
    counters.bytes += rules.message_bytes[kind]
    draw = uniform(info.seed, PACKET + kind, now, sender, receiver)
    on_time, late = rules.on_time * clearance, 0.5 * (1.0 - rules.on_time) * clearance
    log_sent(m, line, on_time <= draw < on_time + late, now)
    if draw >= on_time + late:
        finish(m, kind, line, TERRAIN if draw < 0.5 * (1.0 + rules.on_time) else LOST, now)
        return NOBODY
    delay = rules.delay
    if draw >= on_time:
        counters.late += 1
        spread = rules.late_high - rules.late_low + 1
        delay = rules.late_low + int(spread * uniform(info.seed, PACKET_DELAY + kind, now, sender, receiver))
    slot = m.flying[info.flying]
    info.flying += 1
    message = m.air[slot]
    message.kind = kind
    message.sender = sender
    message.receiver = receiver
    message.sent = now
    message.due = now + delay
    message.log = line
    message.records = 0
    return slot


@kernel
def land(m, k, is_heard, now):
    """Take the k-th flying message off the air; its slot becomes free. A failed receiver hears nothing."""
    info = m.info[0]
    slot = m.flying[k]
    message = m.air[slot]
    if is_heard:
        m.counters[message.kind].latency_sum += now - message.sent
    finish(m, message.kind, message.log, DELIVERED if is_heard else LOST, now)
    info.flying -= 1
    m.flying[k] = m.flying[info.flying]
    m.flying[info.flying] = slot


@kernel
def broadcast(m, r, now):
    """Robot r tells its best neighbours in range its own state and its freshest task records."""
    robot, rules = m.robots[r], m.rules[0]
    robot.last_broadcast = now
    degree = min(rules.out_degree, m.robots.shape[0] - 1)
    best, clearances, count = m.ground.seen, m.ground.seen_distance, 0  # both are free outside route queries
    for other in range(m.robots.shape[0]):
        peer = m.robots[other]
        if other == r or peer.activity == FAILED:
            continue
        clearance = robot_link(rules, m.ground, robot.x, robot.y, peer.x, peer.y)
        if clearance <= 0.0 or (count == degree and clearance <= clearances[count - 1]):
            continue
        k = count if count < degree else degree - 1
        while k > 0 and clearances[k - 1] < clearance:
            best[k], clearances[k] = best[k - 1], clearances[k - 1]
            k -= 1
        best[k], clearances[k] = other, clearance
        count = min(count + 1, degree)
    if count == 0:
        finish(m, BROADCAST, attempt(m, BROADCAST, r, NOBODY, now), OUT_OF_RANGE, now)
    for k in range(count):
        line = attempt(m, BROADCAST, r, best[k], now)
        slot = transmit(m, BROADCAST, r, best[k], clearances[k], line, now)
        if slot != NOBODY:
            write_peer(m, m.air[slot].robot, r, now)
            freshest(m, r, False, rules.broadcast_records, m.air[slot])


@kernel
def serve_uplink(m, r, now):
    """Robot r sends what its tokens permit: query, request, then telemetry."""
    robot, rules = m.robots[r], m.rules[0]
    robot.tokens = min(rules.bucket, robot.tokens + rules.refill)
    for place in range(3):
        waiting = m.uplinks[r, place]
        expire(m, waiting, now)
        if waiting.since < 0.0:
            continue
        kind = waiting.kind
        if robot.tokens < rules.message_bytes[kind]:
            break  # what is more urgent goes first
        robot.tokens -= rules.message_bytes[kind]
        waiting.since = NEVER
        slot = transmit(m, kind, r, waiting.target, station_link(rules, m.ground, robot.x, robot.y), waiting.log, now)
        if slot != NOBODY:
            write_peer(m, m.air[slot].robot, r, now)
            if kind == TELEMETRY:
                freshest(m, r, True, rules.telemetry_records, m.air[slot])


@kernel
def queue_telemetry(m, r, now):
    """Telemetry falls due; it yields to a query or a request that waits."""
    robot = m.robots[r]
    if now < robot.next_telemetry:
        return
    robot.next_telemetry = now + m.rules[0].telemetry_period
    station = m.robots.shape[0] + m.operators.shape[0]
    enqueue(m, m.uplinks[r, 2], TELEMETRY, r, station, now)
    if m.uplinks[r, 0].since >= 0.0 or m.uplinks[r, 1].since >= 0.0:
        displace(m, m.uplinks[r, 2], now)


@kernel
def serve_downlink(m, h, now):
    """Operator h's link sends what its tokens permit: the command, then replies, the oldest first."""
    operator, rules = m.operators[h], m.rules[0]
    operator.tokens = min(rules.bucket, operator.tokens + rules.refill)
    queue = m.downlinks[h]
    for place in range(queue.shape[0]):
        expire(m, queue[place], now)
    while True:
        place = 0 if queue[0].since >= 0.0 else oldest_reply(queue)
        if place == NOBODY or operator.tokens < rules.message_bytes[queue[place].kind]:
            break
        send_downlink(m, h, queue[place], now)


@kernel
def oldest_reply(queue):
    """The reply that has waited longest, or NOBODY."""
    oldest = NOBODY
    for place in range(1, queue.shape[0]):
        if queue[place].since >= 0.0 and (oldest == NOBODY or queue[place].since < queue[oldest].since):
            oldest = place
    return oldest


@kernel
def send_downlink(m, h, waiting, now):
    """Send operator h's command or reply to its robot."""
    operator, rules = m.operators[h], m.rules[0]
    kind, r = waiting.kind, waiting.target
    operator.tokens -= rules.message_bytes[kind]
    waiting.since = NEVER
    robot = m.robots[r]
    clearance = station_link(rules, m.ground, robot.x, robot.y)
    slot = transmit(m, kind, m.robots.shape[0] + h, r, clearance, waiting.log, now)
    if slot != NOBODY and kind == REPLY:
        write_reply(m, m.air[slot], h, r, now)


@kernel
def close(m, now):
    """The mission is over: whatever is queued or in the air stays under way for ever."""
    for k in range(m.info[0].flying):
        message = m.air[m.flying[k]]
        finish(m, message.kind, message.log, UNDERWAY, now)
    for queues in (m.uplinks, m.downlinks):
        for i in range(queues.shape[0]):
            for place in range(queues.shape[1]):
                if queues[i, place].since >= 0.0:
                    finish(m, queues[i, place].kind, queues[i, place].log, UNDERWAY, now)


@kernel
def write_reply(m, message, h, r, now):
    """Operator h's resources, and one tip for robot r out of the station's evidence."""
    operator, report = m.operators[h], message.resource
    report.time = now
    report.tokens = operator.tokens
    report.robot = operator.robot
    report.session = operator.session
    report.fatigue_class = 0 if operator.fatigue < TIRING else (1 if operator.fatigue < TIRED else 2)
    waiting = 0
    for place in range(m.downlinks.shape[1]):
        waiting += m.downlinks[h, place].since >= 0.0
    report.queue = waiting
    j = choose_tip(m, r)
    if j != NOBODY:
        message.records = 1
        message.task[0] = j
        message.belief[0] = m.beliefs[m.robots.shape[0], j]
        m.tips[r, j] = message.belief[0].time


@kernel
def choose_tip(m, r):
    """The most useful fresh record for robot r as far as the station knows, or NOBODY.

    Its reported assignment first, if done or changed; then the nearest change that it has not been sent.
    """
    station = m.robots.shape[0]
    report = m.peers[station, r]
    tip, nearest = NOBODY, 1e300
    for j in range(m.tasks.shape[0]):
        belief, task = m.beliefs[station, j], m.tasks[j]
        changed = belief.status != 0 or belief.type != task.announced
        if belief.time < 0.0 or not changed or belief.time <= m.tips[r, j]:
            continue
        distance = -1.0 if report.task == j else (task.x - report.x) ** 2 + (task.y - report.y) ** 2
        if distance < nearest:
            tip, nearest = j, distance
    return tip
