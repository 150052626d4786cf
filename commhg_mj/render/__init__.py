"""Videos and pictures of traces and worlds."""

from .figure import overview_figure
from .film import render_image, render_video

__all__ = ["overview_figure", "render_image", "render_video"]
