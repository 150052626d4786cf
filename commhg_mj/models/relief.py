"""A heightmap as mountains: few ellipses that cover its raised ground and little else.

Footprints of mountains are ellipses, and each carries a surface of so many nodes. So the raised ground is cut in two,
again and again, until the smallest ellipses around the pieces hold little free ground and are so small that a surface's
nodes lie as near to each other as the picture's pixels. Neighbours overlap along their cut: an ellipse holds every
corner of its cells, and every surface shows all the ground that its square meets. The ground is the highest surface,
so no cut shows.

One last bit would move a cut and so all that follows: sums run in the order that stands here, and roots are the only
functions.

Units here: pixels of the picture, rows and columns from the south-west; its nodes are the pixels' centres.
"""

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from ..base.kernels import kernel
from ..scenarios.heightmap import PIXELS, PLAIN, bilinear, brightness

RAMP = 5  # pixels beyond the map's edge, on which ground that the edge cuts runs out into the plain
MOST_PARTS = 48
WIDEST = 15.0  # pixels: longest semi-axis, where MOST_PARTS allow
LOOSE = 0.25  # free ground inside ellipses, of the raised or of all free ground, at most where MOST_PARTS allow
ROUNDS = 40  # of the search for the smallest ellipse; its area is then 0.4 % too large on average
CORNERS = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])


@dataclass(frozen=True)
class Piece:
    """Cells [n, 2] (column, row of the lower corner) and an ellipse around them."""

    cells: np.ndarray
    centre: tuple  # (x, y)
    shape: tuple  # (xx, xy, yy) of the matrix S: the ellipse is all x with (x - centre)' S⁻¹ (x - centre) <= 1
    waste: int  # free cells in the ellipse

    @property
    def semi_axes(self) -> tuple[float, float]:
        """The longer and the shorter one: roots of S's eigenvalues."""
        middle, away, _ = self._moments()
        return np.sqrt(middle + away), np.sqrt(middle - away)

    @property
    def axis(self) -> tuple[float, float]:
        """A vector along the longer axis: S's eigenvector, of any length."""
        _, away, along = self._moments()
        if away == 0.0:
            return 1.0, 0.0
        xy = self.shape[1]
        return (along + away, xy) if along >= 0 else (xy, away - along)

    def _moments(self):
        """(half the sum of S's eigenvalues, half their difference, half the difference of its diagonal)."""
        xx, xy, yy = self.shape
        along = (xx - yy) / 2
        return (xx + yy) / 2, np.sqrt(along * along + xy * xy), along


def height_share(heightmap, xy) -> np.ndarray:
    """The ground's height, of white's, at xy [..., 2] in sides: bilinear between pixels, 0 on the plain."""
    return bilinear(_nodes(heightmap), *np.moveaxis(np.asarray(xy, float) * PIXELS - 0.5 + RAMP, -1, 0))


@lru_cache(maxsize=16)
def cover(heightmap) -> np.ndarray:
    """Ellipses [n, 5] (x, y, longer and shorter semi-axis, bearing of the longer) in sides that cover the raised ground."""
    cells, free = _raised_and_free(heightmap)
    pieces = [_enclose(cells, free)] if len(cells) else []
    allowed = LOOSE * min(len(cells), len(free))
    while 0 < len(pieces) < MOST_PARTS:
        waste, excess = [piece.waste for piece in pieces], [piece.semi_axes[0] - WIDEST for piece in pieces]
        worst = int(np.argmax(waste if sum(waste) > allowed else excess))  # open ground first, then fine surfaces
        if (sum(waste) <= allowed and excess[worst] <= 0) or len(pieces[worst].cells) == 1:
            break
        pieces += [_enclose(half, free) for half in _halves(pieces.pop(worst))]
    return np.array([_ellipse(piece) for piece in pieces]).reshape(-1, 5)


def _nodes(heightmap):
    """Heights, of white's, at the pixels' centres and RAMP beyond the map."""
    share = brightness(heightmap)
    return np.pad(np.where(share > PLAIN, share, 0.0), RAMP, mode="linear_ramp")


def _raised_and_free(heightmap):
    """Cells [n, 2] between four nodes of which one is raised, so that nothing else is; and the others on the map."""
    raised = _nodes(heightmap) > 0
    raised = raised[:-1, :-1] | raised[:-1, 1:] | raised[1:, :-1] | raised[1:, 1:]
    on_map = np.zeros_like(raised)
    on_map[RAMP:-RAMP, RAMP:-RAMP] = True
    return np.argwhere(raised)[:, ::-1], np.argwhere(on_map & ~raised)[:, ::-1]


def _enclose(cells, free) -> Piece:
    """The smallest ellipse around all corners of the cells, on a map with these free cells."""
    corners = (cells[:, None] + CORNERS).reshape(-1, 2)
    hull = cv2.convexHull(corners.astype(np.int32))[:, 0].astype(float)
    centre, shape = smallest_ellipse(hull)
    return Piece(cells, centre, shape, count_inside(np.ascontiguousarray(free), centre, shape))


@kernel
def smallest_ellipse(points):
    """(centre, shape) of the smallest ellipse around points [n, 2], not all on one line (Titterington's iteration)."""
    weights = np.full(points.shape[0], 1.0 / points.shape[0])
    for _ in range(ROUNDS):
        centre, shape = spread(points, weights)
        for i in range(points.shape[0]):
            weights[i] *= (1.0 + square(points[i, 0] - centre[0], points[i, 1] - centre[1], shape)) / 3.0
    centre, shape = spread(points, weights)
    most = 0.0
    for i in range(points.shape[0]):
        most = max(most, square(points[i, 0] - centre[0], points[i, 1] - centre[1], shape))
    return centre, (most * shape[0], most * shape[1], most * shape[2])


@kernel
def spread(points, weights):
    """Weighted mean (x, y) and covariance (xx, xy, yy) of points [n, 2]; the weights sum to 1."""
    x, y, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(points.shape[0]):
        x += weights[i] * points[i, 0]
        y += weights[i] * points[i, 1]
    for i in range(points.shape[0]):
        dx, dy = points[i, 0] - x, points[i, 1] - y
        xx += weights[i] * dx * dx
        xy += weights[i] * dx * dy
        yy += weights[i] * dy * dy
    return (x, y), (xx, xy, yy)


@kernel
def square(dx, dy, shape):
    """(dx, dy) S⁻¹ (dx, dy)' of the matrix S = [[xx, xy], [xy, yy]]."""
    xx, xy, yy = shape
    return (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy)


@kernel
def count_inside(cells, centre, shape):
    """How many of the cells [n, 2] have their middle in an ellipse."""
    count = 0
    for i in range(cells.shape[0]):
        count += square(cells[i, 0] + 0.5 - centre[0], cells[i, 1] + 0.5 - centre[1], shape) < 1.0
    return count


def _halves(piece):
    """Its cells in two, across the ellipse: between connected regions where there are some, else at the median."""
    column, row = (piece.cells - piece.cells.min(axis=0)).T
    mask = np.zeros((row.max() + 1, column.max() + 1), np.uint8)
    mask[row, column] = 1
    regions, labels = cv2.connectedComponents(mask)
    region = labels[row, column] - 1
    x, y = piece.axis
    along = piece.cells[:, 0] * x + piece.cells[:, 1] * y
    places = np.bincount(region, along) / np.bincount(region)
    if np.ptp(places) > 0:  # regions stay whole, but for those around each other
        ordered = np.sort(places)
        first = places[region] <= ordered[np.diff(ordered).argmax()]
    else:
        first = np.zeros(len(along), bool)
        first[np.argsort(along, kind="stable")[: len(along) // 2]] = True
    return piece.cells[first], piece.cells[~first]


def _ellipse(piece):
    x, y = piece.centre
    a, b = piece.semi_axes
    return (x + 0.5 - RAMP) / PIXELS, (y + 0.5 - RAMP) / PIXELS, a / PIXELS, b / PIXELS, np.arctan2(*piece.axis[::-1])
