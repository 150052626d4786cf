"""The mission's vocabulary: small integers that states, records and traces share."""

from enum import IntEnum


class Embodiment(IntEnum):
    UAV = 0
    UGV = 1


class TaskType(IntEnum):
    """Which embodiment may service a task (paper, section IV-A)."""

    UAV_ONLY = 0
    UGV_ONLY = 1
    GENERAL = 2


class Activity(IntEnum):
    IDLE = 0
    TRAVELLING = 1
    SERVICING = 2
    FAILED = 3


class Mode(IntEnum):
    AUTONOMOUS = 0
    HANDOVER = 1
    CONTROLLED = 2


class Session(IntEnum):
    """What an operator is doing, as far as it knows: resting, waiting for its command's effect, or holding a robot."""

    REST = 0
    BID = 1
    HELD = 2


class Status(IntEnum):
    """State of a task; records hold the same values."""

    OPEN = 0
    SERVICED = 1
    DONE = 2


class Kind(IntEnum):
    """Message kinds. BROADCAST is robot-robot, the next three climb the uplink, the last four the downlink."""

    BROADCAST = 0
    TELEMETRY = 1
    QUERY = 2
    REQUEST = 3
    CONTROL = 4
    RENEWAL = 5
    REPLY = 6
    RELEASE = 7


ROUTES = {  # name: message kinds
    "robots": (Kind.BROADCAST,),
    "uplink": (Kind.TELEMETRY, Kind.QUERY, Kind.REQUEST),
    "downlink": (Kind.CONTROL, Kind.RENEWAL, Kind.RELEASE, Kind.REPLY),
}


class Fate(IntEnum):
    """Every message ends in exactly one of these."""

    UNDERWAY = 0  # still queued or in the air when the mission ended
    DELIVERED = 1
    OUT_OF_RANGE = 2
    TERRAIN = 3  # lost, and would have arrived over clear ground
    LOST = 4  # lost by the limitation level alone, or to a receiver that failed
    NO_TOKENS = 5  # displaced or superseded while it waited for tokens
    EXPIRED = 6  # its time to live ran out in a queue


class Footprint(IntEnum):
    """What an obstacle part is."""

    FOREST = 0
    MOUNTAIN = 1


# Choices of a decision that are not the index of a task, a robot or an operator.
KEEP = -1
IDLE = -2  # a robot drops its task
REST = -2  # an operator drops its robot
NOBODY = -1  # no query; also "none" wherever an index is stored
