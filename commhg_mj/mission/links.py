"""The links of one mission, asked when a message is sent."""

from ..kernels import kernel
from ..radio.links import robot_link, station_link
from .access import footprint_kinds, footprints, intervals, robot_of


@kernel
def link_between(m, a, b):
    """Share of packets that terrain lets pass between robots a and b now; 0 beyond the range."""
    one, other = robot_of(m, a), robot_of(m, b)
    return robot_link(m.rules, footprints(m), footprint_kinds(m), intervals(m), one.x, one.y, other.x, other.y)


@kernel
def link_to_station(m, r):
    """Share of packets that terrain lets pass between robot r and the station now."""
    return station_link(m.rules)
