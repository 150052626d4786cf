"""Transport: queues, token buckets, packet fates and delivery (docs/benchmark.md, section 6).

Every message ends in exactly one `Fate`. Stations' ends of links are numbered after the robots: operator
h is address R + h, the station's shared table R + H.
"""

from ..base.elementary_functions import distance
from ..base.kernels import kernel
from ..base.terms import NOBODY, Activity, Fate, Kind
from ..radio.links import fates
from .accessors import (
    counters_of,
    downlink_of,
    flying_of,
    message_at,
    scratch_of,
    true_operator,
    true_robot,
    uplink_of,
)
from .messages import choose_tip, copy_payload, note_tip, write_broadcast, write_reply, write_telemetry
from .propagation import link_between, link_to_station
from .randomness import Event, uniform
from .recorder import log_end, log_message, log_sent
from .state import NEVER

BROADCAST, TELEMETRY = int(Kind.BROADCAST), int(Kind.TELEMETRY)
REQUEST, REPLY = int(Kind.REQUEST), int(Kind.REPLY)
CONTROL, RENEWAL, RELEASE = int(Kind.CONTROL), int(Kind.RENEWAL), int(Kind.RELEASE)
DELIVERED, OUT_OF_RANGE, TERRAIN, LOST = (
    int(Fate.DELIVERED), int(Fate.OUT_OF_RANGE), int(Fate.TERRAIN), int(Fate.LOST),
)  # fmt: skip
NO_TOKENS, EXPIRED, UNDERWAY = int(Fate.NO_TOKENS), int(Fate.EXPIRED), int(Fate.UNDERWAY)
PACKET, PACKET_DELAY = int(Event.PACKET), int(Event.PACKET_DELAY)
FAILED = int(Activity.FAILED)


@kernel
def attempt(m, kind, sender, receiver, now):
    """Count a new message and open its line in the log; returns the line's number."""
    counters_of(m, kind).attempted += 1
    return log_message(m, kind, sender, receiver, now)


@kernel
def finish(m, kind, line, fate, now):
    """The one place where a message meets its fate."""
    counters_of(m, kind).fate[fate] += 1
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
    if waiting.since >= 0.0 and now - waiting.since >= m.rules.time_to_live:
        finish(m, waiting.kind, waiting.log, EXPIRED, now)
        waiting.since = NEVER


@kernel
def transmit(m, kind, sender, receiver, passing, line, now):
    """Put a message on the air over a link that lets a share `passing` of the packets pass.

    Returns the slot whose content the caller fills in, or NOBODY when the packet is lost.
    """
    rules = m.rules
    counters = counters_of(m, kind)
    counters.sent += 1
    counters.bytes += rules.message_bytes[kind]
    draw = uniform(m.seed, PACKET + kind, now, sender, receiver)
    on_time, late = fates(rules.radio, passing)
    log_sent(m, line, on_time <= draw < on_time + late, now)
    if draw >= on_time + late:
        finish(m, kind, line, TERRAIN if draw < 0.5 * (1.0 + rules.radio.on_time) else LOST, now)
        return NOBODY
    delay = rules.delay
    if draw >= on_time:
        counters.late += 1
        spread = rules.late_high - rules.late_low + 1
        delay = rules.late_low + int(spread * uniform(m.seed, PACKET_DELAY + kind, now, sender, receiver))
    slot = flying_of(m, m.flying).slot
    m.flying += 1
    message = message_at(m, slot)
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
    slot = flying_of(m, k).slot
    message = message_at(m, slot)
    if is_heard:
        counters_of(m, message.kind).latency_sum += now - message.sent
    finish(m, message.kind, message.log, DELIVERED if is_heard else LOST, now)
    m.flying -= 1
    flying_of(m, k).slot = flying_of(m, m.flying).slot
    flying_of(m, m.flying).slot = slot


@kernel
def broadcast(m, r, now):
    """Robot r tells its best neighbours in range its own state and its freshest task records."""
    robot, rules = true_robot(m, r), m.rules
    robot.last_broadcast = now
    robot.broadcast_tokens -= rules.message_bytes[BROADCAST]
    degree = min(rules.out_degree, m.n_robots - 1)
    scratch, count = scratch_of(m), 0
    best, shares, ways = scratch.found, scratch.distance, scratch.dx
    for other in range(m.n_robots):
        peer = true_robot(m, other)
        if other == r or peer.activity == FAILED:
            continue
        share, way = link_between(m, r, other, BROADCAST), distance(peer.x - robot.x, peer.y - robot.y)
        if share <= 0.0:
            continue
        k = count  # the best link first, among equals the nearest
        while k > 0 and (shares[k - 1] < share or (shares[k - 1] == share and ways[k - 1] > way)):
            if k < degree:
                best[k], shares[k], ways[k] = best[k - 1], shares[k - 1], ways[k - 1]
            k -= 1
        if k < degree:
            best[k], shares[k], ways[k] = other, share, way
            count = min(count + 1, degree)
    if count == 0:
        finish(m, BROADCAST, attempt(m, BROADCAST, r, NOBODY, now), OUT_OF_RANGE, now)
    first = NOBODY
    for k in range(count):
        line = attempt(m, BROADCAST, r, best[k], now)
        slot = transmit(m, BROADCAST, r, best[k], shares[k], line, now)
        if slot != NOBODY and first == NOBODY:
            first = slot
            write_broadcast(m, message_at(m, slot), r, now)
        elif slot != NOBODY:
            copy_payload(message_at(m, first), message_at(m, slot))


@kernel
def serve_uplink(m, r, now):
    """Robot r's buckets are refilled; its uplink sends what the tokens permit: query, request, then telemetry."""
    robot, rules = true_robot(m, r), m.rules
    robot.tokens = min(rules.bucket, robot.tokens + rules.refill)
    robot.broadcast_tokens = min(rules.broadcast_bucket, robot.broadcast_tokens + rules.broadcast_refill)
    for place in range(m.n_uplink_places):
        expire(m, uplink_of(m, r, place), now)
    for place in range(m.n_uplink_places):
        waiting = uplink_of(m, r, place)
        if waiting.since < 0.0:
            continue
        kind = waiting.kind
        if robot.tokens < rules.message_bytes[kind]:
            break  # what is more urgent goes first
        robot.tokens -= rules.message_bytes[kind]
        waiting.since = NEVER
        slot = transmit(m, kind, r, waiting.target, link_to_station(m, r, kind), waiting.log, now)
        if slot == NOBODY:
            continue
        message = message_at(m, slot)
        if kind == TELEMETRY:
            write_telemetry(m, message, r, now)
        elif kind == REQUEST:
            message.robot.request_time = robot.last_request
        else:
            message.about = robot.task


@kernel
def send_last_report(m, r, now):
    """In the second in which it fails, robot r may still say so."""
    enqueue(m, uplink_of(m, r, 2), TELEMETRY, r, m.n_robots + m.n_operators, now)
    serve_uplink(m, r, now)
    displace(m, uplink_of(m, r, 2), now)


@kernel
def queue_telemetry(m, r, now):
    """Telemetry falls due; it yields to a query or a request that waits."""
    robot = true_robot(m, r)
    if now < robot.next_telemetry:
        return
    robot.next_telemetry = now + m.rules.telemetry_period
    station = m.n_robots + m.n_operators
    enqueue(m, uplink_of(m, r, 2), TELEMETRY, r, station, now)
    if uplink_of(m, r, 0).since >= 0.0 or uplink_of(m, r, 1).since >= 0.0:
        displace(m, uplink_of(m, r, 2), now)


@kernel
def serve_downlink(m, h, now):
    """Operator h's link sends what its tokens permit: the command, then replies, the oldest first."""
    operator, rules = true_operator(m, h), m.rules
    operator.tokens = min(rules.bucket, operator.tokens + rules.refill)
    for place in range(m.n_downlink_places):
        expire(m, downlink_of(m, h, place), now)
    while True:
        place = 0 if downlink_of(m, h, 0).since >= 0.0 else oldest_reply(m, h)
        if place == NOBODY:
            break
        waiting = downlink_of(m, h, place)
        if operator.tokens < rules.message_bytes[waiting.kind]:
            break
        send_downlink(m, h, waiting, now)


@kernel
def oldest_reply(m, h):
    """The place of operator h's reply that has waited longest, or NOBODY."""
    oldest, since = NOBODY, 0.0
    for place in range(1, m.n_downlink_places):
        waiting = downlink_of(m, h, place)
        if waiting.since >= 0.0 and (oldest == NOBODY or waiting.since < since):
            oldest, since = place, waiting.since
    return oldest


@kernel
def send_downlink(m, h, waiting, now):
    """Send operator h's command or reply to its robot. A lease counts from now, whenever it arrives."""
    operator, rules = true_operator(m, h), m.rules
    kind, r = waiting.kind, waiting.target
    operator.tokens -= rules.message_bytes[kind]
    waiting.since = NEVER
    slot = transmit(m, kind, m.n_robots + h, r, link_to_station(m, r, kind), waiting.log, now)
    if kind == CONTROL:
        operator.leased, operator.ordered_at, operator.lease_sent = r, now, now
    elif kind == RENEWAL:
        operator.lease_sent = now
    elif kind == RELEASE:
        operator.ordered_at = now
    elif kind == REPLY:
        tip = choose_tip(m, r, waiting.about, now)
        if slot != NOBODY:
            write_reply(m, message_at(m, slot), h, r, tip, now)
        if tip != NOBODY:
            note_tip(m, r, tip)


@kernel
def close(m, now):
    """The mission is over: whatever is queued or in the air stays under way for ever."""
    for k in range(m.flying):
        message = message_at(m, flying_of(m, k).slot)
        finish(m, message.kind, message.log, UNDERWAY, now)
    for r in range(m.n_robots):
        for place in range(m.n_uplink_places):
            leave_waiting(m, uplink_of(m, r, place), now)
    for h in range(m.n_operators):
        for place in range(m.n_downlink_places):
            leave_waiting(m, downlink_of(m, h, place), now)


@kernel
def leave_waiting(m, waiting, now):
    """A message that still waits when the mission is over."""
    if waiting.since >= 0.0:
        finish(m, waiting.kind, waiting.log, UNDERWAY, now)
