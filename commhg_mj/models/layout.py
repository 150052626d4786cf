"""Seeded planar geometry of a world: obstacles with their surfaces, station and starting places.

The one source of footprints (abstract links, routes) and of the MJCF model (rays, pictures).
Coordinates: metres; the map is [0, side]², x east, y north, z up, the plain at z = 0.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import cv2
import numpy as np

from ..base.arguments import numbers
from ..base.elementary_functions import directions, distance
from ..base.terms import Footprint
from ..scenarios import Scenario
from ..scenarios.heightmap import PLAIN
from .relief import cover, height_share
from .terrain import SURFACE_NODES, floors_at, make_mountains

# A footprint part is an ellipse: semi-axes a and b, `angle` from east to the axis of a. Forest parts are
# discs (a = b), so that a MuJoCo cylinder is the same set; the parts of one forest share their `group`, and so do all
# mountains of a heightmap, which is one relief.
PART = np.dtype(
    [("kind", "i4"), ("group", "i4"), ("x", "f8"), ("y", "f8"), ("a", "f8"), ("b", "f8"), ("angle", "f8"), ("height", "f8")]
)
MARGIN = 0.03  # of the side: obstacles' centres keep off the border
STATION_CLEARING = 0.09  # of the side: free of obstacles around the station, so that all robots fit in
ROOM_CELLS = 128  # a side: the grid on which a heightmap's free ground is looked at


@dataclass(frozen=True)
class Layout:
    """Geometry of one world. Heights and coordinates are rounded to centimetres (an MJCF round trip is exact)."""

    side: float
    parts: np.ndarray  # [n] of PART; mountains first, in the order of `surfaces`
    surfaces: np.ndarray  # [mountains, SURFACE_NODES (y), SURFACE_NODES (x)] m, 0 outside all footprints
    station: np.ndarray  # [2]
    operators: np.ndarray  # [operators, 2] where they sit
    starts: np.ndarray  # [robots, 2] where robots begin, UAVs first
    uav_slope: float  # of the floor of flights

    @property
    def mountains(self) -> np.ndarray:
        return self.parts[self.parts["kind"] == Footprint.MOUNTAIN]

    @property
    def forests(self) -> np.ndarray:
        return self.parts[self.parts["kind"] == Footprint.FOREST]

    def ground_height(self, xy) -> np.ndarray:
        """Height [m] of the ground at xy [..., 2]: the same triangles that rays hit and pictures show."""
        xy = numbers("xy", xy, ..., 2)
        height = np.zeros(xy.shape[:-1])
        for part, surface in zip(self.mountains, self.surfaces):
            half = surface_half_width(part)
            grid = (xy - [part["x"], part["y"]] + half) / (2 * half) * (SURFACE_NODES - 1)
            near = np.all((grid >= 0) & (grid <= SURFACE_NODES - 1), axis=-1)
            height[near] = np.maximum(height[near], _triangles(surface, grid[near]))
        return height[()]  # of one point a number

    @cached_property
    def terrain(self) -> np.ndarray:
        """The mountains as kernels read them: terrain.MOUNTAIN records [n]."""
        half_widths = [surface_half_width(part) for part in self.mountains]
        return make_mountains(self.mountains, half_widths, self.surfaces, self.uav_slope)

    def flight_floor(self, xy) -> np.ndarray:
        """Height [m] at xy [..., 2] of the floor that UAVs keep their height above: models/terrain.py."""
        xy = np.ascontiguousarray(xy, float)
        return floors_at(self.terrain, xy.reshape(-1, 2)).reshape(xy.shape[:-1])[()]


def surface_half_width(part) -> float:
    """Half the width [m] of the square, centred on the part, that carries a mountain's surface grid."""
    return round(1.04 * max(part["a"], part["b"]), 2)


def _triangles(surface, grid):
    """Piecewise linear surface at grid [n, 2] on it; each cell is split from its (0, 0) to its (1, 1) corner."""
    cell = np.minimum(grid.astype(int), SURFACE_NODES - 2)
    u, v = np.moveaxis(grid - cell, -1, 0)
    i, j = cell[..., 0], cell[..., 1]
    z00, z10, z01, z11 = surface[j, i], surface[j, i + 1], surface[j + 1, i], surface[j + 1, i + 1]
    lower = z00 + u * (z10 - z00) + v * (z11 - z10)
    upper = z00 + u * (z11 - z01) + v * (z01 - z00)
    return np.where(u >= v, lower, upper)


def unit_frame(parts, inflation=0.0) -> np.ndarray:
    """Maps that turn each (inflated) ellipse into the unit circle: rows (x, y, m00, m01, m10, m11)."""
    angles = np.array(parts["angle"])
    along, across = (each.reshape(angles.shape) for each in directions(angles.ravel()))
    a, b = parts["a"] + inflation, parts["b"] + inflation
    return np.stack([parts["x"], parts["y"], along / a, across / a, -across / b, along / b], axis=-1)


def inside_any(frames, xy) -> np.ndarray:
    """Whether points xy [..., 2] lie in any ellipse of `frames` [n, 6]."""
    d = np.asarray(xy)[..., None, :] - frames[:, :2]
    u = d[..., 0] * frames[:, 2] + d[..., 1] * frames[:, 3]
    v = d[..., 0] * frames[:, 4] + d[..., 1] * frames[:, 5]
    return np.any(u * u + v * v < 1.0, axis=-1)


def draw_layout(scenario: Scenario, rng: np.random.Generator) -> Layout:
    """Draw obstacles for one world; the clearing around the station stays free.

    Raises:
      ValueError: the heightmap leaves no room for the station (names the field).
    """
    rules, side = scenario.world, scenario.map_side
    station = np.round([0.5 * side + rng.uniform(-0.08, 0.08) * side, 0.06 * side], 2)
    if rules.heightmap:
        relief = rules.heightmap, side, rules.mountain_height[1]
        mountains, surfaces = _heightmap_mountains(*relief)
        places = _station_places(*relief, rules.ugv_radius)  # the usual place, where it is one of them
        station = np.round(places[distance(*(places - station).T).argmin()], 2)
    else:
        mountains, surfaces = _draw_mountains(scenario, station, rng), None
    forests = _draw_forests(scenario, station, mountains, rng)
    starts = station + _row(scenario.n_robots, min(0.01, 0.16 / scenario.n_robots) * side, 0.015 * side)
    # On a crowded map a part may still reach the station or the starting places: it is left out.
    forests = _off(forests, rules.ugv_radius, [station, *starts])
    if surfaces is None:
        mountains = _off(mountains, rules.ugv_radius, [station, *starts])
        surfaces = [_draw_surface(part, rng) for part in mountains]
    return Layout(
        side=side,
        parts=np.concatenate([mountains, forests]),
        surfaces=np.array(surfaces).reshape(-1, SURFACE_NODES, SURFACE_NODES),
        station=station,
        operators=np.round(station + _row(scenario.n_operators, 0.004 * side, -0.008 * side), 2),
        starts=np.round(starts, 2),
        uav_slope=rules.uav_slope,
    )


def _off(parts, radius, places):
    """The parts that, inflated by `radius`, hold none of the places."""
    return parts[[not inside_any(unit_frame(part[None], radius), places).any() for part in parts]]


def _row(n, spacing, y):
    """n places [n, 2] beside each other, centred on x = 0."""
    return np.stack([(np.arange(n) - (n - 1) / 2) * spacing, np.full(n, y)], axis=-1)


def _place(radius, inflation, station, others, side, rng):
    """A centre whose disc avoids the clearing and, as long as tries last, the discs (x, y, r) of `others`."""
    clearing, centre = STATION_CLEARING * side + inflation, station
    for attempt in range(400):
        centre = rng.uniform(MARGIN * side, (1 - MARGIN) * side, 2)
        patience = max(0.5, 1.0 - attempt / 400)
        clear = distance(*(centre - station)) > radius + clearing
        if clear and all(distance(*(centre - o[:2])) > patience * (radius + o[2]) for o in others):
            return centre
    # Crowded: a far corner clears the station.
    return np.array([MARGIN * side if centre[0] < side / 2 else (1 - MARGIN) * side, (1 - MARGIN) * side])


def _draw_mountains(scenario, station, rng):
    rules, side = scenario.world, scenario.map_side
    parts = np.zeros(rules.n_mountains if rules.mountain_share > 0 else 0, PART)
    weights = rng.uniform(0.6, 1.4, len(parts))
    areas = rules.mountain_share * side**2 * weights / weights.sum() if len(parts) else weights
    placed = []
    for i in range(len(parts)):
        stretch = rng.uniform(1.0, 1.3)
        radius = np.sqrt(areas[i] / np.pi)
        x, y = _place(radius * stretch, rules.ugv_radius, station, placed, side, rng)
        placed.append((x, y, radius * stretch))
        lowest, highest = rules.mountain_height
        height = np.clip(rng.uniform(0.7, 1.2) * radius, lowest, highest)
        a, b = radius * stretch, radius / stretch
        parts[i] = (Footprint.MOUNTAIN, i, *np.round([x, y, a, b], 2), round(rng.uniform(0, np.pi), 4), round(height, 2))
    return parts


@lru_cache(maxsize=8)
def _heightmap_mountains(heightmap, side, top):
    """The mountains of a heightmap whose white is `top` m high, and their surfaces: the same for every seed."""
    ellipses = cover(heightmap)
    parts, surfaces = np.zeros(len(ellipses), PART), []
    parts["kind"] = Footprint.MOUNTAIN
    parts["x"], parts["y"] = np.round(ellipses[:, :2].T * side, 2)
    parts["a"], parts["b"] = np.round(ellipses[:, 2:4].T * side * 1.001 + 0.01, 2)  # more than rounding takes from the cover
    parts["angle"] = np.round(ellipses[:, 4], 4)
    for part in parts:
        half = surface_half_width(part)
        axis = np.linspace(-half, half, SURFACE_NODES)
        nodes = np.stack(np.meshgrid(part["x"] + axis, part["y"] + axis), axis=-1)
        surfaces.append(np.round(top * height_share(heightmap, nodes / side), 2))
        part["height"] = surfaces[-1].max()
    raised = parts["height"] > 0  # foothills under a centimetre are none
    return parts[raised], np.array(surfaces).reshape(-1, SURFACE_NODES, SURFACE_NODES)[raised]


@lru_cache(maxsize=8)
def _station_places(heightmap, side, top, radius):
    """Where a station has room between a heightmap's mountains: places [n, 2] on the largest free ground that has some.

    Free ground is what a vehicle of `radius` m reaches.

    Raises:
      ValueError: there is none (names the field).
    """
    mountains, _ = _heightmap_mountains(heightmap, side, top)
    axis = (np.arange(ROOM_CELLS) + 0.5) / ROOM_CELLS * side
    cells = np.stack(np.meshgrid(axis, axis), axis=-1)
    free = (~inside_any(unit_frame(mountains, radius), cells)).astype(np.uint8)
    reach = int(np.ceil(STATION_CLEARING * ROOM_CELLS))
    room = cv2.erode(free, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1,) * 2)) > 0
    x, y = np.moveaxis(cells / side, -1, 0)
    room &= (np.abs(x - 0.5) < 0.5 - STATION_CLEARING) & (np.abs(y - 0.5) < 0.45)  # the robots' row lies on the map
    if not room.any():
        raise ValueError(
            "world.heightmap leaves no room for the station: it needs a circle of plain ground, "
            f"{2 * STATION_CLEARING * side:.0f} m across and darker than {PLAIN:.0%} of white"
        )
    _, regions = cv2.connectedComponents(free, connectivity=4)
    sizes = np.bincount(regions.ravel())
    return cells[room & (regions == max(np.unique(regions[room]), key=lambda region: sizes[region]))]


def _draw_forests(scenario, station, mountains, rng):
    rules, side = scenario.world, scenario.map_side
    groups = rules.n_forests if rules.forest_share > 0 else 0
    placed = [(m["x"], m["y"], m["a"]) for m in mountains]
    discs = []
    for group in range(groups):
        # Discs of one forest overlap: 0.87 of the equal radius each leaves the union near the share.
        radius = 0.87 * np.sqrt(rules.forest_share * side**2 / groups / np.pi) * rng.uniform(0.85, 1.15)
        x, y = _place(1.5 * radius, rules.ugv_radius, station, placed, side, rng)
        placed.append((x, y, 1.5 * radius))
        height = rng.uniform(*rules.canopy_height)
        discs.append((group, x, y, radius, height))
        angle = rng.uniform(0, 2 * np.pi)
        for _ in range(rng.integers(1, 4)):
            angle += rng.uniform(1.2, 2.4)
            r = radius * rng.uniform(0.5, 0.75)
            d = radius * rng.uniform(0.7, 0.95)
            [east], [north] = directions(np.array([angle]))
            discs.append((group, x + d * east, y + d * north, r, height))
    parts = np.zeros(len(discs), PART)
    for i, (group, *disc) in enumerate(discs):
        x, y, r, height = np.round(disc, 2)
        parts[i] = (Footprint.FOREST, group, x, y, r, r, 0.0, height)
    return parts


def _draw_surface(part, rng):
    """Heights [m] of a mountain: a cone that vanishes on the footprint's edge, roughened by ridges."""
    half = surface_half_width(part)
    axis = np.linspace(-half, half, SURFACE_NODES)
    x, y = np.meshgrid(axis, axis)
    _, _, m00, m01, m10, m11 = unit_frame(part)
    u, v = m00 * x + m01 * y, m10 * x + m11 * y
    radius, bearing = np.hypot(u, v), np.arctan2(v, u)
    cone = np.clip(1.0 - radius, 0, None)
    # Folded waves make sharp crests with round gullies between them, bent a little on their way down.
    crests = 0.0
    for k in (3, 5, 8):
        bend, strength = rng.uniform(-1, 1) * radius, rng.uniform(0.5, 1.0) / k
        crests = crests + strength * (0.6 - np.abs(np.sin(k / 2 * bearing + rng.uniform(0, 2 * np.pi) + bend)))
    lumps = np.cos(5 * u + rng.uniform(0, 6.28)) * np.cos(5 * v + rng.uniform(0, 6.28))
    surface = cone**1.15 * (1.0 + 1.3 * crests * np.minimum(1.0, 3 * radius) + 0.15 * lumps)
    surface = np.clip(surface, 0, None)
    return np.round(surface / surface.max() * part["height"], 2)
