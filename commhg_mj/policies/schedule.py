"""The fixed communication schedule of every method that does not learn to communicate (docs/learning.md).

Broadcast every twenty seconds, telemetry as it falls due, a request for assistance when a robot works on a hard task, and a query
when a robot chooses a task that is far away, to the operator that was not heard of for longest.
"""

import numpy as np

from ..base.kernels import kernel
from ..base.terms import NOBODY, Activity

SERVICING = int(Activity.SERVICING)
BROADCAST_PERIOD = 20.0  # s
HARD = 0.6  # difficulty above which assistance is requested
REQUEST_PERIOD = 60.0  # s between requests for one task
FAR = 15.0  # s of way to a task: on a shorter one a reply comes too late to turn for it


@kernel
def follow_schedule(observations, decisions, asks):
    """Fill in the communication choices of all due robots, whose tasks are chosen; queries among them if it `asks`."""
    for i in range(observations.robots.shape[0]):
        robot = observations.robots[i]
        decisions.broadcast[i] = robot.can_broadcast and robot.since_broadcast >= BROADCAST_PERIOD
        is_asking = asks and goes_far(observations, decisions, i)
        decisions.query[i] = longest_unheard(observations.robot_operators[i]) if is_asking else NOBODY
        is_hard = robot.activity == SERVICING and observations.robot_tasks[i, robot.task].difficulty > HARD
        is_new = robot.since_request < 0.0 or robot.since_request >= REQUEST_PERIOD
        decisions.assist[i] = robot.can_assist and is_hard and is_new and decisions.query[i] == NOBODY


@kernel
def goes_far(observations, decisions, i):
    """Whether robot row i has just chosen another task, and one to which the way is long."""
    task = decisions.task[i]
    return task >= 0 and observations.robot_tasks[i, task].distance > FAR * observations.robots[i].speed


@kernel
def longest_unheard(operators):
    """The operator whose resource report is oldest, who was never heard of before all others; NOBODY where no query is open."""
    oldest, who = -1.0, NOBODY
    for h in range(operators.shape[0]):
        row = operators[h]
        age = row.age if row.age >= 0.0 else np.inf
        if row.legal and age > oldest:
            oldest, who = age, h
    return who
