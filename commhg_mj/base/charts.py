"""Figures: one look for all of them, drawn off screen. matplotlib is loaded by need, and its user's settings stay."""

from collections.abc import Callable
from functools import wraps

from .files import whole_file

DPI = 130
STYLE = {"font.size": 9, "axes.titlesize": 10, "axes.spines.top": False, "axes.spines.right": False, "axes.axisbelow": True}


def styled(draw: Callable) -> Callable:
    """Decorate what draws or writes a figure: within it matplotlib has our look."""

    @wraps(draw)
    def drawn(*args, **kwargs):
        import matplotlib

        with matplotlib.rc_context(STYLE):
            return draw(*args, **kwargs)

    return drawn


def new_figure(width: float, height: float, columns=1, **options) -> tuple:
    """(figure, axes) of a size in inches, for a `styled` function; several columns give an array of axes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(1, columns, **options)


@styled
def save_figure(figure, out) -> None:
    """Write a figure as PNG.

    Raises:
      ValueError: `out` cannot be written.
    """
    with whole_file(out) as part:
        figure.savefig(part, dpi=DPI, format="png")
