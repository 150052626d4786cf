"""The corner map: obstacles, tasks and robots from above, and what the camera sees of them."""

from itertools import pairwise

import cv2
import numpy as np

from ..base.terms import Activity
from . import marks
from . import palette as ink

FOREST, MOUNTAIN, PLAIN = (58, 84, 62), (112, 108, 104), (44, 54, 50)


class Minimap:
    """A square of `size` pixels whose left top corner is at (x, y)."""

    def __init__(self, trace, world, canvas, x, y, size, unit):
        self.trace, self.world, self.canvas = trace, world, canvas
        self.x, self.y, self.size, self.unit = x, y, size, unit
        ground = draw_ground(world.layout, size)
        self.background = np.dstack([ground, np.full((size, size), 255, np.uint8)])

    def pixels(self, xy) -> np.ndarray:
        """Where points xy [..., 2] of the map fall."""
        share = np.asarray(xy, float)[..., :2] / self.world.layout.side
        return np.stack([self.x + share[..., 0] * self.size, self.y + (1 - share[..., 1]) * self.size], axis=-1)

    def draw(self, moment, projection) -> None:
        canvas, unit, x, y, size = self.canvas, self.unit, self.x, self.y, self.size
        canvas.pixels[y : y + size, x : x + size] = self.background
        self._draw_view(projection)
        crowd = min(1.0, (60 / len(moment.released)) ** 0.5)
        for task in np.flatnonzero(moment.released):
            at = self.pixels(self.trace.task_xy[task])
            if moment.done[task]:
                canvas.disc(at, 1.2 * unit * crowd, ink.LATE if moment.overdue[task] else ink.GAINED, 0.8)
            else:
                marks.draw_waiting(canvas, at, self.trace.task_type[task], max(1.6, 3.0 * unit * crowd))
        self._draw_station()
        self._draw_robots(moment)

    def _draw_station(self):
        at = self.pixels(self.world.layout.station)
        self.canvas.polygon(at + 4 * self.unit * np.array([(0, -1), (1, 0), (0, 1), (-1, 0)]), ink.INK)

    def _draw_robots(self, moment):
        n_uav = self.trace.scenario.n_uav
        for i, at in enumerate(self.pixels(moment.xy)):
            if moment.task[i] >= 0:
                goal = self.pixels(self.trace.task_xy[moment.task[i]])
                self.canvas.lines([np.stack([at, goal])], ink.robot_colour(i, n_uav), self.unit, 0.55)
            colour = ink.FAILED if moment.activity[i] == Activity.FAILED else ink.robot_colour(i, n_uav)
            if moment.controller[i] >= 0:
                self.canvas.disc(at, 5 * self.unit, ink.operator_colour(moment.controller[i]))
            ahead = np.array([np.cos(moment.heading[i]), -np.sin(moment.heading[i])])
            marks.draw_robot(self.canvas, at, ahead, colour, 3.4 * self.unit, i < n_uav)

    def _draw_view(self, projection):
        """The part of the ground in the picture, outlined."""
        side = self.world.layout.side
        corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * [projection.width, projection.height]
        offsets = (corners - [projection.width / 2, projection.height / 2]) / projection.focal
        rays = np.c_[offsets, np.ones(4)] @ projection.axes
        # Rays at or above the horizon meet the ground far away.
        reach = np.where(rays[:, 2] < -1e-6, projection.position[2] / np.maximum(-rays[:, 2], 1e-6), np.inf)
        ground = projection.position[:2] + np.minimum(reach, 4 * side)[:, None] * rays[:, :2]
        for a, b in pairwise(self.pixels([*ground, ground[0]])):
            inside, start, end = cv2.clipLine((self.x, self.y, self.size, self.size), _whole(a), _whole(b))
            if inside:
                self.canvas.lines([np.array([start, end], float)], ink.INK, self.unit, 0.45)


def _whole(point):
    return tuple(int(v) for v in np.clip(point, -1e6, 1e6))


def draw_ground(layout, size, corner=(0.0, 0.0), side=None) -> np.ndarray:
    """Footprints on the plain, [size, size, 3], drawn at four times the size for smooth edges.

    Args:
      corner, side: left bottom corner and side [m] of the part of the map that is shown; by default all of it.
    """
    picture = np.full((4 * size, 4 * size, 3), PLAIN, np.uint8)
    scale = 4 * size / (side or layout.side)
    for parts, colour in ((layout.forests, FOREST), (layout.mountains, MOUNTAIN)):
        for part in parts:
            centre = ((part["x"] - corner[0]) * scale, 4 * size - (part["y"] - corner[1]) * scale)
            axes = (2 * part["a"] * scale, 2 * part["b"] * scale)
            cv2.ellipse(picture, (centre, axes, -np.degrees(part["angle"])), colour, -1)
    return cv2.resize(picture, (size, size), interpolation=cv2.INTER_AREA)
