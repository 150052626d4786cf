"""Two missions side by side, in step: the same world, flown under different conditions."""

import numpy as np

from . import palette as ink
from .canvas import Canvas, text_width
from .divergence import first_divergence

GAP = 4  # pixels between the panels
STRIP = 48  # height of the strip above them, in units: pixels of a 720p picture
TEXT = 21  # units
EDGE = 16  # units
RINGED = -1.0, 4.0  # s of video around the first different decision


def joined_size(size) -> tuple[int, int]:
    """(width, height) in pixels of a picture with two panels of `size`."""
    return 2 * size[0] + GAP, size[1] + _strip_height(size)


class PairFilm:
    """Makes the pictures of two films of `size` = (width, height) pixels, left and right under one strip.

    The strip says what differs between the missions and where their decisions part; the actor concerned is ringed.
    """

    def __init__(self, films, size, speed):
        self.films, self.size, self.speed = films, size, speed
        traces = [film.timeline.trace for film in films]
        self.captions = [_caption(*traces), _caption(*traces[::-1])]
        self.divergence = first_divergence(*traces)

    def picture(self, time: float) -> np.ndarray:
        """The picture at `time` [s] in blue, green, red; a mission that is over stays at its last moment."""
        ringed = self._ringed(time)
        left, right = (film.picture(min(time, film.timeline.ticks), ringed) for film in self.films)
        gap = np.full((len(left), GAP, 3), ink.TROUGH, np.uint8)
        return np.vstack([self._strip(time), np.hstack([left, gap, right])])

    def forget_labels(self) -> None:
        for film in self.films:
            film.forget_labels()

    def close(self) -> None:
        for film in self.films:
            film.close()

    def _ringed(self, time):
        """The actor whose decision differs, for some seconds of video around it."""
        if self.divergence and RINGED[0] <= (time - self.divergence.second) / self.speed <= RINGED[1]:
            return self.divergence.actor
        return None

    def _strip(self, time):
        """The captions at the ends and the banner between them, where there is room for them."""
        unit, width, height = _unit(self.size), joined_size(self.size)[0], _strip_height(self.size)
        canvas, size, edge, line = Canvas(width, height), TEXT * unit, EDGE * unit, 0.66 * height
        canvas.box(0, 0, width, height, ink.PANEL)
        beside = edge + max(text_width(caption, size, 600) for caption in self.captions)
        if 2 * beside < width:
            canvas.text(edge, line, self.captions[0], size, ink.INK, 600)
            canvas.text(width - edge, line, self.captions[1], size, ink.INK, 600, anchor=1.0)
        banner, colour, weight = self._banner(time)
        if text_width(banner, size, weight) < width - 2 * (beside + edge):
            canvas.text(width / 2, line, banner, size, colour, weight, anchor=0.5)
        return canvas.pixels[..., :3]

    def _banner(self, time):
        """(text, colour, weight)."""
        if self.divergence is None or time < self.divergence.second:
            return "same decisions so far", ink.MUTED, 400
        second, actor, left, right = self.divergence
        return f"decisions differ since {second} s: {actor}: {left} | {right}", ink.DIFFERENT, 500


def _unit(size):
    return max(0.75, min(size[0] / 1280, size[1] / 720))


def _strip_height(size):
    return 2 * round(STRIP * _unit(size) / 2)


def _caption(trace, other):
    """The link model of a trace, and what else sets it apart from the other one."""
    facts = [f"{trace.links} links"]
    facts += [f"{trace.policy} policy"] * (trace.policy != other.policy)
    facts += [f"{trace.limitation} limitation"] * (trace.limitation != other.limitation)
    return "  ·  ".join(facts)
