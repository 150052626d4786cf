"""A map from above on which beliefs and truths are drawn: old records fade, unknown ones are hollow."""

import numpy as np

from ..base.terms import NOBODY, Activity, Session, Status, TaskType
from . import marks
from . import palette as ink
from .canvas import Canvas, text_width
from .labels import Label, place_labels
from .minimap import draw_ground
from .scene import Scene

FADE = 90.0  # s: a record's ink fades as exp(-age / FADE)
FAINTEST = 0.25
BACKGROUND = 0.35  # opacity of robots that the picture is not about
TEXT = 15  # pixels
TASK, ROBOT = 6.0, 8.0  # pixels


def opacity(age: float) -> float:
    """Of a record `age` seconds old."""
    return FAINTEST + (1 - FAINTEST) * float(np.exp(-max(age, 0.0) / FADE))


class Chart:
    """A square picture of `size` pixels of a world.

    Args:
      corner, side: left bottom corner and side [m] of the part of the map that is shown; by default all of it.
      robots, operator: those that it is about; others stay in the background. By default it is about all.
    """

    def __init__(self, world, size: int, corner=(0.0, 0.0), side=None, robots=None, operator=None):
        self.world, self.size, self.corner, self.side = world, size, np.asarray(corner), side or world.layout.side
        self.robots = range(world.scenario.n_robots) if robots is None else robots
        self.operators = range(world.scenario.n_operators) if operator is None else [operator]
        self.ground = draw_ground(world.layout, size, corner, self.side)
        self.canvas = Canvas(size, size)
        self.labels, self.inks = [], {}
        crowd = min(1.0, (60 / world.scenario.n_tasks) ** 0.3) if self.side == world.layout.side else 1.0
        self.task_size, self.robot_size = TASK * crowd, ROBOT * crowd

    def pixels(self, xy) -> np.ndarray:
        """Where points xy [..., 2] m fall."""
        share = (np.asarray(xy, float) - self.corner) / self.side
        return np.stack([share[..., 0], 1 - share[..., 1]], axis=-1) * self.size

    def believed_task(self, xy, row) -> None:
        """A row of TASK_SEEN."""
        if row["age"] < 0:
            at, shape = self.pixels(xy), marks.SHAPES[TaskType(row["type"])]
            self.canvas.outline(at + self.task_size * shape, ink.TASK[TaskType(row["type"])], 1.5, 0.9)
        else:
            self.task(xy, row["type"], row["status"], row["progress"], opacity(row["age"]))

    def task(self, xy, kind, status, progress, alpha=1.0) -> None:
        """A task whose state is known."""
        at = self.pixels(xy)
        if status == Status.DONE:
            marks.draw_done(self.canvas, at, False, self.task_size, 1.0, alpha)
            return
        marks.draw_waiting(self.canvas, at, kind, self.task_size, alpha)
        if status == Status.SERVICED:
            self.canvas.ring(at, self.task_size + 4, ink.INK, 2.0, alpha, part=max(0.04, progress))

    def robot(self, index, xy, task_xy=None, alpha=1.0, note="", failed=False) -> None:
        """A robot, named, and the line to the task that it heads for."""
        is_actor = index in self.robots
        alpha *= 1.0 if is_actor else BACKGROUND
        at, colour, n_uav = self.pixels(xy), ink.robot_colour(index, self.world.scenario.n_uav), self.world.scenario.n_uav
        ahead = np.array([0.0, -1.0])
        if task_xy is not None:
            goal = self.pixels(task_xy)
            self.canvas.lines([np.stack([at, goal])], colour, 1.6, 0.8 * alpha)
            way = np.linalg.norm(goal - at)
            ahead = (goal - at) / way if way > 1 else ahead
        marks.draw_robot(self.canvas, at, ahead, ink.FAILED if failed else colour, self.robot_size, index < n_uav, alpha)
        if is_actor:
            self.label(xy, f"{self.world.scenario.robot_names[index]}{note}", colour, 3)

    def plan(self, robot_xy, task_xy, colour=ink.INK) -> None:
        """Where the robot that all this is about means to go."""
        self.canvas.lines([self.pixels(np.stack([robot_xy, task_xy]))], colour, 3.0, 0.9)
        self.mark(task_xy)

    def mark(self, xy, colour=ink.DIFFERENT) -> None:
        """A ring that points something out."""
        self.canvas.ring(self.pixels(xy), 2.6 * self.task_size, colour, 2.5)

    def control(self, operator, robot_xy, count=0) -> None:
        """A line from the station in the operator's colour; broken into `count` dashes for what is not so (yet)."""
        ends = self.pixels(np.stack([self.world.layout.station, robot_xy]))
        self._line(ends, ink.operator_colour(operator), 2.4, count)

    def ask(self, robot_xy) -> None:
        """A query on its way to the station."""
        self._line(self.pixels(np.stack([robot_xy, self.world.layout.station])), ink.INK, 1.8, 20)

    def label(self, xy, text, colour=ink.INK, priority=1) -> None:
        """A name beside a place; where all does not fit, the most important go first."""
        key = len(self.labels)
        anchor = tuple(self.pixels(xy))
        self.labels.append(Label(key, anchor, text_width(text, TEXT, 500) + 8, 1.35 * TEXT, 10.0, priority))
        self.inks[key] = text, colour

    def picture(self) -> np.ndarray:
        """[size, size, 3] in blue, green, red."""
        station = self.pixels(self.world.layout.station)
        self.canvas.polygon(station + 7 * np.array([(0, -1), (1, 0), (0, 1), (-1, 0)]), ink.INK)
        inside = [label for label in self.labels if 0 <= min(label.anchor) and max(label.anchor) <= self.size]
        busy = [(*(np.array(label.anchor) - 7), *(np.array(label.anchor) + 7)) for label in inside]
        places = place_labels(inside, busy, (self.size, self.size))
        for label in inside:
            if label.key in places:
                self._write(label, places[label.key])
        return self.canvas.paste(self.ground)

    def _line(self, ends, colour, width, dashes=0):
        share = np.linspace(0, 1, 2 * max(1, dashes))[:, None]
        dots = ends[0] + share * (ends[1] - ends[0])
        self.canvas.lines([dots[i : i + 2] for i in range(0, len(dots), 2)], colour, width, 0.95)

    def _write(self, label, place):
        text, colour = self.inks[label.key]
        if place.is_far:
            nearest = np.clip(label.anchor, [place.x, place.y], [place.x + label.width, place.y + label.height])
            self.canvas.lines([np.stack([label.anchor, nearest])], ink.INK, 1.0, 0.5)
        self.canvas.panel(place.x, place.y, label.width, label.height, ink.PANEL, 0.75, 4)
        self.canvas.text(place.x + 4, place.y + 1.02 * TEXT, text, TEXT, colour, 500)


def draw_beliefs(chart: Chart, decision, notes: dict) -> None:
    """What the robot of a decision held true; `notes` are added to the names of tasks."""
    tasks, plan = decision.tasks, decision.plan
    xy = np.stack([tasks["x"], tasks["y"]], axis=-1).astype(float)
    for j in np.flatnonzero(tasks["released"]):
        chart.believed_task(xy[j], tasks[j])
    for r, row in enumerate(decision.peers):
        if r != decision.robot and row["age"] >= 0:
            goal = xy[row["task"]] if row["task"] != NOBODY else None
            failed = row["activity"] == Activity.FAILED
            chart.robot(r, (row["x"], row["y"]), goal, opacity(row["age"]), f", {row['age']:.0f} s", failed)
    own = decision.itself
    if plan != NOBODY:
        chart.plan((own["x"], own["y"]), xy[plan])
    chart.robot(decision.robot, (own["x"], own["y"]), note=" itself")
    for j, note in notes.items():
        chart.label(xy[j], f"T{j}{note}", ink.INK, 2)


def draw_truth(chart: Chart, scene: Scene, named=()) -> None:
    """How things stood; some tasks are named."""
    xy = scene.task_xy
    for j in np.flatnonzero(scene.released):
        chart.task(xy[j], scene.kind[j], scene.status[j], scene.progress[j])
    for h in np.argsort(scene.session, kind="stable"):  # who controls is drawn over who calls
        if h in chart.operators and scene.session[h] != Session.REST:
            chart.control(h, scene.robot_xy[scene.operator_robot[h]], 0 if scene.session[h] == Session.HELD else 30)
    for r, task in enumerate(scene.robot_task):
        chart.robot(r, scene.robot_xy[r], xy[task] if task != NOBODY else None, failed=scene.activity[r] == Activity.FAILED)
    for j in named:
        chart.label(xy[j], f"T{j}", ink.INK, 2)
