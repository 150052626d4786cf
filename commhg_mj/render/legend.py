"""The legend: one strip at the bottom that names every sign of the scene."""

import numpy as np

from ..base.terms import TaskType
from . import marks
from . import palette as ink

HEIGHT = 28
GAP = 13
EDGE = 8
PADDING = 12


def draw_legend(hud) -> None:
    """Draw the strip on the display's canvas, centred; what does not fit is left out."""
    entries, room = [], hud.width - 2 * (EDGE + PADDING) + GAP
    for width, draw in _entries(hud):
        room -= width + GAP
        if room >= 0:
            entries.append((width, draw))
    total = sum(width for width, _ in entries) + GAP * (len(entries) - 1) + 2 * PADDING
    x, y = (hud.width - total) / 2, hud.height - HEIGHT - EDGE
    hud.box(x, y, total, HEIGHT)
    x += PADDING
    for width, draw in entries:
        draw(x, y + HEIGHT / 2)
        x += width + GAP


def _entries(hud):
    """(width, draw(x, middle)) of each entry, in units."""
    canvas, u = hud.canvas, hud.unit

    def sign(name, draw):
        def entry(x, y):
            draw(np.array([(x + 6) * u, y * u]))
            hud.text(x + 17, y + 4, name, 11, ink.MUTED)

        return 17 + hud.measure(name, 11), entry

    def stroke(name, draw, length=22):
        def entry(x, y):
            draw(x * u, y * u, length * u)
            hud.text(x + length + 5, y + 4, name, 11, ink.MUTED)

        return length + 5 + hud.measure(name, 11), entry

    def links(x, y, length):
        for k in range(3):
            ends = np.array([(x + k * length / 3, y), (x + (k + 1) * length / 3, y)])
            canvas.lines([ends], ink.link_colour(1 - k / 2), 2 * u)

    def waiting(task_type):
        return lambda at: marks.draw_waiting(canvas, at, task_type, 5 * u)

    def changed(at):
        marks.draw_waiting(canvas, at, TaskType.GENERAL, 6 * u)
        marks.draw_changed(canvas, at, TaskType.UAV_ONLY, 6 * u, u)

    def overdue(at):
        marks.draw_overdue(canvas, at, 4 * u, u)

    def service(at):
        marks.draw_service(canvas, at, 1.5 * u, 0.7, u)

    def route(index):
        return lambda at: marks.draw_route_mark(canvas, at, (1, 0), index, ink.INK, u)

    def line(colour, width):
        return lambda x, y, length: canvas.lines([np.array([(x, y), (x + length, y)])], colour, width * u)

    return [
        sign("for UAVs", waiting(TaskType.UAV_ONLY)),
        sign("for UGVs", waiting(TaskType.UGV_ONLY)),
        sign("for both", waiting(TaskType.GENERAL)),
        sign("changed unseen", changed),
        sign("in service", service),
        sign("overdue", overdue),
        sign("done", lambda at: marks.draw_done(canvas, at, False, 5 * u, u)),
        stroke("assigned", line(ink.AIR[0], 2)),
        stroke("controlled by", line(ink.OPERATOR[0], 2)),
        stroke("link good to poor", links),
        sign("robots", route(0)),
        sign("up", route(1)),
        sign("down", route(2)),
    ]
