"""Robots at work: travel, arrival, service and its outcome (docs/benchmark.md, sections 3 and 4)."""

from ..base.elementary_functions import distance, exp
from ..base.kernels import kernel
from ..base.terms import NOBODY, Activity, Embodiment, Mode, Status
from ..models.routes import DIRECT, best_start, find_visible, is_clear
from .accessors import routes_of, scratch_of, true_operator, true_robot, true_task
from .randomness import Event, uniform
from .records import is_compatible

UGV = int(Embodiment.UGV)
IDLING, TRAVELLING, SERVICING = int(Activity.IDLE), int(Activity.TRAVELLING), int(Activity.SERVICING)
CONTROLLED, HANDOVER = int(Mode.CONTROLLED), int(Mode.HANDOVER)
OPEN, SERVICED, DONE = int(Status.OPEN), int(Status.SERVICED), int(Status.DONE)
SERVICE = int(Event.SERVICE)


@kernel
def drop_task(m, r):
    """Robot r gives up its task; its progress stays."""
    robot = true_robot(m, r)
    if robot.task == NOBODY:
        return
    task = true_task(m, robot.task)
    task.owner = NOBODY
    if robot.activity == SERVICING:
        task.status = OPEN
    robot.task = NOBODY
    robot.activity = IDLING
    robot.prescribed = 0


@kernel
def finish_task(m, r):
    """Robot r has no use for its task any more: it is done, or incompatible and the way there was in vain."""
    drop_task(m, r)
    true_robot(m, r).due = 1


@kernel
def take_task(m, r, j):
    """Robot r owns task j and sets out for it."""
    robot = true_robot(m, r)
    robot.task = j
    robot.activity = TRAVELLING
    true_task(m, j).owner = r
    plan_route(m, r)


@kernel
def plan_route(m, r):
    """Aim at the task, for a ground robot over the first corner of its shortest route."""
    robot = true_robot(m, r)
    task = true_task(m, robot.task)
    aim_at_corner(m, robot, DIRECT)
    routes = routes_of(m)
    if robot.embodiment != UGV or is_clear(routes.frames, robot.x, robot.y, task.x, task.y):
        return
    count = find_visible(routes.frames, routes.corners, robot.x, robot.y, scratch_of(m))
    _, corner = best_start(routes.to_goal, robot.task, scratch_of(m), count)
    aim_at_corner(m, robot, corner)


@kernel
def aim_at_corner(m, robot, corner):
    """Make a corner of the route, or the goal behind the last one, the next waypoint."""
    task = true_task(m, robot.task)
    robot.hop = corner
    if corner == DIRECT:
        robot.waypoint_x, robot.waypoint_y = task.x, task.y
    else:
        robot.waypoint_x, robot.waypoint_y = routes_of(m).corners[corner, 0], routes_of(m).corners[corner, 1]


@kernel
def travel(m, r):
    """One second on the way; service starts on arrival if the true type permits it."""
    robot = true_robot(m, r)
    robot.place = NOBODY
    left = m.rules.speed[1 if robot.mode == CONTROLLED else 0, robot.embodiment]
    while True:
        dx, dy = robot.waypoint_x - robot.x, robot.waypoint_y - robot.y
        way = distance(dx, dy)
        if way > left:
            robot.x += dx / way * left
            robot.y += dy / way * left
            return
        left -= way
        robot.x, robot.y = robot.waypoint_x, robot.waypoint_y
        if robot.hop == DIRECT:
            break
        aim_at_corner(m, robot, routes_of(m).next_hop[robot.task, robot.hop])
    arrive(m, r)


@kernel
def arrive(m, r):
    """At the POI: start service, or discover that there is none to give."""
    robot = true_robot(m, r)
    task = true_task(m, robot.task)
    robot.place = robot.task
    if task.status == DONE or not is_compatible(robot.embodiment, task.type):
        finish_task(m, r)
    else:
        robot.activity = SERVICING
        task.status = SERVICED


@kernel
def autonomous_seconds(rules, difficulty):
    """Service time of an autonomous robot."""
    return rules.service_base + rules.service_per_difficulty * difficulty


@kernel
def slowdown(rules, proficiency, fatigue):
    """Factor on the service time under control."""
    return proficiency * (1.0 + rules.fatigue_slowdown * fatigue)


@kernel
def controlled_seconds(rules, operator, embodiment, difficulty):
    """Service time under control of `operator`."""
    return autonomous_seconds(rules, difficulty) * slowdown(rules, operator.proficiency[embodiment], operator.fatigue)


@kernel
def autonomous_success(rules, difficulty):
    """Probability that an autonomous attempt succeeds."""
    return max(0.0, rules.success_autonomous[0] - rules.success_autonomous[1] * difficulty)


@kernel
def controlled_success(rules, difficulty, fatigue):
    """Probability that a controlled attempt succeeds."""
    p = rules.success_controlled
    return max(0.0, p[0] - p[1] * difficulty - p[2] * fatigue)


@kernel
def serve(m, r, now):
    """One second of service; at full progress the attempt succeeds or fails.

    Its chance is the mean over the progress: each share counts as it was made, autonomous or controlled.
    """
    robot, rules = true_robot(m, r), m.rules
    if robot.mode == HANDOVER:
        return
    task = true_task(m, robot.task)
    if robot.mode == CONTROLLED:
        operator = true_operator(m, robot.controller)
        seconds = controlled_seconds(rules, operator, robot.embodiment, task.difficulty)
        success = controlled_success(rules, task.difficulty, operator.fatigue)
    else:
        seconds = autonomous_seconds(rules, task.difficulty)
        success = autonomous_success(rules, task.difficulty)
    gain = min(1.0 - task.progress, 1.0 / seconds)
    task.progress += gain
    task.chance += gain * success
    if task.progress < 1.0 - 1e-9:
        return
    is_success = uniform(m.seed, SERVICE, now, r, robot.task) < task.chance
    count_luck(m, task, seconds, is_success, now)
    if is_success:
        complete(m, r, now + 1)
    else:
        task.progress, task.chance = 0.0, 0.0
        robot.prescribed = 0
        robot.due = 1


@kernel
def count_luck(m, task, seconds, is_success, now):
    """Add by how much an attempt went better than its chance: in value and in minutes, each also by the time that is left.

    Whatever is decided, the mean of each measure is 0: what two flights differ by can be freed of their luck without bias
    (MIVAT: White and Bowling, Learning a value analysis tool for agent evaluation, IJCAI 2009).
    """
    luck = (1.0 if is_success else 0.0) - task.chance
    left = 1.0 - now / m.rules.time_limit
    value, minutes = luck * task.value * timeliness(task.deadline, task.decay, now + 1), luck * seconds / 60.0
    m.luck[0] += value
    m.luck[1] += value * left
    m.luck[2] += minutes
    m.luck[3] += minutes * left


@kernel
def complete(m, r, time):
    """The task is done for good; its value counts, discounted when late (paper, eq. 4)."""
    j = true_robot(m, r).task
    task = true_task(m, j)
    finish_task(m, r)
    task.progress = 1.0
    task.status = DONE
    task.done_at = time
    task.done_by = r
    m.pending_value -= task.value
    m.tick_reward[0] += task.value * timeliness(task.deadline, task.decay, time)


@kernel
def timeliness(deadline, decay, time):
    """Share of a task's value that completion at `time` realises (paper, eq. 6)."""
    return exp(-max(0.0, time - deadline) / decay)
