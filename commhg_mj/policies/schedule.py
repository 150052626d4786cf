"""The fixed communication schedule of every method that does not learn to communicate (docs/learning.md).

Broadcast every ten seconds, telemetry as it falls due, no queries, and a request for assistance when a
robot works on a hard task.
"""

from ..base.kernels import kernel
from ..base.terms import NOBODY, Activity

SERVICING = int(Activity.SERVICING)
BROADCAST_PERIOD = 10.0  # s
HARD = 0.6  # difficulty above which assistance is requested
REQUEST_PERIOD = 60.0  # s between requests for one task


@kernel
def follow_schedule(observations, decisions):
    """Fill in the communication choices of all due robots."""
    for i in range(observations.robots.shape[0]):
        robot = observations.robots[i]
        decisions.broadcast[i] = robot.can_broadcast and robot.since_broadcast >= BROADCAST_PERIOD
        decisions.query[i] = NOBODY
        is_hard = robot.activity == SERVICING and observations.robot_tasks[i, robot.task].difficulty > HARD
        is_new = robot.since_request < 0.0 or robot.since_request >= REQUEST_PERIOD
        decisions.assist[i] = robot.can_assist and is_hard and is_new
