"""An overlay with premultiplied alpha: smooth lines, shapes, panels and text in pixels, pasted onto a picture."""

from functools import lru_cache

import cv2
import numpy as np

SHIFT = 4  # fractional bits of OpenCV's fixed-point coordinates
FAR = 1 << 14  # pixels: coordinates are clipped to this before they become fixed-point
_TURN = np.linspace(0, 2 * np.pi, 25)[:-1]
CIRCLE = np.stack([np.sin(_TURN), -np.cos(_TURN)], axis=-1)  # [24, 2] unit outline


def _fixed(points) -> np.ndarray:
    """Pixel-centre coordinates [..., 2] in OpenCV's fixed-point format."""
    return np.round((np.clip(points, -FAR, FAR) - 0.5) * (1 << SHIFT)).astype(np.int32)


def _ink(colour, alpha):
    return tuple(float(c) * alpha for c in colour) + (255.0 * alpha,)


class Canvas:
    """Draws in pixels, x right and y down; `alpha` is opacity in [0, 1]; new ink replaces older ink below it."""

    def __init__(self, width: int, height: int):
        self.width, self.height = width, height
        self.pixels = np.zeros((height, width, 4), np.uint8)

    def lines(self, pieces, colour, width=1.0, alpha=1.0) -> None:
        """Polylines, each [k, 2]."""
        pieces = [_fixed(p).reshape(-1, 1, 2) for p in pieces if len(p) > 1]
        if pieces:
            thickness = max(1, round(width))
            # Thinner than a pixel cannot be drawn: fainter looks the same.
            ink = _ink(colour, alpha * min(1.0, width))
            cv2.polylines(self.pixels, pieces, False, ink, thickness, cv2.LINE_AA, SHIFT)

    def polygon(self, points, colour, alpha=1.0) -> None:
        """A filled convex polygon [k, 2]."""
        cv2.fillConvexPoly(self.pixels, _fixed(points), _ink(colour, alpha), cv2.LINE_AA, SHIFT)

    def outline(self, points, colour, width=1.0, alpha=1.0) -> None:
        self.lines([np.concatenate([points, points[:1]])], colour, width, alpha)

    def disc(self, centre, radius, colour, alpha=1.0) -> None:
        # OpenCV's own small circles look like diamonds.
        self.polygon(np.asarray(centre) + radius * CIRCLE, colour, alpha)

    def ring(self, centre, radius, colour, width=1.0, alpha=1.0, part=1.0) -> None:
        """A circle, or the clockwise `part` of it from the top."""
        if part > 0:
            turn = np.linspace(0, 2 * np.pi * min(1.0, part), max(3, int(28 * part) + 1))
            arc = np.stack([np.sin(turn), -np.cos(turn)], axis=-1) * radius + centre
            self.lines([arc], colour, width, alpha)

    def bar(self, x, y, width, height, parts, trough=None) -> None:
        """A horizontal bar of (share of the width, colour) from left to right over a trough."""
        if trough is not None:
            self.box(x, y, width, height, trough)
        for share, colour in parts:
            if share > 0:
                self.box(x, y, share * width, height, colour)
                x += share * width

    def box(self, x, y, width, height, colour, alpha=1.0) -> None:
        """An upright rectangle, to the nearest pixels."""
        x0, y0, x1, y1 = (max(0, round(v)) for v in (x, y, x + width, y + height))
        self.pixels[y0:y1, x0:x1] = _ink(colour, alpha)

    def panel(self, x, y, width, height, colour, alpha=0.7, radius=6.0) -> None:
        """A box with round corners."""
        radius = min(radius, width / 2, height / 2)
        turn = np.linspace(0, np.pi / 2, 9)
        corner = np.stack([np.cos(turn), np.sin(turn)], axis=-1) * radius
        ends = [(x + width, y + height, 1, 1), (x, y + height, -1, 1), (x, y, -1, -1), (x + width, y, 1, -1)]
        rounded = [corner[:: i * j] * (i, j) + (cx - i * radius, cy - j * radius) for cx, cy, i, j in ends]
        self.polygon(np.concatenate(rounded), colour, alpha)

    def text(self, x, baseline, string, size, colour, weight=400, anchor=0.0, halo=0.0) -> float:
        """A line of text; `anchor` is the share of its width left of x, `halo` darkens a rim around it.

        Returns:
          its width in pixels.
        """
        size = max(8, round(size))
        mask, rim, rise, advance = _sprite(string, size, weight, halo > 0)
        left, top = round(x - anchor * advance) - 2, round(baseline) - rise
        if halo:
            self._stamp(rim, left, top, (0, 0, 0), halo)
        self._stamp(mask, left, top, colour, 1.0)
        return advance

    def _stamp(self, mask, left, top, colour, alpha):
        """Blend ink over what is there, through a mask [h, w] in [0, 1]."""
        x0, y0 = max(0, left), max(0, top)
        x1, y1 = min(self.width, left + mask.shape[1]), min(self.height, top + mask.shape[0])
        if x0 < x1 and y0 < y1:
            cover = mask[y0 - top : y1 - top, x0 - left : x1 - left, None] * np.float32(alpha)
            below = self.pixels[y0:y1, x0:x1]
            below[...] = below * (1 - cover) + cover * np.array([*colour, 255], np.float32) + 0.5

    def paste(self, picture: np.ndarray) -> np.ndarray:
        """The picture [height, width, 3] with this canvas over it."""
        clear = cv2.cvtColor(cv2.bitwise_not(cv2.extractChannel(self.pixels, 3)), cv2.COLOR_GRAY2BGR)
        return cv2.add(cv2.multiply(picture, clear, scale=1 / 255), cv2.cvtColor(self.pixels, cv2.COLOR_BGRA2BGR))


@lru_cache(maxsize=1)
def _font():
    return cv2.FontFace("sans")


def text_width(string: str, size: float, weight=400) -> int:
    """Width [pixels] of a line of text."""
    return _sprite(string, max(8, round(size)), weight, False)[3]


@lru_cache(maxsize=4096)
def _sprite(string, size, weight, with_rim):
    """(mask, rim, rows above the baseline, advance) of a line of text; masks [h, w] in [0, 1]."""
    rise = size + 3
    image = np.zeros((round(1.5 * size) + 6, size * (len(string) + 1) + 8), np.uint8)
    (end, _), image = cv2.putText(image, string, (2, rise), (255,), _font(), size, weight)
    image = image[:, : end + 3]
    rim = None
    if with_rim:
        rim = cv2.GaussianBlur(cv2.dilate(image, np.ones((3, 3), np.uint8)), (0, 0), 1.0) / np.float32(255)
    return image / np.float32(255), rim, rise, end - 2
