"""The paper's case study drawn from a mission: three maps with captions, and a clip that says what happens when."""

from functools import partial

import numpy as np

from ..base.files import whole_file
from ..base.terms import Session
from ..models.world import make_world
from . import palette as ink
from .canvas import Canvas, text_width
from .chart import Chart, draw_beliefs, draw_truth
from .film import SHOWN_FOR, Film, write_film
from .scene import scene_of_trace
from .video import write_png

PANEL, GAP, EDGE = 600, 10, 16  # pixels
TITLE, TEXT, LINE = 20, 16, 24
MARGIN = 0.12  # of the maps' side, around what they must show
SIZE, STRIP, FPS, SPEED = (960, 540), 44, 20, 4.0  # of the clip; s of the mission per s
BEFORE, AFTER = 6, 30  # s of the mission around the case
RINGED = 6.0  # s of the mission: the robot is ringed so long after each caption


def draw_case(out, trace, case, captions: list) -> None:
    """Write the three-panel figure as PNG.

    Args:
      case: of replay/cases.py. captions: (second, title, lines) of each panel.

    Raises:
      ValueError: `out` cannot be written.
    """
    world = make_world(trace.scenario, trace.seed)
    corner, side = _window(world, trace, case)
    charts = [Chart(world, PANEL, corner, side, (case.robot, case.helped), case.operator) for _ in range(3)]
    _draw_expected(charts[0], case)
    _draw_asked(charts[1], trace, case)
    _draw_after(charts[2], trace, case)
    room = max(len(lines) for *_, lines in captions)
    panels = []
    for number, (chart, (second, title, lines)) in enumerate(zip(charts, captions), 1):
        panels.append(np.vstack([chart.picture(), _caption(f"{number}  {title}, {second} s", lines, room)]))
    gap = np.full((len(panels[0]), GAP, 3), ink.TROUGH, np.uint8)
    with whole_file(out) as part:
        write_png(part, np.hstack([panels[0], gap, panels[1], gap, panels[2]]))


def _window(world, trace, case):
    """(corner, side) [m] of the square that shows the station, both robots and both tasks, within the map."""
    seconds, robots = [case.asked.time, case.answered.time], [case.robot, case.helped]
    ways = trace.robot_xy[np.ix_(seconds, robots)].reshape(-1, 2)
    places = [world.layout.station, *trace.task_xy[[case.left, case.taken]], *ways]
    low, high = np.min(places, axis=0), np.max(places, axis=0)
    side = min(world.layout.side, (1 + 2 * MARGIN) * max(high - low))
    return np.clip((low + high - side) / 2, 0, world.layout.side - side), side


def _draw_expected(chart, case):
    """By its beliefs: whom it means to be helped by, at what."""
    asked, own = case.asked, case.asked.itself
    chart.control(case.operator, (own["x"], own["y"]), 14)
    draw_beliefs(chart, asked, {case.left: f", {asked.tasks['difficulty'][case.left]:.2f}"})
    _name_operator(chart, case, f"free, {asked.operators['age'][case.operator]:.0f} s ago")


def _draw_asked(chart, trace, case):
    """As things were when the operator replied."""
    second = int(case.replied)
    chart.ask(trace.robot_xy[second, case.robot])
    draw_truth(chart, scene_of_trace(trace, second), [case.left])
    chart.mark(trace.robot_xy[second, case.robot])
    _name_operator(chart, case, _does(trace, second, case.operator))


def _draw_after(chart, trace, case):
    """As things were when the choice had taken effect."""
    second = case.settled
    chart.plan(trace.robot_xy[second, case.robot], trace.task_xy[case.taken])
    draw_truth(chart, scene_of_trace(trace, second), [case.left, case.taken])
    _name_operator(chart, case, _does(trace, second, case.operator))


def _does(trace, second, operator):
    """What an operator is doing, in words."""
    session = trace.operator_session[second, operator]
    if session == Session.REST:
        return "free"
    verb = "controls" if session == Session.HELD else "calls"
    return f"{verb} {trace.scenario.robot_names[trace.operator_robot[second, operator]]}"


def _name_operator(chart, case, words):
    chart.label(chart.world.layout.station, f"H{case.operator} {words}", ink.operator_colour(case.operator), 4)


def _caption(title, lines, room):
    canvas = Canvas(PANEL, 2 * EDGE + TITLE + room * LINE)
    canvas.box(0, 0, canvas.width, canvas.height, ink.PANEL)
    canvas.text(EDGE, EDGE + TITLE - 4, title, TITLE, ink.INK, 600)
    for i, line in enumerate(lines):
        canvas.text(EDGE, EDGE + TITLE + (i + 1) * LINE - 2, line, TEXT, ink.INK)
    return canvas.pixels[..., :3]


def film_case(out, trace, case, captions: list, workers=2, progress=None) -> None:
    """Write a clip of the case as H.264; the same captions, each from its own second on, and the robot ringed.

    Raises:
      ValueError: `out` cannot be written.
      RuntimeError: OpenGL is missing.
    """
    said = [(second, " ".join(lines[:2])) for second, _, lines in captions]
    times = np.arange(max(0, case.asked.time - BEFORE), min(case.settled + AFTER, trace.ticks) + 1e-9, SPEED / FPS)
    film = partial(CaptionedFilm, trace, trace.scenario.robot_names[case.robot], said)
    write_film(out, film, times, (SIZE[0], SIZE[1] + STRIP), FPS, workers, progress)


class CaptionedFilm:
    """One trace's film under a strip that says what happens; `captions` are (second, text) in order of time."""

    def __init__(self, trace, actor, captions):
        self.film, self.actor, self.captions = Film(trace, "overview", SIZE, SHOWN_FOR * SPEED), actor, captions

    def picture(self, time: float) -> np.ndarray:
        """The picture at `time` [s] in blue, green, red."""
        past = [caption for caption in self.captions if caption[0] <= time]
        ringed = self.actor if past and time - past[-1][0] <= RINGED else None
        canvas = Canvas(SIZE[0], STRIP)
        canvas.box(0, 0, *SIZE, ink.PANEL)
        if past:
            size = min(TEXT, TEXT * (SIZE[0] - 2 * EDGE) / text_width(past[-1][1], TEXT, 500))
            canvas.text(EDGE, 0.64 * STRIP, past[-1][1], size, ink.INK, 500)
        return np.vstack([canvas.pixels[..., :3], self.film.picture(time, ringed)])

    def forget_labels(self) -> None:
        self.film.forget_labels()

    def close(self) -> None:
        self.film.close()
