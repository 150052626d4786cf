"""What a reply to a query says: the operator's resources and at most one task tip (docs/benchmark.md, section 6)."""

from ..base.elementary import distance
from ..kernels import kernel
from ..terms import NOBODY
from .access import belief_of, downlink_of, operator_of, peer_of, task_of, tip_of
from .records import DONE, OPEN

# Fatigue is reported in three classes: fresh, tiring, tired.
TIRING, TIRED = 0.3, 0.6


@kernel
def write_reply(m, message, h, tip, now):
    """Operator h's resources, and the station's record of task `tip`, if any."""
    operator, report = operator_of(m, h), message.resource
    report.time = now
    report.tokens = operator.tokens
    report.robot = operator.robot
    report.session = operator.session
    report.fatigue_class = 0 if operator.fatigue < TIRING else (1 if operator.fatigue < TIRED else 2)
    waiting = 0
    for place in range(m.n_downlink_places):
        waiting += downlink_of(m, h, place).since >= 0.0
    report.queue = waiting
    if tip != NOBODY:
        message.records = 1
        message.task[0] = tip
        message.belief[0] = belief_of(m, m.n_robots, tip)


@kernel
def choose_tip(m, r):
    """The most useful fresh record for robot r as far as the station knows, or NOBODY.

    Its reported assignment first, if done or changed; then the nearest change that it has not been sent.
    """
    station = m.n_robots
    report = peer_of(m, station, r)
    x, y = m.station_x, m.station_y  # where all robots start
    if report.time >= 0.0:
        x, y = report.x, report.y
    tip, nearest = NOBODY, 1e300
    for j in range(m.n_tasks):
        belief, task = belief_of(m, station, j), task_of(m, j)
        ends = belief.status == DONE or belief.type != task.announced
        if not ends and (belief.status == OPEN or report.task == j):
            continue
        if belief.time < 0.0 or belief.time <= tip_of(m, r, j).time:
            continue
        way = -1.0 if report.task == j else distance(task.x - x, task.y - y)
        if way < nearest:
            tip, nearest = j, way
    return tip
