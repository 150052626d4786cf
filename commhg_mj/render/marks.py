"""Signs that scene, map and legend share: tasks by type and state, robots, messages by route."""

import numpy as np

from ..base.terms import TaskType
from . import palette as ink
from .canvas import CIRCLE, text_width

SHAPES = {  # unit outlines: y down
    TaskType.UAV_ONLY: np.array([(0, -1.25), (1.25, 0), (0, 1.25), (-1.25, 0)]),
    TaskType.UGV_ONLY: np.array([(-0.85, -0.85), (0.85, -0.85), (0.85, 0.85), (-0.85, 0.85)]),
    TaskType.GENERAL: CIRCLE,
}
TICK = np.array([(-0.8, 0.05), (-0.2, 0.7), (0.9, -0.7)])


def draw_waiting(canvas, at, task_type, radius, alpha=1.0) -> None:
    """An open task: its type's shape, filled."""
    shape = at + radius * SHAPES[TaskType(task_type)]
    canvas.polygon(at + (radius + 1.2) * SHAPES[TaskType(task_type)], ink.PANEL, 0.75 * alpha)
    canvas.polygon(shape, ink.TASK[TaskType(task_type)], alpha)


def draw_overdue(canvas, at, radius, unit, alpha=1.0) -> None:
    canvas.ring(at, radius + 2.6 * unit, ink.LATE, 1.6 * unit, alpha)


def draw_changed(canvas, at, new_type, radius, unit, alpha=1.0) -> None:
    """The hidden change: the type that the task has really got, inside the announced one."""
    canvas.polygon(at + 0.78 * radius * SHAPES[TaskType(new_type)], ink.PANEL, alpha)
    canvas.polygon(at + 0.55 * radius * SHAPES[TaskType(new_type)], ink.TASK[TaskType(new_type)], alpha)


def draw_service(canvas, at, radius, progress, unit) -> None:
    """A ring that closes with the task's progress."""
    canvas.ring(at, radius + 4.5 * unit, ink.PANEL, 4.2 * unit, 0.7)
    canvas.ring(at, radius + 4.5 * unit, ink.INK, 2.2 * unit, 1.0, part=progress)


def draw_done(canvas, at, late, radius, unit, alpha=1.0) -> None:
    canvas.lines([at + 0.9 * radius * TICK], ink.PANEL, 3.4 * unit, 0.5 * alpha)
    canvas.lines([at + 0.9 * radius * TICK], ink.LATE if late else ink.GAINED, 1.6 * unit, alpha)


def draw_task(canvas, at, moment, trace, task, radius, unit, alpha=1.0) -> None:
    """A released task in its present state."""
    if moment.done[task]:
        draw_done(canvas, at, moment.overdue[task], 0.8 * radius, unit, 0.85 * alpha)
        return
    if moment.overdue[task]:
        draw_overdue(canvas, at, radius, unit, alpha)
    draw_waiting(canvas, at, trace.task_type[task], radius, alpha)
    if moment.changed[task]:
        draw_changed(canvas, at, trace.task_changed_to[task], radius, unit, alpha)
    if moment.serviced_by[task] >= 0:
        draw_service(canvas, at, radius, moment.progress[moment.serviced_by[task]], unit)


def draw_robot(canvas, at, ahead, colour, radius, is_aerial, alpha=1.0) -> None:
    """A robot: an arrowhead for the air, a blunt block for the ground, pointing along `ahead` (a unit vector)."""
    side = np.array([-ahead[1], ahead[0]])
    if is_aerial:
        shape = [(1.35, 0), (-0.9, 0.95), (-0.45, 0), (-0.9, -0.95)]
    else:
        shape = [(1.15, 0), (0.45, 0.8), (-0.95, 0.8), (-0.95, -0.8), (0.45, -0.8)]
    outline = np.array([at + radius * (f * ahead + s * side) for f, s in shape])
    rim = at + (outline - at) * (1 + 1.6 / radius)
    for points, fill in ((rim, ink.PANEL), (outline, colour)):
        # The arrowhead is not convex: its two halves are.
        canvas.polygon(points[[0, 1, 2]] if is_aerial else points, fill, alpha)
        if is_aerial:
            canvas.polygon(points[[0, 2, 3]], fill, alpha)


def draw_route_mark(canvas, at, ahead, route, colour, unit, alpha=1.0) -> None:
    """A message: a dot between robots, an arrowhead climbing the uplink, a bar across coming down."""
    at, ahead = np.asarray(at, float), np.asarray(ahead, float)
    side = np.array([-ahead[1], ahead[0]])
    if route == 0:
        canvas.disc(at, 2.4 * unit, colour, alpha)
    elif route == 1:
        barbs = 3.2 * side - 2.6 * ahead, -3.2 * side - 2.6 * ahead
        canvas.polygon(at + unit * np.array([4.6 * ahead, *barbs]), colour, alpha)
    else:
        canvas.lines([np.array([at - 4 * unit * side, at + 4 * unit * side])], colour, 2.4 * unit, alpha)


def draw_boundary(canvas, projection, side, width) -> None:
    """The edge of the map, a thin line on the plain."""
    corners = np.array([(0, 0, 0), (side, 0, 0), (side, side, 0), (0, side, 0), (0, 0, 0)], float)
    canvas.lines(projection.polyline(corners), ink.INK, width, 0.22)


def draw_cross(canvas, at, radius, colour, width, alpha=1.0) -> None:
    arm = np.array([(-1, -1), (1, 1)]) * radius
    canvas.lines([at + arm, at + arm * (1, -1)], colour, width, alpha)


def draw_badge(canvas, x, y, operator, size) -> float:
    """An operator's chip, its left middle at pixels (x, y); returns its width."""
    name = f"H{operator}"
    width = text_width(name, size, 700) + 0.7 * size
    canvas.panel(x, y - 0.72 * size, width, 1.44 * size, ink.operator_colour(operator), 1.0, 0.4 * size)
    canvas.text(x + width / 2, y + 0.38 * size, name, size, ink.PANEL, 700, anchor=0.5)
    return width
