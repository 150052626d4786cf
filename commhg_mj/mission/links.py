"""The links of one mission, asked when a message is sent."""

from ..kernels import kernel
from ..radio.links import mast_antenna, robot_antenna, robot_link, station_link
from .access import obstacles_of, robot_of


@kernel
def antenna_of(m, r, obstacles):
    """Where the antenna is (x, y, z) whose links robot r has: its own, but for the control with shuffled identities."""
    robot = robot_of(m, robot_of(m, r).radio_of)
    return robot_antenna(m.rules.radio, obstacles, robot.embodiment, robot.x, robot.y)


@kernel
def link_between(m, a, b, kind):
    """Share of messages of a kind that terrain lets pass between robots a and b now; 0 beyond the range."""
    obstacles = obstacles_of(m)
    size = float(m.rules.message_bytes[kind])
    return robot_link(m.rules.radio, obstacles, antenna_of(m, a, obstacles), antenna_of(m, b, obstacles), size)


@kernel
def link_to_station(m, r, kind):
    """Share of messages of a kind that terrain lets pass between robot r and the station now."""
    obstacles = obstacles_of(m)
    mast = mast_antenna(m.rules.radio, obstacles, m.station_x, m.station_y)
    return station_link(m.rules.radio, obstacles, antenna_of(m, r, obstacles), mast, float(m.rules.message_bytes[kind]))
