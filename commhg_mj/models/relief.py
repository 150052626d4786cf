"""A heightmap as mountains: few ellipses that cover its raised ground and little else.

Footprints of mountains are ellipses, and each carries a surface of so many nodes. So the raised ground is cut in two,
again and again, until the smallest ellipses around the pieces hold little free ground and are so small that a surface's
nodes lie as near to each other as the picture's pixels. Neighbours overlap along their cut: an ellipse holds every
corner of its cells, and every surface shows all the ground that its square meets. The ground is the highest surface,
so no cut shows.

Units here: pixels of the picture, rows and columns from the south-west; its nodes are the pixels' centres.
"""

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from ..heightmap import PIXELS, PLAIN, brightness

RAMP = 5  # pixels beyond the map's edge, on which ground that the edge cuts runs out into the plain
MOST_PARTS = 48
WIDEST = 15.0  # pixels: longest semi-axis, where MOST_PARTS allow
LOOSE = 0.25  # free ground inside ellipses, of the raised or of all free ground, at most where MOST_PARTS allow
ROUNDS = 40  # of the search for the smallest ellipse; its area is then 0.4 % too large on average
CORNERS = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])


@dataclass(frozen=True)
class Piece:
    """Cells [n, 2] (column, row of the lower corner) in the ellipse of all x with (x - centre)' shape⁻¹ (x - centre) <= 1."""

    cells: np.ndarray
    centre: np.ndarray
    shape: np.ndarray
    waste: int  # free cells in the ellipse

    @property
    def reach(self) -> float:
        """The longest semi-axis."""
        return np.sqrt(np.linalg.eigvalsh(self.shape)[-1])


def height_share(heightmap, xy) -> np.ndarray:
    """The ground's height, of white's, at xy [..., 2] in sides: bilinear between pixels, 0 on the plain."""
    from scipy.ndimage import map_coordinates  # a quarter of a second of every start; few need it

    x, y = np.moveaxis(np.asarray(xy, float) * PIXELS - 0.5 + RAMP, -1, 0)
    return map_coordinates(_nodes(heightmap), [y, x], order=1)


@lru_cache(maxsize=16)
def cover(heightmap) -> np.ndarray:
    """Ellipses [n, 5] (x, y, longer and shorter semi-axis, bearing of the longer) in sides that cover the raised ground."""
    cells, free = _raised_and_free(heightmap)
    pieces = [_enclose(cells, free)] if len(cells) else []
    allowed = LOOSE * min(len(cells), len(free))
    while 0 < len(pieces) < MOST_PARTS:
        waste, excess = [piece.waste for piece in pieces], [piece.reach - WIDEST for piece in pieces]
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
    """The smallest ellipse around all corners of the cells (Titterington's iteration), on a map with these free cells."""
    corners = (cells[:, None] + CORNERS).reshape(-1, 2)
    hull = cv2.convexHull(corners.astype(np.int32))[:, 0].astype(float)
    lifted, weights = np.c_[hull, np.ones(len(hull))], np.full(len(hull), 1 / len(hull))
    for _ in range(ROUNDS):
        moments = (lifted.T * weights) @ lifted
        weights *= _squares(lifted, moments) / 3
    centre = weights @ hull
    away = hull - centre
    shape = (away.T * weights) @ away
    shape *= _squares(away, shape).max()
    return Piece(cells, centre, shape, np.count_nonzero(_squares(free + 0.5 - centre, shape) < 1))


def _squares(x, shape):
    """x' shape⁻¹ x for every row of x."""
    return np.einsum("ij,ij->i", x @ np.linalg.inv(shape), x)


def _halves(piece):
    """Its cells in two, across the ellipse: between connected regions where there are some, else at the median."""
    column, row = (piece.cells - piece.cells.min(axis=0)).T
    mask = np.zeros((row.max() + 1, column.max() + 1), np.uint8)
    mask[row, column] = 1
    regions, labels = cv2.connectedComponents(mask)
    region = labels[row, column] - 1
    along = piece.cells @ np.linalg.eigh(piece.shape)[1][:, -1]
    places = np.bincount(region, along) / np.bincount(region)
    if np.ptp(places) > 0:  # regions stay whole, but for those around each other
        ordered = np.sort(places)
        first = places[region] <= ordered[np.diff(ordered).argmax()]
    else:
        first = np.zeros(len(along), bool)
        first[np.argsort(along, kind="stable")[: len(along) // 2]] = True
    return piece.cells[first], piece.cells[~first]


def _ellipse(piece):
    squares, axes = np.linalg.eigh(piece.shape)
    b, a = np.sqrt(squares)
    x, y = piece.centre + 0.5 - RAMP
    return *(np.array([x, y, a, b]) / PIXELS), np.arctan2(axes[1, 1], axes[0, 1])
