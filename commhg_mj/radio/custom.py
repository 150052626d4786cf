"""Link models of one's own: a Python function under a name, compiled when it is registered (docs/link_models.md).

Kernels call it through its address, like MuJoCo's rays: it is no part of them, and they stay valid on disk.
"""

import re
from collections.abc import Callable

import numba
import numpy as np
from numba import carray, types
from numba.core.errors import NumbaError
from numba.extending import intrinsic

from ..base.arguments import said
from ..base.kernels import kernel
from ..models.rays import WORD, call_address
from ..scenarios import LIMITATIONS, PROFILES
from ..scenarios.checks import NAME
from .abstract import MOUNTAIN, metres_inside
from .link_models import LINK, LINK_MODELS, OWN_MODELS
from .losses import free_space_loss
from .raycast import APART

NUMBER, RECORD = types.float64, numba.from_dtype(LINK)
POINT = types.UniTuple(NUMBER, 3)
_compiled = []  # every function ever registered, for good: batches hold their addresses


def link_model(name: str) -> Callable[[Callable], Callable]:
    """Register the decorated function as a link model; from then on its name is one in this process.

    >>> @commhg_mj.link_model("fading")
    ... def fading(a, b, size, link):
    ...     return math.exp(-link.metres / 400.0)

    The function says what share of packets of `size` [B] passes between antennas a and b, (x, y, z) [m]; `link` is the
    LINK record (radio/link_models.py) as rays fill it in. It must compile with numba; registering a name again replaces its
    function for batches made or reset afterwards.

    Raises:
      ValueError: the name is impossible or a built-in one, or the function does not compile to one that returns a number.
    """
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise ValueError(
            f"a link model's name must be up to 64 letters, digits, '-', '_' or '.', and begin with one, is {said(name)}"
        )
    taken = (*LINK_MODELS, *LIMITATIONS, *PROFILES)  # words of traces' file names
    if name in taken:
        raise ValueError(f"link model {name!r}: the name is taken, choose one other than {', '.join(taken)}")

    def register(function):
        _compiled.append(_compile(name, function))
        OWN_MODELS[name] = _compiled[-1].address
        return function

    return register


OWN_MODELS.adopt = lambda name, function: link_model(name)(function)


def _compile(name, function):
    """The function as C calls it."""
    try:
        # A division by zero is inf or nan, as in the package's kernels; whatever numba has decorated is decorated anew.
        share = numba.njit(error_model="numpy")(getattr(function, "py_func", function))
        share.compile((POINT, POINT, NUMBER, RECORD))
    except Exception as error:  # numba's own ones, and Python's from inside numba
        raise ValueError(f"link model {name!r} does not compile: {_reason(error)}") from error
    returned = types.unliteral(share.nopython_signatures[0].return_type)
    if not isinstance(returned, (types.Float, types.Integer, types.Boolean)):
        raise ValueError(f"link model {name!r} must return a number wherever it ends, returns {str(returned):.60}")

    @numba.cfunc(NUMBER(*[NUMBER] * 7, types.CPointer(RECORD)))
    def call(ax, ay, az, bx, by, bz, size, link):
        return share((ax, ay, az), (bx, by, bz), size, carray(link, 1)[0])

    return call


def _reason(error) -> str:
    """What numba's report begins with, in one line."""
    lines = [line.strip() for line in re.sub(r"\x1b\[[\d;]*m", "", str(error)).splitlines()]
    lines = [line for line in lines if line and "Failed in nopython mode" not in line] or [""]
    said = " ".join(lines[:2]) if lines[0].endswith(":") else lines[0]
    return said if isinstance(error, NumbaError) else f"{type(error).__name__}: {said}"


@intrinsic
def _share(typing_context, address, ax, ay, az, bx, by, bz, size, link):
    """The answer of the function at an address."""
    return NUMBER(WORD, *[NUMBER] * 7, link), call_address


@kernel
def ask(radio, obstacles, a, b, size, link):
    """Replace the share in a LINK that rays have filled in by the registered function's, in 0..1; nan counts as 0."""
    if link.metres < APART:
        fill_in_one_place(radio, link)
    link.mountain = metres_inside(obstacles.frames, obstacles.kinds, MOUNTAIN, a[0], a[1], b[0], b[1], obstacles.intervals)
    link.on_time, link.late = np.nan, np.nan  # not known yet, rather than another link's
    share = _share(radio.share_at, a[0], a[1], a[2], b[0], b[1], b[2], size, link)
    link.passing = min(share, 1.0) if share > 0.0 else 0.0


@kernel
def fill_in_one_place(radio, link):
    """Fill in a LINK of radios in one place, of which rays say nothing: a clear way."""
    link.is_blocked, link.forest = 0.0, 0.0
    link.nu, link.edge_at, link.edge_height = -np.inf, 0.5, -np.inf
    link.free_space = free_space_loss(link.metres, radio.frequency)
    link.foliage, link.diffraction, link.shadowing = 0.0, 0.0, 0.0
    link.snr = radio.clear_snr - link.free_space
