"""The ray-cast link: what stands between two radios in MuJoCo's world, then a link budget (docs/radio.md)."""

import numpy as np

from ..base.kernels import kernel
from ..models.rays import CERTAIN, is_blocked, metres_in_canopies
from ..models.terrain import NOTHING, add_profile
from .losses import (
    bullington_loss,
    foliage_loss,
    free_space_loss,
    fresnel_parameter,
    knife_edge_loss,
    packet_error,
    weissberger_loss,
)
from .shadowing import shadowing_loss

APART = 1e-6  # m: radios nearer than this are in one place


@kernel
def way_length(a, b):
    """Metres between two points (x, y, z)."""
    return np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)


@kernel
def look(obstacles, wavelength, a, b, length):
    """What stands between two radios.

    Args:
      a, b: (x, y, z) [m], `length` apart.

    Returns:
      (is a mountain in the way, metres in canopies, diffraction parameter nu of the dominant edge, its share of the
      way from a, its height above the ray [m]); nu is -inf where no mountain comes near. As in P.526 heights are
      upright and distances along the way, which overrates nu of steep links (by 1/cos of the elevation).
    """
    horizon, blocked = NOTHING, False
    low = min(a[2], b[2]) - np.sqrt(wavelength * length)  # an edge deeper below the ray lets everything pass
    for i in range(obstacles.mountains.shape[0]):
        mountain = obstacles.mountains[i]
        if mountain.top > low:
            own = add_profile(mountain, a, b, NOTHING)
            if own[0] > -CERTAIN and not blocked:
                blocked = is_blocked(mountain, obstacles.calls[0], obstacles.ray[0], a, b, length)
            horizon = further(horizon, own)
    metres = metres_in_canopies(obstacles.canopies, obstacles.calls[0], obstacles.ray[0], obstacles.intervals, a, b, length)
    clearance, at, above = dominant_edge(horizon, blocked, length)
    return blocked, metres, fresnel_parameter(clearance, wavelength), at, above


@kernel
def further(horizon, other):
    """The horizon of two mountains."""
    nearer = horizon if horizon[3] >= other[3] else other
    return (
        max(horizon[0], other[0]), max(horizon[1], other[1]), max(horizon[2], other[2]), nearer[3], nearer[4],
    )  # fmt: skip


@kernel
def dominant_edge(horizon, blocked, length):
    """(clearance [√m], share of the way, height above the ray [m]) of the edge that counts.

    Of a blocked path the Bullington point, where the horizons seen from both ends meet (P.526, section 4.5.1); of an
    open one the point of the profile that comes nearest to the ray in Fresnel's measure.
    """
    _, from_a, from_b, clearance, at = horizon
    if not blocked or from_a <= 0.0 or from_b <= 0.0:
        clearance = min(clearance, 0.0)  # the ray decides: a grazing profile is no edge above it
        return clearance, at, clearance * np.sqrt(length * at * (1.0 - at))
    at = from_b / (from_a + from_b)
    above = from_a * at * length
    return above / np.sqrt(length * at * (1.0 - at)), at, above


@kernel
def foliage(radio, metres):
    """Loss [dB] in canopies."""
    if radio.is_weissberger:
        return weissberger_loss(metres, radio.frequency)
    return foliage_loss(metres, radio.foliage_rate, radio.foliage_limit)


@kernel
def diffraction(radio, nu, length):
    """Loss [dB] over mountains."""
    loss = knife_edge_loss(nu)
    return bullington_loss(loss, length) if radio.is_bullington and loss > 0.0 else loss


@kernel
def measure_rays(radio, obstacles, a, b, size, link):
    """Fill in a LINK: what stands between, what it loses, and the share of packets that passes.

    Args:
      radio, obstacles: of the mission's world.
      a, b: antennas (x, y, z) [m].
      size: of the packets [B].
    """
    length = way_length(a, b)
    link.metres = length
    if length < APART:
        link.passing = 1.0
        return
    link.is_blocked, link.forest, link.nu, link.edge_at, link.edge_height = look(obstacles, radio.wavelength, a, b, length)
    link.free_space = free_space_loss(length, radio.frequency)
    link.foliage = foliage(radio, link.forest)
    link.diffraction = diffraction(radio, link.nu, length)
    link.shadowing = 0.0
    if radio.shadowing > 0.0:
        link.shadowing = shadowing_loss(obstacles.waves, radio.shadowing, radio.shadowing_length, a[0], a[1], b[0], b[1])
    excess = link.foliage + link.diffraction + link.shadowing
    link.snr = radio.clear_snr - link.free_space - excess
    # Matched: over clear ground only the limitation level loses packets.
    link.passing = 1.0 if radio.exact_when_clear and excess == 0.0 else 1.0 - packet_error(link.snr, size)
