"""Elementary functions with the same bits on every processor.

A system's own exp or cos differs in the last bit between processors (fused multiply-add or not, SVML or not), libraries
and systems, and one last bit can turn a decision and so a whole mission. These use +, -, *, / alone, which IEEE 754
defines to the bit, in an order that stands here. Numbers inside kernels, arrays outside; errors below 2 units in the
last place but where a function says otherwise.

Sources: reductions and coefficients of exp, log, sin and cos as in Sun's fdlibm; erfc as a Chebyshev series in
2 / (2 + x) (Press et al., Numerical Recipes, section 6.2), coefficients computed to 40 digits.
"""

import numpy as np

from .kernels import formula, kernel

LN2_HIGH, LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
LN10 = 2.302585092994045684
EXP_SERIES = (
    1.66666666666666019037e-01, -2.77777777770155933842e-03, 6.61375632143793436117e-05, -1.65339022054652515390e-06,
    4.13813679705723846039e-08,
)  # fmt: skip
LOG_SERIES = (
    6.666666666666735130e-01, 3.999999999940941908e-01, 2.857142874366239149e-01, 2.222219843214978396e-01,
    1.818357216161805012e-01, 1.531383769920937332e-01, 1.479819860511658591e-01,
)  # fmt: skip
SIN_SERIES = (
    -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04, 2.75573137070700676789e-06,
    -2.50507602534068634195e-08, 1.58969099521155010221e-10,
)  # fmt: skip
COS_SERIES = (
    4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05, -2.75573143513906633035e-07,
    2.08757232129817482790e-09, -1.13596475577881948265e-11,
)  # fmt: skip
HALF_PI = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21)  # its parts, of 33 bits each
TWO_OVER_PI = 6.36619772367581382433e-01
ERFC_SERIES = (
    -1.302653719781709434, 0.6419697923564902603, 0.01947647320418583631, -0.009561514786808631642, -9.465953444820368663e-4,
    3.668394978527614519e-4, 4.252332480690777164e-5, -2.027857811253424315e-5, -1.624290004647025513e-6,
    1.303655835580523202e-6, 1.562644172206614318e-8, -8.523809591492654253e-8, 6.529054439098851496e-9,
    5.059343495551468942e-9, -9.913641564930330869e-10, -2.273651222931835854e-10, 9.64679110201552679e-11,
    2.394038083039114856e-12, -6.886027526497553499e-12, 8.944879273090726618e-13, 3.130921399342957288e-13,
    -1.12708223613672456e-13, 3.810905255188671793e-16, 7.106097613609281222e-15, -1.523028201457136593e-15,
    -9.457494571289210892e-17, 1.210237189224197959e-16, -2.816663087747582218e-17,
)  # fmt: skip
LOWEST, HIGHEST = -708.0, 709.0  # exponents whose exp is a normal number
SPLIT = 0x3FE6A09E00000000  # bits of √½, up to which a mantissa counts as below one


@kernel
def horner(x, series):
    """series[0] + series[1] x + series[2] x² + …"""
    total = 0.0
    for k in range(len(series) - 1, -1, -1):
        total = total * x + series[k]
    return total


@kernel
def power_of_two(k):
    """2^k, k in -1022..1023."""
    return np.int64((k + 1023) << 52).view(np.float64)


@formula
def exp(x):
    """e^x; 0 below -708, infinite above 709."""
    if not LOWEST <= x <= HIGHEST:
        return 0.0 if x < LOWEST else (np.inf if x > HIGHEST else x)
    k = np.floor(x / (LN2_HIGH + LN2_LOW) + 0.5)
    high, low = x - k * LN2_HIGH, k * LN2_LOW
    r = high - low
    square = r * r
    c = r - square * horner(square, EXP_SERIES)
    return (1.0 - ((low - r * c / (2.0 - c)) - high)) * power_of_two(np.int64(k))


@formula
def log(x):
    """Natural logarithm of a normal number; -inf of 0, nan below."""
    if not 0.0 < x < np.inf:
        return -np.inf if x == 0.0 else (x if x > 0.0 else np.nan)
    bits = np.float64(x).view(np.int64)
    k = (bits - SPLIT) >> 52
    f = np.int64(bits - (k << 52)).view(np.float64) - 1.0  # in √½ - 1 … √2 - 1
    s = f / (2.0 + f)
    square, half = s * s, 0.5 * f * f
    rest = square * horner(square, LOG_SERIES)
    return k * LN2_HIGH - ((half - (s * (half + rest) + k * LN2_LOW)) - f)


@formula
def log10(x):
    """Decimal logarithm."""
    return log(x) / LN10


@formula
def power(x, y):
    """x^y of a positive x; the error grows with y ln x."""
    return exp(y * log(x))


@formula
def log1p(x):
    """log(1 + x) without loss for small x (Kahan)."""
    u = 1.0 + x
    return x if u == 1.0 else log(u) * (x / (u - 1.0))


@formula
def expm1(x):
    """e^x - 1 without loss for small x (Kahan)."""
    u = exp(x)
    if u == 1.0:
        return x
    return (u - 1.0) * (x / log(u)) if 0.0 < u < np.inf else u - 1.0


@kernel
def quarter(x):
    """(number of quarter turns, what is left of x [rad] in -π/4 … π/4), for |x| up to a million."""
    n = np.floor(x * TWO_OVER_PI + 0.5)
    return np.int64(n), ((x - n * HALF_PI[0]) - n * HALF_PI[1]) - n * HALF_PI[2]


@kernel
def wave(n, r):
    """The sine of n quarter turns and r."""
    square = r * r
    if n & 1:
        value = 1.0 - (0.5 * square - square * square * horner(square, COS_SERIES))
    else:
        value = r + r * square * horner(square, SIN_SERIES)
    return -value if n & 2 else value


@formula
def sin(x):
    """Sine of x [rad], |x| up to a million."""
    n, r = quarter(x)
    return wave(n, r)


@formula
def cos(x):
    """Cosine of x [rad], |x| up to a million."""
    n, r = quarter(x)
    return wave(n + 1, r)


@kernel
def directions(angles):
    """(cosines, sines) of angles [n] [rad]: loaded from disk, whereas `cos` of an array is compiled in every process."""
    return cos(angles), sin(angles)


@formula
def erfc(x):
    """Complementary error function of x >= 0; relative error below 1e-14 up to x = 10."""
    t = 2.0 / (2.0 + x)
    y, d, dd = 4.0 * t - 2.0, 0.0, 0.0
    for k in range(len(ERFC_SERIES) - 1, 0, -1):  # Clenshaw's recurrence
        d, dd = y * d - dd + ERFC_SERIES[k], d
    return t * exp(0.5 * (ERFC_SERIES[0] + y * d) - dd - x * x)


@kernel
def distance(dx, dy):
    """Length of a planar vector, or of arrays of them: np.hypot's care about overflow costs ten times as much."""
    return np.sqrt(dx * dx + dy * dy)
