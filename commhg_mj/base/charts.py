"""Figures: one look for all of them, drawn off screen."""

from matplotlib.figure import Figure

from .files import whole_file

DPI = 130
STYLE = {"font.size": 9, "axes.titlesize": 10, "axes.spines.top": False, "axes.spines.right": False, "axes.axisbelow": True}


def new_figure(width: float, height: float, columns=1, **options) -> tuple:
    """(figure, axes) of a size in inches; several columns give an array of axes."""
    import matplotlib

    matplotlib.rcParams.update(STYLE)
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(1, columns, **options)


def save_figure(figure, out) -> None:
    """Write a figure as PNG.

    Raises:
      ValueError: `out` cannot be written.
    """
    with whole_file(out) as part:
        figure.savefig(part, dpi=DPI, format="png")
