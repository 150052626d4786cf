"""Link models behind one interface: what share of packets does terrain let pass between two radios?

The mission asks only when a message is sent. Loss and delay over clear ground belong to the limitation
level and are the same for every model, so that models differ by obstacles alone (design: radio.md).
"""

from enum import IntEnum

from ..kernels import kernel
from ..models.routes import distance
from .abstract import planar_clearance


class LinkModel(IntEnum):
    ABSTRACT = 0  # planar, the paper's
    PERFECT = 1  # free communication, for the omniscient reference


LINK_MODELS = {"abstract": LinkModel.ABSTRACT, "perfect": LinkModel.PERFECT}

ABSTRACT, PERFECT = int(LinkModel.ABSTRACT), int(LinkModel.PERFECT)


def find_link_model(name: str) -> LinkModel:
    """The link model of that name.

    Raises:
      ValueError: there is none.
    """
    if not isinstance(name, str) or name not in LINK_MODELS:
        raise ValueError(f"unknown link model {name!r}: use {', '.join(LINK_MODELS)}")
    return LINK_MODELS[name]


@kernel
def robot_link(rules, frames, kinds, scratch, ax, ay, bx, by):
    """Robot-robot link: the share of packets that passes terrain, 0 beyond the range.

    Args:
      rules: RULES record of the mission (link model, range and decay lengths in m).
      frames, kinds, scratch: footprints, see `metres_inside`.
    """
    if rules.link_model == PERFECT:
        return 1.0
    if distance(bx - ax, by - ay) > rules.range:
        return 0.0
    return planar_clearance(frames, kinds, rules.forest_decay, rules.mountain_decay, ax, ay, bx, by, scratch)


@kernel
def station_link(rules):
    """Robot-station link: as in the paper, without a range and without a terrain term."""
    return 1.0
