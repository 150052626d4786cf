"""Colours of the pictures: a restrained, colour-blind-safe set with one role for each hue.

Blue is air, orange is ground, pink is either: robots and the tasks that they may service share their hue.
Operators have hues of their own; a message's colour is its fate. Values are OpenCV's (blue, green, red).
"""

from ..base.terms import Activity, Fate
from ..models.mjcf import TYPE_COLOURS


def _bgr(code: str) -> tuple[int, int, int]:
    return int(code[4:6], 16), int(code[2:4], 16), int(code[0:2], 16)


INK = _bgr("F4F7FA")  # main text
MUTED = _bgr("A9B6C4")  # captions
PANEL = _bgr("10161F")
TROUGH = _bgr("3A4552")  # the empty part of a bar
GAINED = _bgr("35C9A5")
LATE = _bgr("F5B83D")  # lateness everywhere: overdue tasks, value lost to it
PRIVILEGED = _bgr("E86A92")
FAILED = _bgr("8C8C8C")
DIFFERENT = _bgr("FF4D9D")  # where two missions part

AIR = [_bgr(code) for code in ("56B4E9", "7CA7FF", "35D0E8", "8FD3FF", "4C8DF0", "9DB4FF", "2FB5C7", "B5DCFF")]
GROUND = [_bgr(code) for code in ("F39C3D", "FFC46B", "E87B35", "FFAE85", "D9A441", "FF8F5C", "F0C060", "E39A6F")]
TASK = {kind: tuple(round(255 * c) for c in reversed(rgb)) for kind, rgb in TYPE_COLOURS.items()}
OPERATOR = [_bgr(code) for code in ("F3E45C", "B79BFF", "5FE0A0", "FF8080", "E8C9A0", "C4F06A", "80E8E0", "FFFFFF")]

FATE = {
    Fate.UNDERWAY: _bgr("8E9AA8"),
    Fate.DELIVERED: _bgr("7DF0D0"),
    Fate.TERRAIN: _bgr("B98653"),
    Fate.LOST: _bgr("FF6B4A"),
    Fate.OUT_OF_RANGE: _bgr("8C7BD6"),
    Fate.NO_TOKENS: _bgr("7C8896"),
    Fate.EXPIRED: _bgr("E3D84B"),
}
FATE_NAME = {
    Fate.DELIVERED: "delivered",
    Fate.TERRAIN: "lost to terrain",
    Fate.LOST: "lost",
    Fate.OUT_OF_RANGE: "out of range",
    Fate.EXPIRED: "expired",
    Fate.NO_TOKENS: "no tokens",
}
ACTIVITY = {
    Activity.TRAVELLING: _bgr("6FA8DC"),
    Activity.SERVICING: _bgr("F4F7FA"),
    Activity.IDLE: _bgr("7C8896"),
    Activity.FAILED: _bgr("B4534B"),
}
LINK_GOOD, LINK_FAIR, LINK_POOR = _bgr("3FD0A0"), _bgr("E8D060"), _bgr("F0563C")


def robot_colour(robot: int, n_uav: int) -> tuple[int, int, int]:
    """Blues for UAVs, oranges for UGVs; shades repeat after eight."""
    return AIR[robot % len(AIR)] if robot < n_uav else GROUND[(robot - n_uav) % len(GROUND)]


def operator_colour(operator: int) -> tuple[int, int, int]:
    return OPERATOR[operator % len(OPERATOR)]


def link_colour(quality: float) -> tuple[float, ...]:
    """From poor to good for a delivery probability in [0, 1]."""
    low, high, t = (LINK_POOR, LINK_FAIR, 2 * quality) if quality < 0.5 else (LINK_FAIR, LINK_GOOD, 2 * quality - 1)
    return tuple(a + (b - a) * t for a, b in zip(low, high))
