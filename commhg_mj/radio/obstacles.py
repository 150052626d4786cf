"""What the links of one world have to pass, as kernels read it."""

from typing import NamedTuple

import numpy as np

from ..models.layout import unit_frame
from ..models.rays import NO_RAYS, RAY
from ..models.world import World
from .link_models import LINK, RAY_MODELS, LinkModel, find_link_model
from .shadowing import draw_waves


class Obstacles(NamedTuple):
    """Footprints for planar links; canopies and mountains where rays are cast, without rows under other models."""

    frames: np.ndarray  # [parts, 6] footprints -> unit circle
    kinds: np.ndarray  # [parts] Footprint
    canopies: np.ndarray  # [n] models.rays.CANOPY
    mountains: np.ndarray  # [n] models.terrain.MOUNTAIN
    calls: np.ndarray  # [1] models.rays.CALLS
    waves: np.ndarray  # [waves, 3] of shadowing
    intervals: np.ndarray  # [2, parts] scratch of one link at a time
    ray: np.ndarray  # [1] models.rays.RAY, likewise
    link: np.ndarray  # [1] radio.rules.LINK, likewise


def make_obstacles(world: World, links: str) -> Obstacles:
    """What a link model meets in a world; `world` must outlive it, and its scratch is for one thread."""
    parts = world.layout.parts
    rays = world.rays.arrays if find_link_model(links) in (*RAY_MODELS, LinkModel.CUSTOM) else NO_RAYS
    return Obstacles(
        unit_frame(parts), np.ascontiguousarray(parts["kind"]), *rays, draw_waves(world.seed),
        np.empty((2, max(1, len(parts)))), np.zeros(1, RAY), np.zeros(1, LINK),
    )  # fmt: skip
