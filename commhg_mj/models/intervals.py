"""Segments through bodies: where one enters and leaves, and the metres inside a union of bodies."""

import numpy as np

from ..base.kernels import kernel


@kernel
def crossing(px, py, qx, qy):
    """The shares of the way from p to p + q at which it enters and leaves the unit circle; enter >= leave: it misses."""
    q2, pq, p2 = qx * qx + qy * qy, px * qx + py * qy, px * px + py * py - 1.0
    if q2 == 0.0:  # upright, seen from above
        return 0.0, 1.0 if p2 < 0.0 else 0.0
    root2 = pq * pq - q2 * p2
    if root2 <= 0.0:
        return 1.0, 0.0
    root = np.sqrt(root2)
    return max(0.0, (-pq - root) / q2), min(1.0, (-pq + root) / q2)


@kernel
def insert_interval(scratch, count, enter, leave):
    """Keep intervals sorted by where they begin; returns their new number.

    Args:
      scratch: [2, n] begins and ends of the first `count` intervals.
    """
    k = count
    while k > 0 and scratch[0, k - 1] > enter:
        scratch[0, k], scratch[1, k] = scratch[0, k - 1], scratch[1, k - 1]
        k -= 1
    scratch[0, k], scratch[1, k] = enter, leave
    return count + 1


@kernel
def union_length(scratch, count):
    """Length of the union of the first `count` sorted intervals: what overlaps counts once."""
    inside, reached = 0.0, 0.0
    for k in range(count):
        inside += max(0.0, scratch[1, k] - max(reached, scratch[0, k]))
        reached = max(reached, scratch[1, k])
    return inside
