"""Labels that do not pile up: the most important first, each beside its anchor or, pushed away, on a leader."""

from dataclasses import dataclass

import numpy as np

# Where a label's box may go, as directions from its anchor; farther ones get a leader line.
DIRECTIONS = [(1, -0.6), (-1, -0.6), (0, -1), (1, 0.7), (-1, 0.7), (0, 1)]
REACHES = (1.0, 2.6, 4.5)


@dataclass(frozen=True)
class Label:
    """A box of `width` x `height` pixels that wants to stand `gap` pixels off its anchor."""

    key: object
    anchor: tuple[float, float]
    width: float
    height: float
    gap: float
    priority: float


@dataclass(frozen=True)
class Place:
    """Where a label went: its box's left top corner, and which slot that was."""

    x: float
    y: float
    slot: int

    @property
    def is_far(self) -> bool:
        return self.slot >= len(DIRECTIONS)


def place_labels(labels, taken, size, previous=None, may_go_far=True) -> dict:
    """Greedy placement by priority; a label that fits nowhere is left out.

    Args:
      labels: the wanted `Label`s.
      taken: boxes (x0, y0, x1, y1) in pixels that must stay free.
      size: (width, height) of the picture in pixels.
      previous: slots by key of the picture before, tried first so that labels do not jump.
      may_go_far: whether a label may stand away from its anchor, on a leader.

    Returns:
      `Place` by key.
    """
    boxes = np.zeros((len(taken) + len(labels), 4))
    boxes[: len(taken)] = np.reshape(taken, (-1, 4))
    count, places = len(taken), {}
    for label in sorted(labels, key=lambda item: -item.priority):
        corners = _candidates(label)
        free = _is_free(corners, label, boxes[:count], size)
        free[len(DIRECTIONS) :] &= may_go_far
        wanted = (previous or {}).get(label.key, 0)
        if free.any():
            slot = wanted if free[wanted] else int(np.argmax(free))
            x, y = corners[slot]
            boxes[count] = x - 1, y - 1, x + label.width + 1, y + label.height + 1
            count += 1
            places[label.key] = Place(x, y, slot)
    return places


def _candidates(label):
    """Left top corners [slots, 2], nearest slots first."""
    half = np.array([label.width, label.height]) / 2
    corners = []
    for reach in REACHES:
        for direction in np.array(DIRECTIONS):
            away = np.sign(direction) * half + direction * label.gap * reach
            corners.append(label.anchor + away - half)
    return np.array(corners)


def _is_free(corners, label, boxes, size):
    """Which corners [slots, 2] put the label inside the picture and off all boxes [n, 4]."""
    ends = corners + [label.width, label.height]
    inside = np.all((corners >= 2) & (ends <= np.array(size) - 2), axis=1)
    apart = (
        (corners[:, None, 0] >= boxes[:, 2])
        | (ends[:, None, 0] <= boxes[:, 0])
        | (corners[:, None, 1] >= boxes[:, 3])
        | (ends[:, None, 1] <= boxes[:, 1])
    )
    return inside & apart.all(axis=1)
