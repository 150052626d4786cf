"""The benchmark figure: a still of a world, its parts named, with close-ups of station and robots."""

from contextlib import closing
from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arguments import path_of
from ..base.files import whole_file
from ..base.terms import Activity, TaskType
from ..mission.trace import Trace
from ..models.world import World, make_world
from . import marks
from . import palette as ink
from .canvas import Canvas, text_width
from .labels import Label, place_labels
from .moment import Timeline
from .stage import Stage
from .video import write_png

SIZE = (1920, 1080)  # pixels
INSET = (320, 180)
CROP = {"station": 0.72, "follow": 0.34}  # share of a close-up's width and height that is shown
LOWER = {"station": 0.98, "follow": 0.5}  # where the crop's middle lies, from top (0) to bottom (1)
MARGIN = 24
TEXT = 23
RING = 16  # pixels: radius of the ring around a named place
APART = 420  # pixels: named places farther apart than this are far enough
CALM = 120.0  # s: a trace is shown here, when robots have left the station


@dataclass(frozen=True)
class Still:
    """What the stage needs to know of a moment, for a world without a mission."""

    xy: np.ndarray
    heading: np.ndarray
    activity: np.ndarray
    released: np.ndarray
    done: np.ndarray
    time: float = 0.0

    @property
    def course(self) -> np.ndarray:
        return self.heading

    @property
    def bank(self) -> np.ndarray:
        return np.zeros(len(self.xy))

    @property
    def moving(self) -> np.ndarray:
        return np.ones(len(self.xy), bool)


def overview_figure(source, out) -> None:
    """Write the benchmark figure of a `Trace` or a `World` as PNG.

    Raises:
      ValueError: `out` does not end in .png or cannot be written.
      RuntimeError: OpenGL is missing.
    """
    if not isinstance(source, (Trace, World)):
        raise ValueError(f"source must be a Trace or a World, is {type(source).__name__}")
    if path_of("out", out).suffix.lower() != ".png":
        raise ValueError(f"{out}: the name must end in .png")
    if isinstance(source, World):
        world, moment = source, _outward(source)
    else:
        world = make_world(source.scenario, source.seed)
        moment = Timeline(source, 0.0).at(min(CALM, len(source.robot_xy) - 1))
    with whole_file(out) as part, closing(Stage(world, SIZE)) as stage:
        picture, projection = stage.render(moment, "overview")
        canvas = Canvas(*SIZE)
        marks.draw_boundary(canvas, projection, world.layout.side, 2)
        _draw_marks(canvas, projection, world, stage, moment)
        boxes = _draw_insets(picture, canvas, stage, moment)
        boxes.append(_draw_title(canvas, world.scenario))
        _draw_callouts(canvas, projection, _landmarks(world, stage, moment), boxes)
        write_png(part, canvas.paste(picture))


def _outward(world):
    """Robots on their way to tasks that they may service, spread over the map."""
    scenario, start = world.scenario, world.layout.starts
    xy, heading = start.copy(), np.full(len(start), np.pi / 2)
    for i in range(scenario.n_robots):
        wrong = TaskType.UGV_ONLY if i < scenario.n_uav else TaskType.UAV_ONLY
        fit = np.flatnonzero(world.poi_types != wrong)
        if len(fit):
            task = fit[(7 * i + 3) % len(fit)]
            way = np.stack([start[i], world.pois[task]]) if i < scenario.n_uav else world.path(start[i], task)
            xy[i], heading[i] = _along(way, 0.55)
    tasks = len(world.pois)
    return Still(xy, heading, np.full(len(xy), Activity.TRAVELLING), np.ones(tasks, bool), np.zeros(tasks, bool))


def _along(way, share):
    """(place [2], heading) after a share of a polyline [k, 2]."""
    leg = np.diff(way, axis=0)
    ends = np.r_[0, np.cumsum(np.hypot(*leg.T))]
    goal = share * ends[-1]
    i = min(int(np.searchsorted(ends, goal, side="right")) - 1, len(leg) - 1)
    place = way[i] + leg[i] * (goal - ends[i]) / max(ends[i + 1] - ends[i], 1e-9)
    return place, np.arctan2(leg[i, 1], leg[i, 0])


def _draw_insets(picture, canvas, stage, moment):
    """Close-ups down the right side; returns their boxes."""
    scenario, stage.has_markers = stage.world.scenario, True
    views = [("Station and operators" if scenario.n_operators else "Station", "station")]
    views += [("UAV", "follow:uav0")] * bool(scenario.n_uav) + [("UGV", "follow:ugv0")] * bool(scenario.n_ugv)
    boxes, x, y = [], SIZE[0] - MARGIN - INSET[0], MARGIN
    for name, camera in views:
        view = _crop(stage.render(moment, camera)[0], camera.partition(":")[0])
        picture[y : y + INSET[1], x : x + INSET[0]] = cv2.resize(view, INSET, interpolation=cv2.INTER_AREA)
        canvas.outline(np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * INSET + (x, y), ink.INK, 2)
        canvas.panel(x + 8, y + 8, text_width(name, TEXT, 500) + 18, 1.45 * TEXT, ink.PANEL, 0.72)
        canvas.text(x + 17, y + 8 + 1.08 * TEXT, name, TEXT, ink.INK, 500)
        boxes.append((x, y, x + INSET[0], y + INSET[1]))
        y += INSET[1] + MARGIN // 2
    return boxes


def _crop(picture, kind):
    height, width = (round(CROP[kind] * n) for n in picture.shape[:2])
    top, left = round((picture.shape[0] - height) * LOWER[kind]), (picture.shape[1] - width) // 2
    return picture[top : top + height, left : left + width]


def _draw_marks(canvas, projection, world, stage, moment):
    """Tasks and robots are too small to be seen from afar."""
    for at, seen, kind in zip(*projection.pixels(stage.pins), world.poi_types):
        if seen:
            marks.draw_waiting(canvas, at, kind, 7)
    robots = stage.positions(moment)
    ahead = np.stack([np.cos(moment.heading), np.sin(moment.heading), np.zeros(len(robots))], axis=-1)
    noses = projection.pixels(robots + ahead)[0]
    for i, (at, seen) in enumerate(zip(*projection.pixels(robots))):
        if seen:
            nose = (noses[i] - at) / np.linalg.norm(noses[i] - at)
            marks.draw_robot(canvas, at, nose, ink.robot_colour(i, world.scenario.n_uav), 10, i < world.scenario.n_uav)


def _draw_title(canvas, scenario):
    """Name and size of the scenario in the left top corner; returns its box."""
    name = scenario.name.capitalize()
    side = f"{scenario.map_side:g} m × {scenario.map_side:g} m, {scenario.time_limit} s"
    team = f"{scenario.n_uav} UAVs, {scenario.n_ugv} UGVs, {scenario.n_operators} operators, {scenario.n_tasks} tasks"
    width = max(text_width(line, TEXT) for line in (side, team)) + 40
    canvas.panel(MARGIN, MARGIN, width, 136, ink.PANEL, 0.72, 10)
    canvas.text(MARGIN + 20, MARGIN + 48, name, 40, ink.INK, 600)
    canvas.text(MARGIN + 20, MARGIN + 84, team, TEXT, ink.INK)
    canvas.text(MARGIN + 20, MARGIN + 116, side, TEXT, ink.MUTED)
    return MARGIN, MARGIN, MARGIN + width, MARGIN + 136


def _landmarks(world, stage, moment):
    """(name, colour, places [n, 3]) of everything to be named; any of its places will do."""
    layout, n_uav, robots = world.layout, world.scenario.n_uav, stage.positions(moment)
    found: list[tuple] = [("Station", ink.INK, np.array([[*layout.station, 2.0]]))]
    for name, parts in (("Forest", layout.forests), ("Mountain", layout.mountains)):
        largest = parts[np.argsort(-parts["a"])]
        xy = np.stack([largest["x"], largest["y"]], axis=-1)
        found.append((name, ink.INK, np.c_[xy, layout.ground_height(xy)]))
    found += [("UAV", ink.AIR[0], robots[:n_uav]), ("UGV", ink.GROUND[0], robots[n_uav:])]
    names = {TaskType.UAV_ONLY: "Task for UAVs", TaskType.UGV_ONLY: "Task for UGVs", TaskType.GENERAL: "Task for both"}
    for kind, name in names.items():
        found.append((name, ink.TASK[kind], stage.pins[world.poi_types == kind]))
    return found


def _draw_callouts(canvas, projection, landmarks, boxes):
    """One label on a leader for each landmark, far from the others and rather near to the camera."""
    labels, colours = [], {}
    for name, colour, places in landmarks:
        at, seen = projection.pixels(places)
        free = seen & np.array([not any(_inside(p, box) for box in boxes) for p in at], bool)
        if free.any():
            others = np.array([label.anchor for label in labels] or [(-1e3, -1e3)])
            apart = np.min(np.linalg.norm(at[:, None] - others, axis=-1), axis=1)
            score = np.minimum(apart, APART) / APART + projection.scale_at(places) / projection.scale_at(places).max()
            nearest = int(np.argmax(np.where(free, score, -1)))
            colours[name] = colour
            size = text_width(name, TEXT, 500) + 20, 1.5 * TEXT
            labels.append(Label(name, tuple(at[nearest]), *size, 46.0, len(labels)))
    rings = [(*(np.array(label.anchor) - RING), *(np.array(label.anchor) + RING)) for label in labels]
    places = place_labels(labels, boxes + rings, SIZE)
    for label in labels:
        if label.key in places:
            _draw_callout(canvas, label, places[label.key], colours[label.key])


def _draw_callout(canvas, label, place, colour):
    corner, size = np.array([place.x, place.y]), np.array([label.width, label.height])
    nearest = np.clip(label.anchor, corner, corner + size)
    canvas.lines([np.stack([label.anchor, nearest])], ink.INK, 2, 0.9)
    canvas.ring(label.anchor, RING, ink.INK, 2, 0.9)
    canvas.panel(*corner, *size, ink.PANEL, 0.8)
    canvas.text(place.x + 10, place.y + 1.1 * TEXT, label.key, TEXT, colour, 500)


def _inside(point, box):
    return box[0] <= point[0] <= box[2] and box[1] <= point[1] <= box[3]
