"""Every feature of the graphs by name, once: columns, records of kernels, docs/features.md. The critic's: state_features.py.

A group's records and its table [.., width] are one memory: kernels write `out.progress`, networks read columns.
"""

from typing import NamedTuple

import numpy as np

from ..base.kernels import record

KINDS = {
    "own": "the actor's own state",
    "public": "known to all",
    "belief": "what a delivered report or the actor's senses say of others and of tasks",
    "known": "whether there is such a record at all",
    "age": "how old a record's evidence is",
    "availability": "whether a channel or a human has room",
    "mask": "what may be chosen",
    "estimate": "worked out from the others",
    "plan": "the planner's numbers, worked out from records, claims and their ages",
    "truth": "the true state, for the critic alone",
}
FLAG, SIDE, LIMIT, VALUE, SHARE = "0 or 1", "map side", "time limit", "largest value", "0..1"
SLACK = "tanh(s / 200 s)"
SHORT, LONG = 30.0, 200.0  # s: ages enter as exp(-age / each)


class Feature(NamedTuple):
    """One column."""

    name: str
    kind: str  # of KINDS
    meaning: str
    scale: str  # unit or bounded transform
    source: str  # columns of the row that it is read from; another row's have its name before them


class Group:
    """The features of one kind of node or edge, in the order of their columns.

    Args:
      title: what the rows are, for the docs.
      features: as `Feature`; a list of them, such as `age` makes, stands for each of its members.
    """

    def __init__(self, title: str, *features):
        rows = [row for item in features for row in (item if isinstance(item, list) else [item])]
        self.title, self.features = title, [Feature(*row) for row in rows]
        self.names = [feature.name for feature in self.features]
        self.dtype, self.width = record(**dict.fromkeys(self.names, "f4")), len(self.names)

    def index(self, name: str) -> int:
        """The column of that name.

        Raises:
          ValueError: there is none; the message names it.
        """
        if name not in self.names:
            raise ValueError(f"features of {self.title}: there is no {name!r}")
        return self.names.index(name)

    def columns(self, *which: str) -> list[int]:
        """The columns of features by name, and of whole kinds, each once and in that order.

        Raises:
          ValueError: a word is neither; the message names it.
        """
        found = []
        for word in which:
            of_kind = [i for i, feature in enumerate(self.features) if feature.kind == word]
            found += of_kind if word in KINDS else [self.index(word)]
        return list(dict.fromkeys(found))

    def zeros(self, *shape: int) -> np.ndarray:
        """Records of zeros for kernels to fill in."""
        return np.zeros(shape, self.dtype)


def columns_of(records: np.ndarray) -> np.ndarray:
    """[..., width] f4 of a group's records [...], in the same memory."""
    return records.view(np.float32).reshape(*records.shape, len(records.dtype.names))


def age(name: str, meaning: str, source: str, kinds=("known", "age")) -> list[Feature]:
    """The three columns of an age; all 0 where it is unknown (`graphs.age_features` makes them)."""
    known, old = kinds
    return [
        Feature(f"{name}_known", known, f"{meaning}: known", FLAG, source),
        Feature(f"{name}_short", old, meaning, "exp(-s / 30 s)", source),
        Feature(f"{name}_long", old, meaning, "exp(-s / 200 s)", source),
    ]


OWN_TIMER = ("own", "own")  # seconds by the actor's own clock: nobody's report
ROBOT = Group(
    "robot",
    ("is_ugv", "own", "a ground robot", FLAG, "embodiment"),
    ("is_uav", "own", "an aerial robot", FLAG, "embodiment"),
    ("x", "own", "place, east", SIDE, "x"),
    ("y", "own", "place, north", SIDE, "y"),
    ("travelling", "own", "on its way", FLAG, "activity"),
    ("servicing", "own", "at work", FLAG, "activity"),
    ("handover", "own", "control is being handed over", FLAG, "mode"),
    ("controlled", "own", "under control", FLAG, "mode"),
    ("speed", "own", "present speed", "fastest speed", "speed"),
    ("has_task", "own", "it has a task", FLAG, "task"),
    ("progress", "own", "of its task, as it knows", SHARE, "progress"),
    ("lease_left", "own", "until control ends", "lease", "lease_left"),
    ("handover_left", "own", "until control begins", "handover", "handover_left"),
    ("stand_left", "own", "until it may choose a task again", "min(1, s / 60 s)", "stand_left"),
    ("tokens", "availability", "bytes in its uplink bucket", "bucket", "tokens"),
    ("broadcast_tokens", "availability", "bytes in its bucket for broadcasts", "that bucket", "broadcast_tokens"),
    ("since_broadcast", "own", "since it spoke", "min(1, s / 60 s)", "since_broadcast"),
    age("since_request", "since it asked for help", "since_request", OWN_TIMER),
    ("query_waits", "availability", "a query is queued", FLAG, "query_waits"),
    ("request_waits", "availability", "a request is queued", FLAG, "request_waits"),
    ("prescribed", "mask", "the first target is still the initializer's", FLAG, "prescribed"),
    ("can_keep", "mask", "KEEP is open", FLAG, "can_keep"),
    ("can_broadcast", "mask", "a broadcast is open", FLAG, "can_broadcast"),
    ("can_assist", "mask", "a request is open", FLAG, "can_assist"),
    ("time", "public", "since the start", LIMIT, "time"),
    ("time_left", "public", "until the end", "exp(-s / 200 s)", "time"),
)

PUBLIC = Group(
    "task, public",
    ("x", "public", "place, east", SIDE, "x"),
    ("y", "public", "place, north", SIDE, "y"),
    ("difficulty", "public", "difficulty", SHARE, "difficulty"),
    ("value", "public", "value", VALUE, "value"),
    ("deadline", "public", "deadline", LIMIT, "deadline"),
    ("decay", "public", "seconds of decay after it", "longest decay", "decay"),
)

ATTEMPT = "distance robot.speed difficulty deadline decay robot.time"
TASK_EDGE = Group(
    "task to robot",
    ("distance", "estimate", "way to go", SIDE, "distance"),
    ("dx", "estimate", "where it lies, east", SIDE, "x robot.x"),
    ("dy", "estimate", "where it lies, north", SIDE, "y robot.y"),
    ("seconds", "estimate", "of the next attempt: way and service", "200 s", "distance robot.speed difficulty"),
    ("expected_value", "estimate", "of the next attempt", VALUE, f"value {ATTEMPT}"),
    ("value_rate", "estimate", "the same per minute of it", VALUE, f"value {ATTEMPT}"),
    ("slack", "estimate", "from arrival to deadline", SLACK, "deadline distance robot.speed robot.time"),
    ("is_late", "estimate", "arrival after the deadline", FLAG, "deadline distance robot.speed robot.time"),
    ("time_after", "estimate", "from the attempt to the end", LIMIT, "distance robot.speed difficulty robot.time"),
    ("uav_only", "belief", "type", FLAG, "type"),
    ("ugv_only", "belief", "type", FLAG, "type"),
    ("general", "belief", "type", FLAG, "type"),
    ("serviced", "belief", "somebody is at work there", FLAG, "status"),
    ("progress", "belief", "progress", SHARE, "progress"),
    age("age", "evidence on it", "age"),
    ("refused", "belief", "the resolver refused a claim a moment ago", FLAG, "refused"),
    ("is_held", "own", "the robot's own task", FLAG, "robot.task"),
    age("claim", "report of a peer on its way there", "claimed_by claim_age"),
)

def planned(name: str, meaning: str, scale: str) -> Feature:
    """A column of the planner's numbers, which are made of all that a robot knows (policies/planner.py)."""
    return Feature(name, "plan", meaning, scale, "all that the robot knows")


BEST = "the row's best worth, at most 3"
PLAN = Group(
    "plan",
    planned("idles", "no task falls to the robot", FLAG),
    planned("keeps", "its own task does", FLAG),
    planned("is_news", "it is not what the robot told last", FLAG),
    planned("seconds", "way to the task that falls to it", "min(1, s / 200 s)"),
    planned("best_worth", "value a minute of the best task", VALUE),
    planned("backlog", "until the team comes round to a task", "200 s"),
    planned("peers", "members of the team that it knows", SHARE),
)

PLAN_EDGE = Group(
    "plan for a task",
    planned("is_pick", "it falls to the robot", FLAG),
    planned("is_candidate", "it does, or is its own, or one of the two others that cost the team least", FLAG),
    planned("reduced_cost", "what the team loses if the robot takes it", BEST),
    planned("worth", "to the robot", BEST),
    planned("worth_helped", "value a minute that is saved by going now, with an operator's help", VALUE),
    planned("worth_alone", "the same without", VALUE),
    planned("seconds_helped", "until it is done, with help", "200 s, at most 3"),
    planned("seconds_alone", "until it is done, without", "200 s, at most 3"),
    planned("success", "chance of an attempt alone", SHARE),
    planned("timely", "what is left of the value then", SHARE),
    planned("timely_later", "what is left after the backlog", SHARE),
    planned("slack", "from then to the deadline", "tanh(s / 100 s)"),
    planned("time_left", "from then to the end, less than 200 s", "1 - s / 200 s"),
    planned("others_worth", "to the peer that wants it most", BEST),
    planned("rank", "peers to whom it is worth more", SHARE),
    planned("is_others", "it falls to a peer", FLAG),
    planned("taken", "another is known to have taken it", "exp(-s / 60 s)"),
    planned("price", "what the team would pay for it", BEST),
    planned("nearby", "value of tasks near it, by 20 s of way", "4"),
)

PEER = Group(
    "peer to robot",
    ("is_ugv", "public", "a ground robot", FLAG, "embodiment"),
    ("is_uav", "public", "an aerial robot", FLAG, "embodiment"),
    ("dx", "belief", "where it was, east", SIDE, "x robot.x"),
    ("dy", "belief", "where it was, north", SIDE, "y robot.y"),
    ("distance", "belief", "how far that is", SIDE, "x y robot.x robot.y"),
    ("idle", "belief", "it idled", FLAG, "activity"),
    ("travelling", "belief", "it was on its way", FLAG, "activity"),
    ("servicing", "belief", "it was at work", FLAG, "activity"),
    ("handover", "belief", "control was being handed over", FLAG, "mode"),
    ("controlled", "belief", "it was under control", FLAG, "mode"),
    ("has_task", "belief", "it had a task", FLAG, "task"),
    ("same_task", "belief", "it had the robot's own", FLAG, "task robot.task"),
    ("has_controller", "belief", "an operator had it", FLAG, "controller"),
    age("age", "its report", "age"),
)

PAST = Group(
    "earlier report",
    ("exists", "known", "there is one", FLAG, "age"),
    ("x", "belief", "where it was, east", SIDE, "x"),
    ("y", "belief", "where it was, north", SIDE, "y"),
    ("travelling", "belief", "it was on its way", FLAG, "activity"),
    ("servicing", "belief", "it was at work", FLAG, "activity"),
    ("controlled", "belief", "it was under control", FLAG, "mode"),
    ("has_task", "belief", "it had a task", FLAG, "task"),
    ("since", "age", "since then", "exp(-s / 200 s)", "age"),
)

RESOURCE = Group(
    "operator to robot",
    age("age", "its reply", "age"),
    ("tokens", "availability", "bytes in its downlink bucket", "bucket", "tokens"),
    ("queue", "availability", "messages that wait there", "tanh(n / 4)", "queue"),
    ("bidding", "availability", "it bid for a robot", FLAG, "session"),
    ("holding", "availability", "it held a robot", FLAG, "session"),
    ("has_me", "availability", "the robot itself", FLAG, "robot robot.robot"),
    ("fatigue_class", "availability", "fresh, tiring, tired", "0, 0.5, 1", "fatigue_class"),
    ("controls_me", "own", "it is the robot's controller", FLAG, "robot.controller"),
)

OPERATOR = Group(
    "operator",
    ("uav_proficiency", "own", "with aerial robots", SHARE, "proficiency"),
    ("ugv_proficiency", "own", "with ground robots", SHARE, "proficiency"),
    ("capacity", "own", "against fatigue", "1", "capacity"),
    ("fatigue", "own", "fatigue", SHARE, "fatigue"),
    ("bidding", "own", "it bids for a robot", FLAG, "session"),
    ("holding", "own", "it holds a robot", FLAG, "session"),
    ("lease_left", "own", "until control ends", "lease, from -1", "lease_left"),
    age("since_bid", "since it bid", "since_bid", OWN_TIMER),
    ("tokens", "availability", "bytes in its downlink bucket", "bucket", "tokens"),
    ("exempt", "own", "a change costs nothing now", FLAG, "exempt"),
    ("time", "public", "since the start", LIMIT, "time"),
    ("time_left", "public", "until the end", "exp(-s / 200 s)", "time"),
    ("queue", "availability", "messages that wait in its downlink", "tanh(n / 4)", "queue"),
)

GAIN = "operator.proficiency operator.fatigue embodiment distance progress difficulty value deadline decay operator.time"
REPORT = Group(
    "report to operator",
    ("is_ugv", "public", "a ground robot", FLAG, "embodiment"),
    ("is_uav", "public", "an aerial robot", FLAG, "embodiment"),
    ("idle", "belief", "it idled", FLAG, "activity"),
    ("travelling", "belief", "it was on its way", FLAG, "activity"),
    ("servicing", "belief", "it was at work", FLAG, "activity"),
    ("handover", "belief", "control was being handed over", FLAG, "mode"),
    ("controlled", "belief", "it was under control", FLAG, "mode"),
    ("by_another", "belief", "another operator had it", FLAG, "controller operator.operator"),
    ("by_me", "belief", "this operator had it", FLAG, "controller operator.operator"),
    ("x", "belief", "where it was, east", SIDE, "x"),
    ("y", "belief", "where it was, north", SIDE, "y"),
    age("age", "its report", "age"),
    age("request", "its request for help", "request_age"),
    ("is_held", "own", "the robot of the operator's session", FLAG, "operator.robot"),
    ("has_task", "belief", "it had a task", FLAG, "task"),
    ("progress", "belief", "of the task, as the robot knew", SHARE, "task progress"),
    ("difficulty", "public", "the task's", SHARE, "task difficulty"),
    ("value", "public", "the task's", VALUE, "task value"),
    ("slack", "public", "until the task's deadline", SLACK, "task deadline operator.time"),
    ("distance", "estimate", "from where it was to the task", SIDE, "task distance"),
    ("gain", "estimate", "what control would add per minute", "tanh(value)", f"task {GAIN}"),
    ("uav_only", "belief", "the task's type, as the station knows", FLAG, "task task_type"),
    ("ugv_only", "belief", "the task's type, as the station knows", FLAG, "task task_type"),
    ("general", "belief", "the task's type, as the station knows", FLAG, "task task_type"),
    ("compatible", "belief", "that type is for this robot", FLAG, "task compatible"),
    ("task_serviced", "belief", "the station knows of work on the task", FLAG, "task task_status"),
    ("task_done", "belief", "the station knows that the task is done", FLAG, "task task_status"),
    ("task_progress", "belief", "of the task, as the station knows", SHARE, "task task_progress"),
    age("task", "the station's evidence on the task", "task task_age"),
)


GROUPS = ROBOT, PUBLIC, TASK_EDGE, PLAN, PLAN_EDGE, PEER, PAST, RESOURCE, OPERATOR, REPORT  # what actors read
