"""Counter-based randomness: every random event is a pure function of (seed, event, tick, indices).

So missions replay exactly, whatever the batch, the threads or the order, and two policies or two link
models on one seed meet the same packet fates and hazards (common random numbers).
"""

from enum import IntEnum

import numpy as np

from ..base.kernels import kernel


class Event(IntEnum):
    PACKET = 0  # plus the message kind; indices: sender, receiver
    PACKET_DELAY = 16  # plus the message kind
    MALFUNCTION = 32  # index: robot
    SERVICE = 33  # indices: robot, task


@kernel
def _mix(x):
    """The finaliser of splitmix64 (Steele et al. 2014)."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@kernel
def uniform(seed, event, tick, i, j):
    """A uniform number in [0, 1) that depends on the arguments alone."""
    x = _mix(np.uint64(seed) + np.uint64(0x9E3779B97F4A7C15) * np.uint64(event + 1))
    x = _mix(x ^ (np.uint64(tick) << np.uint64(32)) ^ (np.uint64(i) << np.uint64(16)) ^ np.uint64(j))
    return np.float64(x >> np.uint64(11)) * 2.0**-53
