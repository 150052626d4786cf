"""The picture of what a robot knew: the map as it believed it beside the true one, and the operators below."""

import numpy as np

from ..base.files import whole_file
from ..base.terms import NOBODY, TaskType
from . import marks
from . import palette as ink
from .canvas import Canvas, text_width
from .chart import Chart, draw_beliefs, draw_truth, opacity
from .scene import scene_of_state
from .video import write_png

MAP, GAP = 800, 12  # pixels
EDGE, LINE, TEXT = 18, 30, 17
N_NAMED = 5  # tasks that are named with their probability, the most preferred ones


def knowledge_picture(world, decision, preferences, title: str, operators: list, last: str) -> np.ndarray:
    """The picture in blue, green, red.

    Args:
      decision: of replay/replayer.py. preferences: of its task head, or None.
      operators: (belief, truth) in words, one pair an operator.
      last: line at the bottom.
    """
    believed, true = Chart(world, MAP), Chart(world, MAP)
    notes = _notes(decision, preferences)
    draw_beliefs(believed, decision, notes)
    scene = scene_of_state(*decision.truth[:3])
    draw_truth(true, scene, notes)
    if decision.plan != NOBODY:
        true.mark(scene.task_xy[decision.plan])
    gap = np.full((MAP, GAP, 3), ink.TROUGH, np.uint8)
    maps = np.hstack([believed.picture(), gap, true.picture()])
    return np.vstack([_head(title), maps, _foot(decision, operators, last)])


def draw_knowledge(out, *arguments) -> None:
    """Write `knowledge_picture` as PNG.

    Raises:
      ValueError: `out` cannot be written.
    """
    with whole_file(out) as part:
        write_png(part, knowledge_picture(*arguments))


def _notes(decision, preferences) -> dict:
    """What is written beside the tasks that matter: the most preferred ones, the plan, and the one held."""
    held, plan = int(decision.itself["task"]), decision.plan
    if preferences is None:
        return {j: " held" if j == held else "" for j in (plan, held) if j != NOBODY}
    best = np.argsort(-preferences.task, kind="stable")[:N_NAMED]
    notes = {int(j): f" {preferences.task[j]:.0%}" for j in (*best, plan) if j != NOBODY and preferences.task[j] > 0}
    return notes | ({held: f" KEEP {preferences.keep:.0%}"} if held != NOBODY else {})


def _head(title):
    canvas = Canvas(2 * MAP + GAP, 2 * LINE + EDGE)
    canvas.box(0, 0, canvas.width, canvas.height, ink.PANEL)
    canvas.text(EDGE, LINE, title, TEXT + 2, ink.INK, 600)
    for x, name in ((EDGE, "what it believed"), (MAP + GAP + EDGE, "the truth")):
        canvas.text(x, 2 * LINE + 4, name, TEXT, ink.MUTED, 500)
    return canvas.pixels[..., :3]


def _foot(decision, operators, last):
    """The operators on either side, then the signs, then the choice."""
    n_unknown = int((decision.peers["age"] < 0).sum()) - 1  # a robot holds no record of itself
    lines = len(operators) + 2
    canvas = Canvas(2 * MAP + GAP, lines * LINE + EDGE)
    canvas.box(0, 0, canvas.width, canvas.height, ink.PANEL)
    for h, sides in enumerate(operators):
        for x, words in zip((EDGE, MAP + GAP + EDGE), sides):
            y = h * LINE + 18
            width = marks.draw_badge(canvas, x, y, h, TEXT - 2)
            canvas.text(x + width + 10, y + 6, words, TEXT, ink.INK)
    y = len(operators) * LINE + 24
    x = _draw_signs(canvas, EDGE, y)
    if n_unknown > 0:
        canvas.text(x, y, f"{n_unknown} of {len(decision.peers) - 1} robots never heard of", TEXT, ink.MUTED)
    canvas.text(EDGE, y + LINE, last, TEXT, ink.INK, 600)
    return canvas.pixels[..., :3]


def _draw_signs(canvas, x, y):
    """The legend of ages and shapes; returns where it ends."""
    for age, words in ((0, "just heard"), (60, "60 s old"), (240, "240 s old"), (None, "unknown: never heard")):
        at = np.array([x + 7, y - 6])
        if age is None:
            canvas.outline(at + 7 * marks.SHAPES[TaskType.GENERAL], ink.TASK[TaskType.GENERAL], 1.5)
        else:
            marks.draw_waiting(canvas, at, TaskType.GENERAL, 7, opacity(age))
        canvas.text(x + 22, y, words, TEXT, ink.MUTED)
        x += text_width(words, TEXT) + 48
    for kind, words in ((TaskType.UAV_ONLY, "for UAVs"), (TaskType.UGV_ONLY, "for UGVs"), (TaskType.GENERAL, "for both")):
        marks.draw_waiting(canvas, np.array([x + 7, y - 6]), kind, 7)
        canvas.text(x + 22, y, words, TEXT, ink.MUTED)
        x += text_width(words, TEXT) + 48
    canvas.ring((x + 8, y - 6), 9, ink.DIFFERENT, 2.5)
    canvas.text(x + 24, y, "its plan", TEXT, ink.MUTED)
    return x + text_width("its plan", TEXT) + 60
