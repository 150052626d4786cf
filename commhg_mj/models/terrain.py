"""The mountains' surface inside kernels: the ground's height, and the profile under a link.

The same triangles as `Layout.ground_height`, which the mesh and so rays and pictures share. Along a line in
plan the surface bends only at grid lines and diagonals: there slopes and heights above the ray peak. An open
path may come a little nearer between them, which changes its loss by hundredths of a decibel.
"""

import numpy as np

from ..base.kernels import kernel, record
from .intervals import crossing

SURFACE_NODES = 33  # a mountain's surface: heights on a square grid of this many nodes a side
LAST = SURFACE_NODES - 1
MOUNTAIN = record(  # half: half width of its surface's square; reach: radius in plan; geom: id of its mesh (models/rays.py)
    x="f8", y="f8", half="f8", reach="f8", top="f8", geom="i8", height=("f8", (SURFACE_NODES, SURFACE_NODES)),
)  # fmt: skip
NOTHING = (-np.inf, -np.inf, -np.inf, -np.inf, 0.5)  # the horizon of a link that crosses no mountain


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
        if not (0.0 <= u <= LAST and 0.0 <= v <= LAST):
            continue
        column, row = min(int(u), LAST - 1), min(int(v), LAST - 1)
        u, v, height = u - column, v - row, mountain.height
        low, high = height[row, column], height[row + 1, column + 1]
        if u >= v:
            right = height[row, column + 1]
            ground = max(ground, low + u * (right - low) + v * (high - right))
        else:
            left = height[row + 1, column]
            ground = max(ground, low + u * (high - left) + v * (left - low))
    return ground


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
