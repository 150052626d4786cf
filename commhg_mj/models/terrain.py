"""The mountains' surface inside kernels: the ground's height, the floor of flights, and the profile under a link.

The same triangles as `Layout.ground_height`, which the mesh and so rays and pictures share. Along a line in
plan the surface bends only at grid lines and diagonals: there slopes and heights above the ray peak. An open
path may come a little nearer between them, which changes its loss by hundredths of a decibel.

The floor is what UAVs keep their height above: the lowest surface over the ground that falls no faster than
`fall` along either axis of the grids, so nowhere faster than √2 times that. Within a mountain's square it has the ground's
triangles, with raised nodes; outside it goes on falling from the nearest point of the square. So the slope of
every triangle is that of two of its edges, and bounded without a root.
"""

import numpy as np

from ..base.elementary_functions import distance
from ..base.kernels import kernel, record
from .intervals import crossing

SURFACE_NODES = 33  # a mountain's surface: heights on a square grid of this many nodes a side
LAST = SURFACE_NODES - 1
MOUNTAIN = record(  # half: half width of its surface's square; reach: radius in plan; geom: id of its mesh (models/rays.py)
    x="f8", y="f8", half="f8", reach="f8", top="f8", geom="i8", height=("f8", (SURFACE_NODES, SURFACE_NODES)),
    fall="f8", floor=("f8", (SURFACE_NODES, SURFACE_NODES)),  # of the floor: m a cell along an axis; m at the nodes
)  # fmt: skip
NOTHING = (-np.inf, -np.inf, -np.inf, -np.inf, 0.5)  # the horizon of a link that crosses no mountain


def make_mountains(parts, half_widths, surfaces, slope) -> np.ndarray:
    """MOUNTAIN records [n] of a layout's mountains; their meshes' ids are left to who builds them.

    Args:
      parts: [n] layout.PART.
      half_widths: [n] m, of the surfaces' squares.
      surfaces: [n, SURFACE_NODES, SURFACE_NODES] m.
      slope: of the floor, rise over run in its steepest direction.
    """
    mountains = np.zeros(len(parts), MOUNTAIN)
    mountains["x"], mountains["y"], mountains["half"] = parts["x"], parts["y"], half_widths
    mountains["reach"] = [_reach(surface, half) for surface, half in zip(surfaces, half_widths)]
    mountains["height"], mountains["top"] = surfaces, surfaces.max(axis=(1, 2), initial=0.0)
    mountains["fall"] = slope * np.sqrt(0.5) * 2.0 * mountains["half"] / LAST
    mountains["floor"] = raise_floor(surfaces, mountains["fall"])
    return mountains


def _reach(surface, half):
    """Radius [m] around a mountain's centre beyond which its triangles are flat: a cell's diagonal from its last node."""
    axis = np.linspace(-half, half, SURFACE_NODES)
    away = distance(*np.meshgrid(axis, axis))
    return away[surface > 0].max() + np.sqrt(2) * (axis[1] - axis[0])


def raise_floor(surfaces, fall) -> np.ndarray:
    """Surfaces [n, rows, columns] raised as little as makes neighbours along an axis differ by `fall` [n] at most."""
    floor = np.array(surfaces)
    for nodes in (np.moveaxis(floor, 1, 0), np.moveaxis(floor, 2, 0)):  # along columns, then along rows
        for there in (nodes, nodes[::-1]):
            for before, node in zip(there[:-1], there[1:]):
                np.maximum(node, before - fall[:, None], out=node)
    return floor


@kernel
def to_grid(mountain, x, y):
    """A point in grid coordinates of a mountain's surface."""
    scale = LAST / (2.0 * mountain.half)
    return (x - mountain.x + mountain.half) * scale, (y - mountain.y + mountain.half) * scale


@kernel
def ground_at(mountains, x, y):
    """Height [m] of the ground at a point: `Layout.ground_height`."""
    ground = 0.0
    for i in range(mountains.shape[0]):
        mountain = mountains[i]
        u, v = to_grid(mountain, x, y)
        if 0.0 <= u <= LAST and 0.0 <= v <= LAST:
            ground = max(ground, on_triangles(mountain.height, u, v))
    return ground


@kernel
def on_triangles(height, u, v):
    """A surface's height [m] at grid coordinates on its square."""
    column, row = min(int(u), LAST - 1), min(int(v), LAST - 1)
    u, v = u - column, v - row
    low, high = height[row, column], height[row + 1, column + 1]
    if u >= v:
        right = height[row, column + 1]
        return low + u * (right - low) + v * (high - right)
    left = height[row + 1, column]
    return low + u * (high - left) + v * (left - low)


@kernel
def floor_at(mountains, x, y):
    """Height [m] of the floor of flights at a point: `Layout.flight_floor`."""
    floor = 0.0
    for i in range(mountains.shape[0]):
        mountain = mountains[i]
        u, v = to_grid(mountain, x, y)
        near_u, near_v = min(max(u, 0.0), float(LAST)), min(max(v, 0.0), float(LAST))
        fallen = mountain.fall * (abs(u - near_u) + abs(v - near_v))
        if mountain.top - fallen > floor:
            floor = max(floor, on_triangles(mountain.floor, near_u, near_v) - fallen)
    return floor


@kernel
def floors_at(mountains, xy):
    """`floor_at` at points [n, 2]."""
    floors = np.empty(xy.shape[0])
    for i in range(xy.shape[0]):
        floors[i] = floor_at(mountains, xy[i, 0], xy[i, 1])
    return floors


@kernel
def add_profile(mountain, a, b, horizon):
    """Add what a link meets of a mountain to its horizon.

    Args:
      a, b: (x, y, z) of its ends [m].
      horizon: over the points of the profile so far, the greatest height above the ray [m]; slope above it seen from
        a and from b; clearance, the height above it times √(1/d1 + 1/d2) [√m]; and where that is, as a share of the way.

    The plain itself is no edge: only ground above it counts.
    """
    dx, dy = b[0] - a[0], b[1] - a[1]
    reach = mountain.reach
    enter, leave = crossing((a[0] - mountain.x) / reach, (a[1] - mountain.y) / reach, dx / reach, dy / reach)
    if enter >= leave:
        return horizon
    u, v = to_grid(mountain, a[0], a[1])
    scale = LAST / (2.0 * mountain.half)
    du, dv = dx * scale, dy * scale
    horizon = add_edges(mountain.height, a, b, u, v, du, dv, u, du, 0, 1, enter, leave, horizon)
    horizon = add_edges(mountain.height, a, b, u, v, du, dv, v, dv, 1, 0, enter, leave, horizon)
    return add_edges(mountain.height, a, b, u, v, du, dv, u - v, du - dv, 1, 1, enter, leave, horizon)


@kernel
def add_edges(height, a, b, u, v, du, dv, s, ds, columns, rows, enter, leave, horizon):
    """Add the points where a link crosses one family of the surface's edges: those on which s + t ds is whole.

    An edge runs from its node by so many `columns` and `rows` to the next one.
    """
    if ds == 0.0:
        return horizon
    first, last = min(s + enter * ds, s + leave * ds), max(s + enter * ds, s + leave * ds)
    length = np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
    for k in range(int(np.ceil(first)), int(np.floor(last)) + 1):
        t = (k - s) / ds
        x, y = u + t * du, v + t * dv
        column, row = int(np.floor(x)), int(np.floor(y))
        if rows == 0:
            row = k
        elif columns == 0:
            column = k
        else:
            row = column - k
        if not (0 <= column <= LAST - columns and 0 <= row <= LAST - rows and 0.0 < t < 1.0):
            continue
        share = x - column if columns else y - row
        ground = height[row, column] + share * (height[row + rows, column + columns] - height[row, column])
        if ground > 0.0:
            horizon = add_point(horizon, t, ground - a[2] - t * (b[2] - a[2]), length)
    return horizon


@kernel
def add_point(horizon, t, above, length):
    """Add the point of the profile at the share t of the way, `above` metres over the ray."""
    highest, from_a, from_b, clearance, at = horizon
    d1, d2 = t * length, (1.0 - t) * length
    value = above * np.sqrt(1.0 / d1 + 1.0 / d2)
    if value > clearance:
        clearance, at = value, t
    return max(highest, above), max(from_a, above / d1), max(from_b, above / d2), clearance, at
