"""The fixed communication schedule of every method that does not learn to communicate (docs/learning.md).

Broadcast every ten seconds, telemetry as it falls due, a request for assistance when a robot works on a hard task, and a query
at every decision outside service, to the operator that was not heard of for longest.
"""

import numpy as np

from ..base.kernels import kernel
from ..base.terms import NOBODY, Activity

SERVICING = int(Activity.SERVICING)
BROADCAST_PERIOD = 10.0  # s
HARD = 0.6  # difficulty above which assistance is requested
REQUEST_PERIOD = 60.0  # s between requests for one task


@kernel
def follow_schedule(observations, decisions, asks):
    """Fill in the communication choices of all due robots, queries among them if it `asks`."""
    for i in range(observations.robots.shape[0]):
        robot = observations.robots[i]
        decisions.broadcast[i] = robot.can_broadcast and robot.since_broadcast >= BROADCAST_PERIOD
        is_hard = robot.activity == SERVICING and observations.robot_tasks[i, robot.task].difficulty > HARD
        is_new = robot.since_request < 0.0 or robot.since_request >= REQUEST_PERIOD
        decisions.assist[i] = robot.can_assist and is_hard and is_new
        # At work a robot asks for help, not for news: what it does next is not open.
        is_asking = asks and robot.activity != SERVICING
        decisions.query[i] = longest_unheard(observations.robot_operators[i]) if is_asking else NOBODY


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
