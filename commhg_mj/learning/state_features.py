"""Every feature of the true state by name, for the critic alone."""

from ..base.terms import Kind
from . import features
from .features import FLAG, LIMIT, SHARE, SIDE, SLACK, VALUE, Feature, Group


def true(name: str, meaning: str, scale: str, source: str) -> Feature:
    """A column of the critic's state."""
    return Feature(name, "truth", meaning, scale, source)


STATE_ROBOT = Group(
    "state: robot",
    true("is_ugv", "a ground robot", FLAG, "embodiment"),
    true("is_uav", "an aerial robot", FLAG, "embodiment"),
    true("x", "place, east", SIDE, "x"),
    true("y", "place, north", SIDE, "y"),
    true("failed", "broken", FLAG, "activity"),
    true("travelling", "on its way", FLAG, "activity"),
    true("servicing", "at work", FLAG, "activity"),
    true("handover", "control is being handed over", FLAG, "mode"),
    true("controlled", "under control", FLAG, "mode"),
    true("tokens", "bytes in its uplink bucket", "bucket", "tokens"),
    true("broadcast_tokens", "bytes in its bucket for broadcasts", "that bucket", "broadcast_tokens"),
    true("stand_left", "until it may choose a task again", "min(1, s / 60 s)", "stands_until mission.now"),
    true("since_broadcast", "since it spoke", "min(1, s / 60 s)", "last_broadcast mission.now"),
    true("prescribed", "the first target is still the initializer's", FLAG, "prescribed"),
    true("due", "it decides now", FLAG, "due"),
    true("lease_left", "until control ends", "lease", "controller lease_until mission.now"),
    true("has_task", "it has a task", FLAG, "task"),
    true("distance", "to its task, straight", SIDE, "x y task.x task.y"),
    true("progress", "of its task", SHARE, "task.progress"),
    true("difficulty", "of its task", SHARE, "task.difficulty"),
    true("value", "of its task", VALUE, "task.value"),
    true("expected_value", "of its attempt", VALUE, "task.value task.difficulty task.deadline task.decay mission.now"),
    true("seconds", "of its attempt", "200 s", "task.difficulty mode"),
    true("slack", "until its task's deadline", SLACK, "task.deadline mission.now"),
    true("incompatible", "its task is not for it", FLAG, "task.type embodiment"),
    true("is_sure", "it has evidence on its task", FLAG, "belief.time"),
    true("known_peers", "peers that it has heard of", SHARE, "peer.time"),
    true("peers_age", "mean over them of how new their reports are", "exp(-s / 200 s)", "peer.time mission.now"),
    true("wrong_peers", "peers that have another task by now than it knows", SHARE, "peer.task task"),
    true("wrong_tasks", "open tasks that it takes for another status", SHARE, "belief.status task.status"),
    true("station_age", "how new the station's report of it is", "exp(-s / 200 s)", "peer.time mission.now"),
    true("station_error", "how far from it the station thinks it is", SIDE, "peer.x peer.y x y"),
    true("query_waits", "a query is queued", FLAG, "waiting.since"),
    true("request_waits", "a request is queued", FLAG, "waiting.since"),
    true("telemetry_waits", "a report is queued", FLAG, "waiting.since"),
    true("best_way", "to the nearest open task that nobody has, by road on the ground", SIDE, "task.x task.y task.owner place"),
    true("choices", "open tasks that nobody has and it can do", "tanh(n / 4)", "task.owner task.type"),
)

STATE_OPERATOR = Group(
    "state: operator",
    true("uav_proficiency", "with aerial robots", SHARE, "proficiency"),
    true("ugv_proficiency", "with ground robots", SHARE, "proficiency"),
    true("capacity", "against fatigue", "1", "capacity"),
    true("fatigue", "fatigue", SHARE, "fatigue"),
    true("bidding", "it bids for a robot", FLAG, "session"),
    true("holding", "it holds a robot", FLAG, "session"),
    true("tokens", "bytes in its downlink bucket", "bucket", "tokens"),
    true("exempt", "a change costs nothing now", FLAG, "exempt"),
    true("robot_is_ugv", "its robot is a ground robot", FLAG, "robot robot.embodiment"),
    true("robot_servicing", "its robot is at work", FLAG, "robot robot.activity"),
    true("robot_difficulty", "of its robot's task", SHARE, "robot robot.task task.difficulty"),
    true("robot_way", "from its robot to that one's task", SIDE, "robot robot.x robot.y task.x task.y"),
    true("robot_value", "of its robot's task", VALUE, "robot robot.task task.value"),
    true("robot_due", "until its robot's task is", SLACK, "robot robot.task task.deadline mission.now"),
    true("report_age", "how new the station's report of that robot is", "exp(-s / 200 s)", "robot peer.time mission.now"),
    true("has_control", "that robot obeys it", FLAG, "robot robot.controller"),
    true("queue", "messages that wait in its downlink", "tanh(n / 4)", "waiting.since"),
    true("requests", "robots that the station knows to have asked for help", SHARE, "peer.request_time"),
)

STATE_TASK = Group(
    "state: task",
    true("x", "place, east", SIDE, "x"),
    true("y", "place, north", SIDE, "y"),
    true("difficulty", "difficulty", SHARE, "difficulty"),
    true("value", "value", VALUE, "value"),
    true("slack", "until the deadline", SLACK, "deadline mission.now"),
    true("is_late", "after the deadline", FLAG, "deadline mission.now"),
    true("value_now", "what is left of the value", VALUE, "value deadline decay mission.now"),
    true("decay", "seconds of decay after the deadline", "longest decay", "decay"),
    true("uav_only", "type", FLAG, "type"),
    true("ugv_only", "type", FLAG, "type"),
    true("general", "type", FLAG, "type"),
    true("serviced", "somebody is at work there", FLAG, "status"),
    true("progress", "progress", SHARE, "progress"),
    true("owned", "a robot has it", FLAG, "owner"),
    true("since_release", "since it was announced", "exp(-s / 200 s)", "release mission.now"),
)

STATE_MISSION = Group(
    "state: mission",
    true("time", "since the start", LIMIT, "now"),
    true("time_left", "until the end", "exp(-s / 200 s)", "now"),
    true("pending", "value that is not done yet", "total value", "pending_value total_value"),
    true("flying", "messages under way", "64", "flying"),
    *(true(f"flying_{kind.name.lower()}", "of that kind under way", "16", "message.kind") for kind in Kind),
)

GROUPS = STATE_ROBOT, STATE_OPERATOR, STATE_TASK, STATE_MISSION
ALL_GROUPS = features.GROUPS + GROUPS
