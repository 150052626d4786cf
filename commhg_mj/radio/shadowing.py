"""Log-normal shadowing, symmetric per link and correlated in space (off by default).

Each place of a world has a value of a unit Gaussian field with correlation exp(-metres / length), made of random
plane waves; a link's shadowing is the scaled sum of its two ends' values. So it is a pure function of world and
positions, and both directions of a link see the same.
"""

import numpy as np

from ..base.elementary_functions import cos, directions
from ..base.kernels import kernel

N_WAVES = 64
STREAM = 3  # separates shadowing's random stream from the world's and the mission's


def draw_waves(seed: int) -> np.ndarray:
    """[N_WAVES, 3] wave vector (rad per correlation length, x and y) and phase (rad) of a world's field.

    The magnitude k has the spectrum of an exponential correlation in the plane: P(k < K) = 1 - 1/√(1 + K²).
    """
    rng = np.random.default_rng([seed, STREAM])
    u = 1.0 - rng.random(N_WAVES)
    k = np.sqrt(1.0 / (u * u) - 1.0)
    bearing, phase = rng.uniform(0, 2 * np.pi, (2, N_WAVES))
    east, north = directions(bearing)
    return np.stack([k * east, k * north, phase], axis=-1)


@kernel
def field_at(waves, x, y):
    """The unit Gaussian field at a point, in correlation lengths."""
    total = 0.0
    for i in range(waves.shape[0]):
        total += cos(waves[i, 0] * x + waves[i, 1] * y + waves[i, 2])
    return total * np.sqrt(2.0 / waves.shape[0])


@kernel
def shadowing_loss(waves, sigma, length, ax, ay, bx, by):
    """Shadowing [dB] between two places [m], may be a gain; correlation `length` [m].

    Its standard deviation is `sigma` [dB] for ends far apart; the two values of near ends are alike, and it is
    sigma √(1 + exp(-metres / length)).
    """
    return sigma * np.sqrt(0.5) * (field_at(waves, ax / length, ay / length) + field_at(waves, bx / length, by / length))
