"""Links asked from Python: the kernels that decide a mission's messages, over arrays of places."""

import numpy as np

from ..base.arguments import instance, numbers, positive, said
from ..base.kernels import kernel
from ..base.terms import Embodiment
from ..models.world import World
from .link_models import LINK, radio_rules
from .links import fates, is_in_range, is_spatial, measure
from .obstacles import make_obstacles


class WorldLinks:
    """The links of one world under one link model and one limitation level.

    Antennas are arrays [n, 3] of x, y, z in metres; results are LINK records [n] (radio/link_models.py).

    Raises:
      ValueError: unknown link model or limitation.
    """

    def __init__(self, world: World, links="raycast", limitation="nominal"):
        self.world = instance("world", world, World)  # keeps the ray model alive
        self.links, self.limitation = links, limitation
        self.rules = radio_rules(world.scenario, links, limitation)
        self.obstacles = make_obstacles(world, links)

    def __reduce__(self):
        """Copies and other processes look up addresses of their own."""
        return type(self), (self.world, self.links, self.limitation)

    def between(self, a, b, size) -> np.ndarray:
        """Robot-robot links from antennas a to b (one may be [1, 3]) for messages of `size` [B]."""
        a, b = numbers("a", a, None, 3), numbers("b", b, None, 3)
        if len(a) != len(b) and 1 not in (len(a), len(b)):
            raise ValueError(f"a and b must be as many antennas, or one of them, are {len(a)} and {len(b)}")
        return self._measure(a, b, positive("size", size), True)

    def to_station(self, a, size) -> np.ndarray:
        """Links from antennas to the station's mast, or back, for messages of `size` [B]."""
        return self._measure(numbers("a", a, None, 3), self.mast[None], positive("size", size), False)

    def antennas(self, xy, height) -> np.ndarray:
        """[n, 3] antennas at xy [n, 2], so many metres above the ground there, one height or [n]."""
        xy = numbers("xy", xy, None, 2)
        heights = numbers("height", height, *(() if np.isscalar(height) else (len(xy),)))
        if (heights < 0).any():
            raise ValueError(f"height must not lie below the ground, is {said(height)}")
        return np.c_[xy, self.world.layout.ground_height(xy) + heights]

    def robot_antennas(self, xy, embodiment) -> np.ndarray:
        """[n, 3] antennas of robots at xy [n, 2], of one embodiment or of [n] ones."""
        xy, kinds, layout = numbers("xy", xy, None, 2), np.asarray(embodiment), self.world.layout
        if kinds.dtype.kind not in "iu" or not np.isin(kinds, list(Embodiment)).all():
            raise ValueError(f"embodiment must be 0 (UAV) or 1 (UGV), or one a robot, is {said(embodiment)}")
        base = np.where(kinds == Embodiment.UAV, layout.flight_floor(xy), layout.ground_height(xy))
        return np.c_[xy, base + self.rules["antenna"][kinds]]

    @property
    def mast(self) -> np.ndarray:
        """[3] the station's antenna."""
        return self.antennas(self.world.layout.station[None], self.rules["mast"])[0]

    def _measure(self, a, b, size, is_robot_link):
        a, b = np.broadcast_arrays(a, b)
        links = np.zeros(len(a), LINK)
        for name in LINK.names or ():
            links[name] = np.nan
        ends = np.ascontiguousarray(a), np.ascontiguousarray(b)
        measure_links(self.rules, self.obstacles, *ends, float(size), is_robot_link, links)
        return links


@kernel
def measure_links(radio, obstacles, a, b, size, is_robot_link, links):
    """Fill in LINK records [n] of links between antennas a and b [n, 3], robot-robot or robot-station."""
    for i in range(links.shape[0]):
        link, start, end = links[i], (a[i, 0], a[i, 1], a[i, 2]), (b[i, 0], b[i, 1], b[i, 2])
        measure(radio, obstacles, start, end, size, link)
        if is_robot_link and not is_in_range(radio, b[i, 0] - a[i, 0], b[i, 1] - a[i, 1]):
            link.passing = 0.0
        elif not is_robot_link and not is_spatial(radio):
            link.passing = 1.0
        link.on_time, link.late = fates(radio, link.passing)
