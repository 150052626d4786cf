"""The abstract planar link of the paper: range, then metres inside footprints (docs/radio.md)."""

from ..base.elementary_functions import distance, exp
from ..base.kernels import kernel
from ..base.terms import Footprint
from ..models.intervals import crossing, insert_interval, union_length

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
        enter, leave = crossing(px, py, qx, qy)
        if enter < leave:
            count = insert_interval(scratch, count, enter, leave)
    return union_length(scratch, count) * distance(wx, wy)


@kernel
def measure_planar(radio, obstacles, a, b, link):
    """Fill in a LINK: metres inside footprints, and the share of packets that they let pass, in (0, 1].

    Args:
      radio, obstacles: of the mission's world.
      a, b: (x, y, z) of the ends [m]; a planar link has no z.
    """
    frames, kinds, scratch = obstacles.frames, obstacles.kinds, obstacles.intervals
    link.metres = distance(b[0] - a[0], b[1] - a[1])
    link.forest = metres_inside(frames, kinds, FOREST, a[0], a[1], b[0], b[1], scratch)
    link.mountain = metres_inside(frames, kinds, MOUNTAIN, a[0], a[1], b[0], b[1], scratch)
    link.passing = exp(-link.forest / radio.forest_decay - link.mountain / radio.mountain_decay)
