"""Every link model behind one interface: what share of packets passes, and when do they arrive?

The mission asks only when a message is sent. Loss and delay over clear ground belong to the limitation
level and are the same for every model, so that models differ by obstacles alone (design: radio.md).
"""

from ..kernels import kernel
from ..models.routes import distance
from ..models.terrain import ground_at
from .abstract import measure_planar
from .raycast import measure_rays
from .rules import LinkModel

PERFECT, RAYCAST, RAYCAST_SHUFFLED = (
    int(LinkModel.PERFECT), int(LinkModel.RAYCAST), int(LinkModel.RAYCAST_SHUFFLED),
)  # fmt: skip


@kernel
def is_raycast(radio):
    return radio.link_model == RAYCAST or radio.link_model == RAYCAST_SHUFFLED


@kernel
def robot_antenna(radio, obstacles, embodiment, x, y):
    """(x, y, z) [m] of the antenna of a robot at a place on the map."""
    return x, y, ground_at(obstacles.mountains, x, y) + radio.antenna[embodiment]


@kernel
def mast_antenna(radio, obstacles, x, y):
    """(x, y, z) [m] of the station's antenna."""
    return x, y, ground_at(obstacles.mountains, x, y) + radio.mast


@kernel
def is_in_range(radio, a, b):
    """Whether two robots may hear each other at all."""
    return distance(b[0] - a[0], b[1] - a[1]) <= radio.range


@kernel
def measure(radio, obstacles, a, b, size, link):
    """Fill in a LINK with what its model sees of the world between two antennas, whatever the range."""
    if is_raycast(radio):
        measure_rays(radio, obstacles, a, b, size, link)
    elif radio.link_model == PERFECT:
        link.passing = 1.0
    else:
        measure_planar(radio, obstacles, a, b, link)


@kernel
def robot_link(radio, obstacles, a, b, size):
    """Robot-robot link: the share of packets of `size` [B] that passes terrain, 0 beyond the range.

    Args:
      radio: RADIO record.
      obstacles: of the world (radio/obstacles.py).
      a, b: antennas (x, y, z) [m].
    """
    if not is_in_range(radio, a, b):
        return 0.0
    link = obstacles.link[0]
    measure(radio, obstacles, a, b, size, link)
    return link.passing


@kernel
def station_link(radio, obstacles, a, mast, size):
    """Robot-station link, without a range; as in the paper, planar models give it no terrain either."""
    if not is_raycast(radio):
        return 1.0
    link = obstacles.link[0]
    measure_rays(radio, obstacles, a, mast, size, link)
    return link.passing


@kernel
def fates(radio, passing):
    """(share in time, share late) of messages on a link that lets `passing` of the packets pass.

    Over clear ground a share `on_time` arrives in time, and half of the rest late. A planar model scales both; a
    ray-cast link tries once more, and that attempt too has to pass.
    """
    if is_raycast(radio):
        on_time = radio.on_time * passing
        return on_time, 0.5 * (1.0 - on_time) * passing
    return radio.on_time * passing, 0.5 * (1.0 - radio.on_time) * passing
