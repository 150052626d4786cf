"""The links of one mission, asked when a message is sent."""

from ..base.kernels import kernel
from ..radio.links import SILENT, is_in_range, is_spatial, mast_antenna, passing_share, robot_antenna
from .accessors import obstacles_of, true_robot


@kernel
def radio_of(m, r):
    """The robot whose links robot r has: itself, but for the control with shuffled identities."""
    return true_robot(m, true_robot(m, r).radio_of)


@kernel
def link_between(m, a, b, kind):
    """Share of messages of a kind that terrain lets pass between robots a and b now; 0 beyond the range."""
    radio, one, other = m.rules.radio, radio_of(m, a), radio_of(m, b)
    if not is_in_range(radio, other.x - one.x, other.y - one.y):
        return 0.0
    obstacles = obstacles_of(m)
    start = robot_antenna(radio, obstacles, one.embodiment, one.x, one.y)
    end = robot_antenna(radio, obstacles, other.embodiment, other.x, other.y)
    return passing_share(radio, obstacles, start, end, float(m.rules.message_bytes[kind]))


@kernel
def link_to_station(m, r, kind):
    """Share of messages of a kind that terrain lets pass between robot r and the station now.

    There is no range; as in the paper, planar models give these links no terrain either.
    """
    radio = m.rules.radio
    if not is_spatial(radio):
        return 0.0 if radio.link_model == SILENT else 1.0
    robot, obstacles = radio_of(m, r), obstacles_of(m)
    start = robot_antenna(radio, obstacles, robot.embodiment, robot.x, robot.y)
    mast = mast_antenna(radio, obstacles, m.station_x, m.station_y)
    return passing_share(radio, obstacles, start, mast, float(m.rules.message_bytes[kind]))
