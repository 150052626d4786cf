"""Videos and pictures of traces and worlds."""

from .divergence import check_same_mission, first_divergence
from .drape import Drape, coverage_drape
from .film import render_image, render_video
from .overview_figure import overview_figure

__all__ = [
    "Drape", "check_same_mission", "coverage_drape", "first_divergence", "overview_figure", "render_image", "render_video",
]  # fmt: skip
