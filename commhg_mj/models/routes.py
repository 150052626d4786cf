"""Shortest ground routes around footprints: a visibility graph, and queries from anywhere on the map.

Obstacles are ellipses inflated by the vehicle's radius; each is circumscribed by a polygon whose corners
are the graph's nodes. A straight leg is clear when it meets no inflated ellipse. Shortest trees towards
every goal are stored, so that a query is: which corners see me, and which of them is best.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from ..kernels import kernel
from .layout import inside_any, unit_frame

CORNERS = 12  # of the polygon around an obstacle part
GAP = 1e-3  # polygons stand off by this share, so that their own edges are clear
DIRECT = -1  # next hop: straight to the goal
MAX_VISIBLE = 512  # corners that a query considers


class Routes(NamedTuple):
    """Arrays of one world (leading axis: worlds, once stacked). Lengths in metres."""

    frames: np.ndarray  # [parts, 6] inflated ellipse -> unit circle, see layout.unit_frame
    corners: np.ndarray  # [corners, 6] x, y, previous x, y, next x, y on its polygon
    goals: np.ndarray  # [goals, 2]
    to_goal: np.ndarray  # [goals, corners] f4: shortest route from a corner, inf where none
    next_hop: np.ndarray  # [goals, corners] i2: next corner on it, or DIRECT


@kernel
def is_clear(frames, ax, ay, bx, by):
    """Whether the straight leg a-b meets no inflated ellipse."""
    for i in range(frames.shape[0]):
        f = frames[i]
        ux, uy = ax - f[0], ay - f[1]
        wx, wy = bx - ax, by - ay
        px, py = f[2] * ux + f[3] * uy, f[4] * ux + f[5] * uy
        qx, qy = f[2] * wx + f[3] * wy, f[4] * wx + f[5] * wy
        along = -(px * qx + py * qy)
        length2 = qx * qx + qy * qy
        if along <= 0.0 or along >= length2:  # nearest point of the leg is one of its ends
            inside = min(px * px + py * py, (px + qx) ** 2 + (py + qy) ** 2)
        else:
            cross = px * qy - py * qx
            inside = cross * cross / length2
        if inside < 1.0 - 1e-9:
            return False
    return True


@kernel
def leaves_tangentially(corner, x, y):
    """Whether a shortest route may turn at this corner when it comes from (x, y)."""
    dx, dy = corner[0] - x, corner[1] - y
    before = dx * (corner[3] - y) - dy * (corner[2] - x)
    after = dx * (corner[5] - y) - dy * (corner[4] - x)
    slack = 1e-6 * (abs(dx) + abs(dy))
    return (before >= -slack and after >= -slack) or (before <= slack and after <= slack)


@kernel
def find_visible(frames, corners, x, y, found, distance):
    """Corners on which a route from (x, y) can start: fills `found` and `distance`, returns their count."""
    count = 0
    for i in range(corners.shape[0]):
        if count == found.shape[0]:
            break
        c = corners[i]
        if leaves_tangentially(c, x, y) and is_clear(frames, x, y, c[0], c[1]):
            found[count] = i
            distance[count] = np.hypot(c[0] - x, c[1] - y)
            count += 1
    return count


@kernel
def best_start(to_goal, goal, found, distance, count):
    """(length, corner) of the shortest route to `goal` over the visible corners; (inf, DIRECT) if none."""
    best, corner = np.inf, DIRECT
    row = to_goal[goal]
    for k in range(count):
        length = distance[k] + row[found[k]]
        if length < best:
            best, corner = length, found[k]
    return best, corner


@kernel
def _link_corners(frames, corners, starts, ends, lengths):
    """All mutually visible pairs of corners that a shortest route can use; returns their count."""
    count = 0
    for i in range(corners.shape[0]):
        a = corners[i]
        for j in range(i):
            b = corners[j]
            if leaves_tangentially(a, b[0], b[1]) and leaves_tangentially(b, a[0], a[1]):
                if is_clear(frames, a[0], a[1], b[0], b[1]):
                    starts[count], ends[count] = i, j
                    lengths[count] = np.hypot(a[0] - b[0], a[1] - b[1])
                    count += 1
    return count


def obstacle_corners(parts, radius, side) -> tuple[np.ndarray, np.ndarray]:
    """(frames [parts, 6], corners [n, 6]) of the footprints inflated by `radius`, on a map of `side` metres."""
    frames = unit_frame(parts, radius).reshape(-1, 6)
    turn = 2 * np.pi * np.arange(CORNERS) / CORNERS
    reach = (1 + GAP) / np.cos(np.pi / CORNERS)
    a, b = (parts[axis][:, None] + radius for axis in "ab")
    u, v = a * reach * np.cos(turn), b * reach * np.sin(turn)
    cos, sin = np.cos(parts["angle"])[:, None], np.sin(parts["angle"])[:, None]
    ring = np.stack([parts["x"][:, None] + cos * u - sin * v, parts["y"][:, None] + sin * u + cos * v], -1)
    corners = np.concatenate([ring, np.roll(ring, 1, 1), np.roll(ring, -1, 1)], -1).reshape(-1, 6)
    xy = corners[:, :2]
    free = np.all((xy >= radius) & (xy <= side - radius), axis=-1) & ~inside_any(frames, xy)
    return frames, np.ascontiguousarray(corners[free])


class Roadmap:
    """Corners of one world and their links, before goals are known."""

    def __init__(self, parts, radius, side, root):
        self.frames, self.corners = obstacle_corners(parts, radius, side)
        n = len(self.corners)
        pairs = max(1, n * (n - 1) // 2)
        starts, ends, lengths = np.empty(pairs, np.int32), np.empty(pairs, np.int32), np.empty(pairs)
        count = _link_corners(self.frames, self.corners, starts, ends, lengths)
        self.links = starts[:count], ends[:count], lengths[:count]
        self.root = root
        self._connected = self._reachable_corners()

    def _visible(self, xy):
        found, distance = np.empty(MAX_VISIBLE, np.int32), np.empty(MAX_VISIBLE)
        count = find_visible(self.frames, self.corners, xy[0], xy[1], found, distance)
        return found[:count], distance[:count]

    def _graph(self, extra_rows, extra_cols, extra_lengths, size):
        starts, ends, lengths = self.links
        rows = np.concatenate([starts, ends, extra_rows])
        cols = np.concatenate([ends, starts, extra_cols])
        return csr_array((np.concatenate([lengths, lengths, extra_lengths]), (rows, cols)), shape=(size, size))

    def _reachable_corners(self):
        n = len(self.corners)
        found, distance = self._visible(self.root)
        if not len(found):
            return np.zeros(n, bool)
        graph = self._graph(np.full(len(found), n), found, distance, n + 1)
        return np.isfinite(dijkstra(graph, indices=n)[:n])

    def is_reachable(self, xy) -> bool:
        """Whether a ground vehicle at the root can drive to xy."""
        if inside_any(self.frames, xy):
            return False
        if is_clear(self.frames, self.root[0], self.root[1], xy[0], xy[1]):
            return True
        found, _ = self._visible(xy)
        return bool(self._connected[found].any())

    def routes_to(self, goals) -> Routes:
        """Shortest trees towards every goal [goals, 2]; unreachable ones have infinite lengths."""
        n, g = len(self.corners), len(goals)
        seen = [self._visible(goal) for goal in goals]
        rows = np.concatenate([np.full(len(found), n + i) for i, (found, _) in enumerate(seen)])
        cols = np.concatenate([found for found, _ in seen])
        lengths = np.concatenate([distance for _, distance in seen])
        # Links from goals are one-way, so that no route passes through another goal.
        graph = self._graph(rows, cols, lengths, n + g)
        to_goal, before = dijkstra(graph, indices=np.arange(n, n + g), return_predecessors=True)
        before = before[:, :n]
        hop = np.where((before < 0) | (before >= n), DIRECT, before)
        return Routes(
            self.frames, self.corners, np.ascontiguousarray(goals), to_goal[:, :n].astype(np.float32), hop.astype(np.int16)
        )


def find_path(routes: Routes, start, goal: int) -> np.ndarray:
    """The shortest ground route [k, 2] from `start` to goal number `goal`, both ends included.

    Raises:
      ValueError: no route exists.
    """
    target = routes.goals[goal]
    if is_clear(routes.frames, start[0], start[1], target[0], target[1]):
        return np.array([start, target], float)
    found, distance = np.empty(MAX_VISIBLE, np.int32), np.empty(MAX_VISIBLE)
    count = find_visible(routes.frames, routes.corners, start[0], start[1], found, distance)
    length, corner = best_start(routes.to_goal, goal, found, distance, count)
    if not np.isfinite(length):
        raise ValueError(f"no ground route from ({start[0]:.1f}, {start[1]:.1f}) to goal {goal}")
    path = [np.asarray(start, float)]
    while corner != DIRECT:
        path.append(routes.corners[corner, :2])
        corner = routes.next_hop[goal, corner]
    return np.array(path + [target])
