"""The abstract planar link of the paper: range, then metres inside footprints (design: radio.md)."""

import numpy as np

from ..kernels import kernel
from ..models.routes import distance
from ..terms import Footprint

FOREST = int(Footprint.FOREST)
MOUNTAIN = int(Footprint.MOUNTAIN)


@kernel
def metres_inside(frames, kinds, kind, ax, ay, bx, by, scratch):
    """Planar metres of the segment a-b inside the union of the footprints of one kind.

    Args:
      frames: [parts, 6] maps of footprints to the unit circle (layout.unit_frame).
      kinds: [parts] Footprint.
      scratch: [2, parts] room for the intervals.
    """
    wx, wy = bx - ax, by - ay
    count = 0
    for i in range(frames.shape[0]):
        if kinds[i] != kind:
            continue
        ux, uy = ax - frames[i, 0], ay - frames[i, 1]
        px, py = frames[i, 2] * ux + frames[i, 3] * uy, frames[i, 4] * ux + frames[i, 5] * uy
        qx, qy = frames[i, 2] * wx + frames[i, 3] * wy, frames[i, 4] * wx + frames[i, 5] * wy
        q2, pq, p2 = qx * qx + qy * qy, px * qx + py * qy, px * px + py * py - 1.0
        root2 = pq * pq - q2 * p2
        if root2 <= 0.0:
            continue
        root = np.sqrt(root2)
        enter, leave = max(0.0, (-pq - root) / q2), min(1.0, (-pq + root) / q2)
        if enter < leave:
            k = count  # keep the intervals sorted by where they begin
            while k > 0 and scratch[0, k - 1] > enter:
                scratch[0, k], scratch[1, k] = scratch[0, k - 1], scratch[1, k - 1]
                k -= 1
            scratch[0, k], scratch[1, k] = enter, leave
            count += 1
    inside, reached = 0.0, 0.0
    for k in range(count):
        inside += max(0.0, scratch[1, k] - max(reached, scratch[0, k]))
        reached = max(reached, scratch[1, k])
    return inside * distance(wx, wy)


@kernel
def planar_clearance(frames, kinds, forest_decay, mountain_decay, ax, ay, bx, by, scratch):
    """Share of packets that terrain lets pass between two radios on the plane, in (0, 1]."""
    forest = metres_inside(frames, kinds, FOREST, ax, ay, bx, by, scratch)
    mountain = metres_inside(frames, kinds, MOUNTAIN, ax, ay, bx, by, scratch)
    return np.exp(-forest / forest_decay - mountain / mountain_decay)
