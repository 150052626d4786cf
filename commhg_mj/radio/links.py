"""Every link model behind one interface: what share of packets passes, and when do they arrive?

The mission asks only when a message is sent. Loss and delay over clear ground belong to the limitation
level and are the same for every model, so that models differ by obstacles alone (docs/radio.md).
"""

from ..base.elementary_functions import distance
from ..base.kernels import kernel
from ..base.terms import Embodiment
from ..models.terrain import floor_at, ground_at
from .abstract import measure_planar
from .custom import ask
from .link_models import LinkModel
from .raycast import measure_rays

UAV = int(Embodiment.UAV)
PERFECT, KNOWN, SILENT = int(LinkModel.PERFECT), int(LinkModel.KNOWN), int(LinkModel.SILENT)
RAYCAST, RAYCAST_SHUFFLED, CUSTOM = int(LinkModel.RAYCAST), int(LinkModel.RAYCAST_SHUFFLED), int(LinkModel.CUSTOM)


@kernel
def is_spatial(radio):
    """Whether rays are cast through the 3D world, for links to the station, too."""
    return radio.link_model == RAYCAST or radio.link_model == RAYCAST_SHUFFLED or radio.link_model == CUSTOM


@kernel
def is_ideal(radio):
    """Whether everything passes in time, and buckets are full in every second."""
    return radio.link_model == PERFECT or radio.link_model == KNOWN


@kernel
def robot_antenna(radio, obstacles, embodiment, x, y):
    """(x, y, z) [m] of the antenna of a robot at a place on the map."""
    base = floor_at(obstacles.mountains, x, y) if embodiment == UAV else ground_at(obstacles.mountains, x, y)
    return x, y, base + radio.antenna[embodiment]


@kernel
def mast_antenna(radio, obstacles, x, y):
    """(x, y, z) [m] of the station's antenna."""
    return x, y, ground_at(obstacles.mountains, x, y) + radio.mast


@kernel
def is_in_range(radio, dx, dy):
    """Whether two robots, (dx, dy) metres apart in plan, may hear each other at all."""
    return distance(dx, dy) <= radio.range


@kernel
def measure(radio, obstacles, a, b, size, link):
    """Fill in a LINK with what its model sees of the world between two antennas, whatever the range."""
    if is_spatial(radio):
        measure_rays(radio, obstacles, a, b, size, link)
        if radio.link_model == CUSTOM:
            ask(radio, obstacles, a, b, size, link)
    elif is_ideal(radio) or radio.link_model == SILENT:
        link.passing = 1.0 if is_ideal(radio) else 0.0
    else:
        measure_planar(radio, obstacles, a, b, link)


@kernel
def passing_share(radio, obstacles, a, b, size):
    """The share of packets of `size` [B] that terrain lets pass between two antennas, whatever the range.

    Args:
      radio: RADIO record.
      obstacles: of the world (radio/obstacles.py).
      a, b: antennas (x, y, z) [m].
    """
    link = obstacles.link[0]
    measure(radio, obstacles, a, b, size, link)
    return link.passing


@kernel
def fates(radio, passing):
    """(share in time, share late) of messages on a link that lets `passing` of the packets pass.

    Over clear ground a share `on_time` arrives in time, and half of the rest late; terrain scales both, under every model.
    """
    return radio.on_time * passing, 0.5 * (1.0 - radio.on_time) * passing
