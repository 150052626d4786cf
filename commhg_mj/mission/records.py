"""Records: what delivery and sensing do to what somebody knows (paper, section III-A).

Newer evidence replaces older, relaying refreshes nothing, completion is terminal.
"""

from ..base.kernels import kernel
from ..base.terms import Activity, Embodiment, Status, TaskType
from .accessors import copy_record, inbox_of, known_robot, known_task, routes_of, true_robot, true_task
from .state import NEVER

OPEN, DONE, SERVICING = int(Status.OPEN), int(Status.DONE), int(Activity.SERVICING)
UAV, UGV = int(Embodiment.UAV), int(Embodiment.UGV)
UAV_ONLY, UGV_ONLY = int(TaskType.UAV_ONLY), int(TaskType.UGV_ONLY)


@kernel
def is_compatible(embodiment, task_type):
    """Whether a robot of this embodiment may service a task of this type."""
    if embodiment == UAV:
        return task_type != UGV_ONLY
    return task_type != UAV_ONLY


@kernel
def believed_type(m, receiver, task):
    """The type by the receiver's evidence, or the announced one."""
    belief = known_task(m, receiver, task)
    return belief.type if belief.time >= 0.0 else true_task(m, task).announced


@kernel
def is_ruled_out(m, robot, task):
    """Whether the robot's own evidence says that it cannot service the task any more."""
    belief = known_task(m, robot, task)
    known_done = belief.time >= 0.0 and belief.status == DONE
    return known_done or not is_compatible(true_robot(m, robot).embodiment, believed_type(m, robot, task))


@kernel
def learn_task(m, receiver, task, task_type, status, progress, time, sensed):
    """Merge one piece of task evidence; a robot whose held task is contradicted becomes due."""
    belief = known_task(m, receiver, task)
    known = belief.time >= 0.0
    if (known and belief.status == DONE) or time <= belief.time:
        return
    belief.time = time
    belief.type = task_type
    belief.status = status
    belief.progress = progress
    belief.sensed = sensed
    if receiver < m.n_robots and true_robot(m, receiver).task == task and is_ruled_out(m, receiver, task):
        true_robot(m, receiver).due = 1


@kernel
def learn_claim(m, receiver, task, told):
    """Merge the claim in a task record of the station: which robot had the task by its own report, and when."""
    belief = known_task(m, receiver, task)
    if told.claim_time > belief.claim_time:
        belief.claim_time, belief.claimed_by = told.claim_time, told.claimed_by


@kernel
def learn_peer(m, receiver, r, record):
    """Merge a robot's report of itself; returns whether its task, activity or mode is news."""
    held = known_robot(m, receiver, r)
    if record.time <= held.time:
        return False
    if true_robot(m, r).failed_at == NEVER:
        inbox = inbox_of(m, receiver)
        inbox.known += held.time < 0.0
        inbox.time_sum += record.time - max(0.0, held.time)
    news = held.task != record.task or held.activity != record.activity or held.mode != record.mode
    record.request_time = held.request_time  # requests come by themselves
    copy_record(held, record)
    return news


@kernel
def stop_ageing(m, r):
    """A robot that failed reports no more: its records leave the age of information."""
    for receiver in range(m.n_robots + 1):
        held = known_robot(m, receiver, r)
        if held.time >= 0.0:
            inbox_of(m, receiver).known -= 1
            inbox_of(m, receiver).time_sum -= held.time


@kernel
def age_records(m, now):
    """Add this second's ages of living robots' records at every living receiver (age of information)."""
    n_robots = m.n_robots
    for receiver in range(n_robots + 1):
        if receiver == n_robots or true_robot(m, receiver).failed_at == NEVER:
            inbox = inbox_of(m, receiver)
            inbox.age_sum += inbox.known * now - inbox.time_sum
            inbox.samples += inbox.known


@kernel
def sense(m, r, now):
    """Robot r sees the true state of every released task within its radius."""
    robot, pois = true_robot(m, r), routes_of(m).goals
    x, y, place = robot.x, robot.y, robot.place
    radius2 = m.rules.sensing_radius**2
    for j in range(m.n_tasks):
        dx, dy = pois[j, 0] - x, pois[j, 1] - y
        if dx * dx + dy * dy <= radius2 or j == place:
            task = true_task(m, j)
            if task.released:
                learn_task(m, r, j, task.type, task.status, task.progress, float(now), 1)
