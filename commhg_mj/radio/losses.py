"""The link budget's formulas, each with its source. Losses in dB; numbers inside kernels, arrays outside.

Sources: Recommendations ITU-R P.525 (free space), P.526 (diffraction), P.833 (vegetation); Weissberger, ESD-TR-81-101
(1982); Pei and Henderson, "Validation of OFDM error rate model in ns-3" (2010) with the NIST error rates.
"""

import numpy as np

from ..base.elementary_functions import erfc, exp, expm1, log1p, log10, power
from ..base.kernels import formula, kernel

LIGHT = 299_792_458.0  # m/s
THERMAL_NOISE = -174.0  # dBm/Hz at 290 K
FRESNEL_CLEAR = -0.78  # below this diffraction parameter an edge loses nothing (P.526, eq. 31)
NEAREST = 1.0  # m: free-space loss does not fall any further; nearer antennas are not in each other's far field


@formula
def wavelength(frequency):
    """Wavelength [m] of a carrier [GHz]."""
    return LIGHT / (1e9 * frequency)


@formula
def free_space_loss(metres, frequency):
    """Basic transmission loss [dB] over a clear way at a carrier [GHz] (P.525, eq. 2)."""
    return 20.0 * log10(4.0 * np.pi * max(metres, NEAREST) / wavelength(frequency))


@formula
def foliage_loss(metres, rate, limit):
    """Excess loss [dB] of a way through woodland (P.833-10, eq. 1).

    Args:
      metres: way inside the woodland [m].
      rate: specific attenuation of very short ways [dB/m].
      limit: the loss [dB] that long ways approach.
    """
    return limit * (1.0 - exp(-metres * rate / limit))


@formula
def weissberger_loss(metres, frequency):
    """Excess loss [dB] of a way through trees in leaf at 0.23-95 GHz, for up to 400 m (Weissberger 1982)."""
    scale = power(frequency, 0.284)
    return 0.45 * scale * metres if metres <= 14.0 else 1.33 * scale * power(metres, 0.588)


@formula
def fresnel_parameter(clearance, wavelength):
    """The diffraction parameter nu of an edge (P.526, eq. 26).

    Args:
      clearance: height of the edge above the ray times √(1/d1 + 1/d2) [√m], d1 and d2 its distances from the ends.
      wavelength: [m].
    """
    return clearance * np.sqrt(2.0 / wavelength)


@formula
def knife_edge_loss(nu):
    """Diffraction loss J [dB] over a single knife edge (P.526, eq. 31)."""
    if nu <= FRESNEL_CLEAR:
        return 0.0
    return 6.9 + 20.0 * log10(np.sqrt((nu - 0.1) ** 2 + 1.0) + nu - 0.1)


@formula
def bullington_loss(knife_edge, metres):
    """Diffraction loss [dB] of a path, from the loss over its Bullington point [dB] and its length [m] (P.526, eq. 54)."""
    return knife_edge + (1.0 - exp(-knife_edge / 6.0)) * (10.0 + 0.02e-3 * metres)


@formula
def noise_power(bandwidth, noise_figure):
    """Noise [dBm] of a receiver: bandwidth [MHz], noise figure [dB]."""
    return THERMAL_NOISE + 10.0 * log10(1e6 * bandwidth) + noise_figure


@formula
def packet_error(snr, size):
    """Share of packets lost at an SNR [dB]: 802.11 OFDM at 6 Mb/s (BPSK, convolutional code of rate 1/2), NIST form.

    Args:
      snr: signal to noise [dB].
      size: of the packet [B].
    """
    p = 0.5 * erfc(np.sqrt(power(10.0, 0.1 * snr)))
    d2 = 4.0 * p * (1.0 - p)  # the square of the Chernoff parameter D
    union = 36.0 + d2 * (211.0 + d2 * (1404.0 + d2 * (11633.0 + d2 * (77433.0 + d2 * (502690.0 + d2 * (
        3322763.0 + d2 * (21292910.0 + d2 * 134365911.0)))))))  # fmt: skip
    bit_error = min(1.0, 0.5 * d2**5 * union)
    return -expm1(8.0 * size * log1p(-bit_error)) if bit_error < 1.0 else 1.0


# Of numbers outside kernels: these are loaded from disk, whereas a formula's way with arrays is compiled in every process.


@kernel
def wavelength_of(frequency):
    """`wavelength` of a number."""
    return wavelength(frequency)


@kernel
def free_space_of(metres, frequency):
    """`free_space_loss` of numbers."""
    return free_space_loss(metres, frequency)


@kernel
def noise_of(bandwidth, noise_figure):
    """`noise_power` of numbers."""
    return noise_power(bandwidth, noise_figure)


@kernel
def error_of(snr, size):
    """`packet_error` of numbers."""
    return packet_error(snr, size)
