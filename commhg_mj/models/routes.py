"""Shortest ground routes around footprints: a visibility graph, and queries from anywhere on the map.

Obstacles are ellipses inflated by the vehicle's radius; each is circumscribed by a polygon whose corners
are the graph's nodes. A straight leg is clear when it meets no inflated ellipse. Shortest trees towards
every goal are stored, so that a query is: which corners see me, and which of them is best.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from ..base.elementary_functions import directions, distance
from ..base.kernels import kernel
from .layout import inside_any, unit_frame

CORNERS = 12  # of the polygon around an obstacle part
GAP = 1e-3  # polygons stand off by this share, so that their own edges are clear
DIRECT = -1  # next hop: straight to the goal
TOUCH = 1e-4  # a leg may graze an ellipse by this share of its squared radius: room for rounding


class Routes(NamedTuple):
    """Arrays of one world. Lengths in metres."""

    frames: np.ndarray  # [parts, 6] inflated ellipse -> unit circle, see layout.unit_frame
    corners: np.ndarray  # [corners, 6] x, y, previous x, y, next x, y on its polygon
    goals: np.ndarray  # [goals, 2]
    to_goal: np.ndarray  # [corners, goals] f4: shortest route from a corner, inf where none
    next_hop: np.ndarray  # [goals, corners] i2: next corner on it, or DIRECT
    between: np.ndarray  # [goals, goals] f4: shortest routes between goals on free ground, else inf


class Scratch(NamedTuple):
    """Room for one query at a time: first for its corners, behind them for its goals."""

    found: np.ndarray  # [n] i4 corners
    distance: np.ndarray  # [n] f8 m to them
    dx: np.ndarray  # [n] f4
    dy: np.ndarray  # [n] f4
    clearance: np.ndarray  # [n] f4


def new_scratch(n_corners: int, n_goals: int) -> Scratch:
    """Scratch for queries of a world; between queries 64 places at least are free for other use."""
    n = n_corners + n_goals + 64
    return Scratch(np.empty(n, np.int32), np.empty(n), *(np.empty(n, np.float32) for _ in range(3)))


@kernel
def mark_clear(frames, x, y, dx, dy, count, clearance):
    """Which straight legs from (x, y) meet no inflated ellipse.

    Args:
      dx, dy: [>= count] f4, from (x, y) to the targets.
      clearance: [>= count] f4, filled: positive where the leg is clear.
    """
    keep = np.float32(1.0 - TOUCH)
    for k in range(count):
        clearance[k] = np.float32(1.0)
    for i in range(frames.shape[0]):
        ux, uy = x - frames[i, 0], y - frames[i, 1]
        px, py = np.float32(frames[i, 2] * ux + frames[i, 3] * uy), np.float32(frames[i, 4] * ux + frames[i, 5] * uy)
        m00, m01 = np.float32(frames[i, 2]), np.float32(frames[i, 3])
        m10, m11 = np.float32(frames[i, 4]), np.float32(frames[i, 5])
        # Branchless, so that the compiler works on eight legs at once.
        for k in range(count):
            wx, wy = m00 * dx[k] + m01 * dy[k], m10 * dx[k] + m11 * dy[k]
            length2, along, cross = wx * wx + wy * wy, px * wx + py * wy, px * wy - py * wx
            passes = (along < np.float32(0.0)) & (along + length2 > np.float32(0.0))
            margin = cross * cross - keep * length2 if passes else np.float32(1.0)
            clearance[k] = margin if margin < clearance[k] else clearance[k]


@kernel
def is_clear(frames, ax, ay, bx, by):
    """Whether the straight leg a-b, from free ground to free ground, meets no inflated ellipse."""
    for i in range(frames.shape[0]):
        ux, uy, dx, dy = ax - frames[i, 0], ay - frames[i, 1], bx - ax, by - ay
        px, py = frames[i, 2] * ux + frames[i, 3] * uy, frames[i, 4] * ux + frames[i, 5] * uy
        wx, wy = frames[i, 2] * dx + frames[i, 3] * dy, frames[i, 4] * dx + frames[i, 5] * dy
        length2, along, cross = wx * wx + wy * wy, px * wx + py * wy, px * wy - py * wx
        if along < 0.0 and along + length2 > 0.0 and cross * cross < (1.0 - TOUCH) * length2:
            return False
    return True


@kernel
def leaves_tangentially(corners, i, x, y):
    """Whether a shortest route may turn at corner i when it comes from (x, y)."""
    dx, dy = corners[i, 0] - x, corners[i, 1] - y
    before = dx * (corners[i, 3] - y) - dy * (corners[i, 2] - x)
    after = dx * (corners[i, 5] - y) - dy * (corners[i, 4] - x)
    slack = 1e-6 * (abs(dx) + abs(dy))
    return (before >= -slack and after >= -slack) or (before <= slack and after <= slack)


@kernel
def find_visible(frames, corners, x, y, scratch):
    """Corners on which a route from (x, y) can start.

    Fills `scratch.found` and `scratch.distance` (m) and returns their count. From between an obstacle and the polygon
    around it no corner may be seen along a tangent: then any that is seen will do.
    """
    count = find_clear(frames, corners, x, y, True, scratch)
    return count if count > 0 else find_clear(frames, corners, x, y, False, scratch)


@kernel
def find_clear(frames, corners, x, y, only_tangents, scratch):
    """The corners that a clear straight leg from (x, y) reaches, all or along tangents; filled in and counted as above."""
    candidates = 0
    for i in range(corners.shape[0]):
        if not only_tangents or leaves_tangentially(corners, i, x, y):
            scratch.found[candidates] = i
            scratch.dx[candidates], scratch.dy[candidates] = corners[i, 0] - x, corners[i, 1] - y
            candidates += 1
    mark_clear(frames, x, y, scratch.dx, scratch.dy, candidates, scratch.clearance)
    count = 0
    for k in range(candidates):
        if scratch.clearance[k] > 0.0:
            scratch.found[count] = scratch.found[k]
            scratch.distance[count] = distance(scratch.dx[k], scratch.dy[k])
            count += 1
    return count


@kernel
def best_start(to_goal, goal, scratch, count):
    """(length, corner) of the shortest route to `goal` over the visible corners; (inf, DIRECT) if none."""
    best, corner = np.inf, DIRECT
    for k in range(count):
        length = scratch.distance[k] + to_goal[scratch.found[k], goal]
        if length < best:
            best, corner = length, scratch.found[k]
    return best, corner


@kernel
def measure_goals(routes, x, y, wanted, count, lengths, scratch):
    """Route lengths [m] from (x, y) to the goals wanted[:count], into `lengths`; inf where there is none."""
    for k in range(count):
        goal = routes.goals[wanted[k]]
        scratch.dx[k], scratch.dy[k] = goal[0] - x, goal[1] - y
    mark_clear(routes.frames, x, y, scratch.dx, scratch.dy, count, scratch.clearance)
    blocked = 0
    for k in range(count):
        if scratch.clearance[k] > 0.0:
            lengths[k] = distance(scratch.dx[k], scratch.dy[k])
        else:
            lengths[k] = np.inf
            blocked += 1
    if blocked == 0:
        return
    n_visible = find_visible(routes.frames, routes.corners, x, y, scratch)
    for i in range(n_visible):  # corner by corner, so that memory is read in rows
        way, corner = scratch.distance[i], scratch.found[i]
        for k in range(count):
            length = way + routes.to_goal[corner, wanted[k]]
            if length < lengths[k]:
                lengths[k] = length


@kernel
def measure_all(routes, ground_goals, lengths, scratch):
    """Route lengths between all pairs of `ground_goals`, into lengths [goals, goals]."""
    row = np.empty(ground_goals.shape[0], np.float32)
    for i in ground_goals:
        goal = routes.goals[i]
        measure_goals(routes, goal[0], goal[1], ground_goals, ground_goals.shape[0], row, scratch)
        for k in range(ground_goals.shape[0]):
            lengths[i, ground_goals[k]] = row[k]


@kernel
def _link_corners(frames, corners, starts, ends, lengths):
    """All mutually visible pairs of corners that a shortest route can use; returns their count."""
    count = 0
    for i in range(corners.shape[0]):
        ax, ay = corners[i, 0], corners[i, 1]
        for j in range(i):
            bx, by = corners[j, 0], corners[j, 1]
            if leaves_tangentially(corners, i, bx, by) and leaves_tangentially(corners, j, ax, ay):
                if is_clear(frames, ax, ay, bx, by):
                    starts[count], ends[count] = i, j
                    lengths[count] = distance(ax - bx, ay - by)
                    count += 1
    return count


def obstacle_corners(parts, radius, side) -> tuple[np.ndarray, np.ndarray]:
    """(frames [parts, 6], corners [n, 6]) of the footprints inflated by `radius`, on a map of `side` metres."""
    frames = unit_frame(parts, radius).reshape(-1, 6)
    east, north = directions(2 * np.pi * np.arange(CORNERS) / CORNERS)
    reach = (1 + GAP) / directions(np.array([np.pi / CORNERS]))[0][0]
    a, b = (parts[axis][:, None] + radius for axis in "ab")
    u, v = a * reach * east, b * reach * north
    along, across = (each[:, None] for each in directions(np.array(parts["angle"])))
    ring = np.stack([parts["x"][:, None] + along * u - across * v, parts["y"][:, None] + across * u + along * v], -1)
    corners = np.concatenate([ring, np.roll(ring, 1, 1), np.roll(ring, -1, 1)], -1).reshape(-1, 6)
    xy = corners[:, :2]
    free = np.all((xy >= radius) & (xy <= side - radius), axis=-1) & ~inside_any(frames, xy)
    return frames, np.ascontiguousarray(corners[free])


class Roadmap:
    """Corners of one world and their links, before goals are known."""

    def __init__(self, parts, radius, side, root):
        self.frames, self.corners = obstacle_corners(parts, radius, side)
        self._scratch = new_scratch(len(self.corners), 0)
        n = len(self.corners)
        pairs = max(1, n * (n - 1) // 2)
        starts, ends, lengths = np.empty(pairs, np.int32), np.empty(pairs, np.int32), np.empty(pairs)
        count = _link_corners(self.frames, self.corners, starts, ends, lengths)
        self.links = starts[:count], ends[:count], lengths[:count]
        self.root = root
        self._connected = self._reachable_corners()

    def _visible(self, xy):
        count = find_visible(self.frames, self.corners, xy[0], xy[1], self._scratch)
        return self._scratch.found[:count].copy(), self._scratch.distance[:count].copy()

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
        count = find_clear(self.frames, self.corners, xy[0], xy[1], True, self._scratch)
        return bool(self._connected[self._scratch.found[:count]].any())

    def routes_to(self, goals, is_ground) -> Routes:
        """Shortest trees towards every goal [goals, 2]; `is_ground` [goals] marks those on free ground.

        Goals off free ground have infinite lengths.
        """
        n, g = len(self.corners), len(goals)
        nothing = np.empty(0, np.int32), np.empty(0)
        seen = [self._visible(goal) if ground else nothing for goal, ground in zip(goals, is_ground)]
        rows = np.concatenate([np.full(len(found), n + i) for i, (found, _) in enumerate(seen)])
        cols = np.concatenate([found for found, _ in seen])
        lengths = np.concatenate([distance for _, distance in seen])
        # Links from goals are one-way, so that no route passes through another goal.
        graph = self._graph(rows, cols, lengths, n + g)
        to_goal, before = dijkstra(graph, indices=np.arange(n, n + g), return_predecessors=True)
        before = before[:, :n]
        hop = np.where((before < 0) | (before >= n), DIRECT, before)
        routes = Routes(
            frames=self.frames,
            corners=self.corners,
            goals=np.ascontiguousarray(goals),
            to_goal=np.ascontiguousarray(to_goal[:, :n].T, np.float32),
            next_hop=np.ascontiguousarray(hop, np.int16),
            between=np.full((g, g), np.inf, np.float32),
        )
        measure_all(routes, np.flatnonzero(is_ground), routes.between, new_scratch(n, g))
        return routes


def find_path(routes: Routes, start, goal: int) -> np.ndarray:
    """The shortest ground route [k, 2] from `start` to goal number `goal`, both ends included.

    Raises:
      ValueError: no route exists.
    """
    target = routes.goals[goal]
    if is_clear(routes.frames, start[0], start[1], target[0], target[1]):
        return np.array([start, target], float)
    scratch = new_scratch(len(routes.corners), 0)
    count = find_visible(routes.frames, routes.corners, start[0], start[1], scratch)
    length, corner = best_start(routes.to_goal, goal, scratch, count)
    if not np.isfinite(length):
        raise ValueError(f"no ground route from ({start[0]:.1f}, {start[1]:.1f}) to goal {goal}")
    path = [np.asarray(start, float)]
    while corner != DIRECT:
        path.append(routes.corners[corner, :2])
        corner = routes.next_hop[goal, corner]
    return np.array(path + [target])
