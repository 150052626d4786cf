"""What is drawn over the scene: links, who goes where, who is controlled by whom, messages, tasks, robots."""

import numpy as np

from ..base.terms import Activity, Fate, Mode, Session
from ..models.mjcf import display_scale
from . import marks
from . import palette as ink
from .cameras import occluded
from .canvas import text_width
from .labels import Label, place_labels

NEIGHBOURS = 4  # links drawn from a robot, as many as a broadcast reaches
FAINT = 0.35  # opacity of what a mountain hides
VISIBLE_SIZE = 26  # a robot's model of at least so many units needs no mark
MAX_FLIGHTS = 220  # messages drawn at once
LOST_AT = {Fate.DELIVERED: 1.0, Fate.TERRAIN: 0.55, Fate.LOST: 0.7, Fate.OUT_OF_RANGE: 0.35}  # of the way
MAX_TASK_LABELS = 20
ROUTE_CACHE = 512
ARC_RISE = 0.13  # of its length: how high a control arc bends
CROWD = 24  # robots: labels of more stay close to them
RING = 24  # units
SMALLEST_UNIT = 0.45  # pixels; smaller pictures have no labels


class Overlay:
    """Draws one trace over pictures of its world; `pins` [T, 3] m is where its tasks' marks stand."""

    def __init__(self, trace, world, canvas, pins):
        self.trace, self.world, self.canvas = trace, world, canvas
        scale = min(canvas.width / 1280, canvas.height / 720)
        self.unit = max(SMALLEST_UNIT, scale)
        self.has_labels = scale >= SMALLEST_UNIT
        # Crowds get smaller signs.
        self.robot_size = 5.2 * self.unit * min(1.0, (24 / trace.scenario.n_robots) ** 0.3)
        self.task_size = self.unit * min(1.0, (150 / trace.scenario.n_tasks) ** 0.4)
        self.n_uav = trace.scenario.n_uav
        layout = world.layout
        mast = [*layout.station, trace.scenario.world.mast_height]
        self.station = np.array(mast, float)
        self.seats = np.c_[layout.operators, np.full(len(layout.operators), 2.0)]
        self.pois = np.c_[trace.task_xy, layout.ground_height(trace.task_xy) + 1.0]
        self.pins = pins
        self.slots, self._routes = {}, {}

    def draw(self, moment, robots, projection, taken, ringed=None) -> None:
        """`robots` [R, 3] are the robots' positions in metres; labels keep off the boxes `taken`; an actor may be ringed."""
        self.projection = projection
        marks.draw_boundary(self.canvas, projection, self.world.layout.side, self.unit)
        self._links(moment, robots)
        places = self._task_places(moment)
        self._targets(moment, robots, places)
        self._control(moment, robots)
        at, seen, alpha = self._visible(np.concatenate([robots, places]))
        count = len(robots)
        self._tasks(moment, at[count:], seen[count:], alpha[count:])
        self._messages(moment, robots)
        self._robots(moment, robots, at[:count], seen[:count], alpha[:count])
        if ringed:
            self._ring(ringed, robots)
        if self.has_labels:
            self._labels(moment, robots, at, seen, taken)

    def _task_places(self, moment):
        """Marks stand on the beams of open tasks, and on the ground once they are done [T, 3]."""
        return np.where(moment.done[:, None], self.pois, self.pins)

    def colour(self, robot, moment) -> tuple:
        failed = moment.activity[robot] == Activity.FAILED
        return ink.FAILED if failed else ink.robot_colour(robot, self.n_uav)

    def _visible(self, points):
        at, seen = self.projection.pixels(points)
        hidden = occluded(self.projection, self.world.layout.ground_height, points)
        return at, seen, np.where(hidden, FAINT, 1.0)

    def _line(self, points, colour, width, alpha):
        self.canvas.lines(self.projection.polyline(points), colour, width * self.unit, alpha)

    def _dashes(self, points, colour, width, alpha, count):
        """A polyline [k, 3] cut into `count` dashes of equal length."""
        steps = np.r_[0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
        cuts = np.linspace(0, steps[-1], 2 * count)
        dense = np.stack([np.interp(cuts, steps, axis) for axis in np.asarray(points).T], axis=-1)
        for start in range(0, 2 * count, 2):
            self._line(dense[start : start + 2], colour, width, alpha)

    def _links(self, moment, robots):
        """Each living robot's best links, and its link to the station."""
        alive = moment.activity != Activity.FAILED
        quality = moment.link_quality * alive[:, None] * np.append(alive, True)
        ends = np.concatenate([robots, self.station[None]])
        mutual = np.maximum(quality[:, :-1], quality[:, :-1].T)
        best = np.argsort(-mutual, axis=1, kind="stable")[:, :NEIGHBOURS]
        pairs = {(min(i, j), max(i, j)) for i in range(len(robots)) for j in best[i] if mutual[i, j] > 0 and i != j}
        pairs |= {(i, len(robots)) for i in range(len(robots)) if quality[i, -1] > 0}
        for i, j in sorted(pairs):
            value = quality[i, -1] if j == len(robots) else mutual[i, j]
            self._line([ends[i], ends[j]], ink.link_colour(value), 1.0, 0.22 + 0.38 * value)

    def _targets(self, moment, robots, places):
        """Who goes where: straight through the air, along its route on the ground."""
        for i in np.flatnonzero((moment.task >= 0) & (moment.activity == Activity.TRAVELLING)):
            if i < self.n_uav:
                way = np.stack([robots[i], places[moment.task[i]]])
            else:
                way = self._ground_route(i, moment)
            self._line(way, ink.PANEL, 3.4, 0.35)
            self._line(way, self.colour(i, moment), 1.8, 0.95)

    def _ground_route(self, robot, moment):
        """What is left of the route that the robot took when it got its task."""
        task, start = int(moment.task[robot]), int(moment.assigned_at[robot])
        if (robot, start) not in self._routes:
            if len(self._routes) > ROUTE_CACHE:
                self._routes.clear()
            self._routes[robot, start] = self.world.path(self.trace.robot_xy[start, robot].astype(float), task)
        route, here = self._routes[robot, start], moment.xy[robot]
        leg = np.diff(route, axis=0)
        share = np.clip(((here - route[:-1]) * leg).sum(1) / np.maximum((leg**2).sum(1), 1e-9), 0, 1)
        nearest = int(np.argmin(np.linalg.norm(route[:-1] + share[:, None] * leg - here, axis=1)))
        way = np.concatenate([here[None], route[nearest + 1 :]])
        return np.c_[way, np.full(len(way), 1.0)]

    def _control(self, moment, robots):
        """An arc in the operator's colour: solid while it controls, broken during handover, dotted for a bid."""
        for operator in np.flatnonzero((moment.session != Session.REST) & (moment.operator_robot >= 0)):
            robot, colour = moment.operator_robot[operator], ink.operator_colour(int(operator))
            arc = self._arc(self.seats[operator], robots[robot])
            if moment.controller[robot] != operator:
                self._dashes(arc, colour, 1.2, 0.6, 36)
            elif moment.mode[robot] == Mode.HANDOVER:
                self._dashes(arc, colour, 2.0, 0.85, 12)
            else:
                self._line(arc, colour, 2.0, 0.8)

    def _arc(self, start, end):
        rise = np.array([0, 0, ARC_RISE * np.linalg.norm(end - start)])
        t = np.linspace(0, 1, 21)[:, None]
        return (1 - t) ** 2 * start + 2 * t * (1 - t) * ((start + end) / 2 + rise) + t**2 * end

    def _tasks(self, moment, at, seen, alpha):
        for task in np.flatnonzero(moment.released & seen):
            marks.draw_task(self.canvas, at[task], moment, self.trace, task, self._radius(task), self.unit, alpha[task])

    def _radius(self, task):
        """Worthier tasks are larger."""
        return (3.2 + 2.6 * self.trace.task_value[task] / self.trace.task_value.max()) * self.task_size

    def _messages(self, moment, robots):
        flight = moment.flight
        ends = np.concatenate([robots, np.tile(self.station, (len(self.seats) + 1, 1))])
        step = -(-len(flight.phase) // MAX_FLIGHTS) or 1
        for m in range(0, len(flight.phase), step):
            source, fate, phase = ends[flight.sender[m]], Fate(flight.fate[m]), float(flight.phase[m])
            if flight.left[m] and flight.receiver[m] >= 0:
                target = ends[flight.receiver[m]]
                self._pulse(source, target, ink.FATE[fate], flight.route[m], phase, LOST_AT[fate])
            else:
                self._never_sent(source, ink.FATE[fate], phase)

    def _never_sent(self, source, colour, phase):
        at, seen = self.projection.pixels(source)
        if seen:
            self.canvas.ring(at, (5 + 8 * phase) * self.unit, colour, 1.4 * self.unit, 0.9 * (1 - phase))

    def _pulse(self, source, target, colour, route, phase, lost_at):
        """A mark with a tail; a lost message stops on its way and ends in a cross."""
        reach = min(1.0, 1.4 * phase) if lost_at < 1 else phase
        head, tail = (source + (target - source) * lost_at * share for share in (reach, max(0.0, reach - 0.13)))
        at, seen = self.projection.pixels(np.stack([head, tail]))
        if not seen.all():
            return
        if reach >= 1.0 and lost_at < 1:
            marks.draw_cross(self.canvas, at[0], 4 * self.unit, colour, 2 * self.unit, 3.5 * (1 - phase))
            return
        ahead = (at[0] - at[1]) / max(1e-6, np.linalg.norm(at[0] - at[1]))
        across = 1.7 * self.unit * np.array([-ahead[1], ahead[0]])
        self.canvas.polygon(np.array([at[0] + across, at[0] - across, at[1]]), colour, 0.5)
        marks.draw_route_mark(self.canvas, at[0], ahead, route, colour, self.unit, 0.95)

    def _ring(self, actor, robots):
        """Point out a robot by its name, or the station for an operator."""
        names = self.trace.scenario.robot_names
        at, seen = self.projection.pixels(robots[names.index(actor)] if actor in names else self.station)
        if seen:
            self.canvas.ring(at, RING * self.unit, ink.PANEL, 8 * self.unit, 0.6)
            self.canvas.ring(at, RING * self.unit, ink.DIFFERENT, 4 * self.unit)

    def _apparent_size(self, robots):
        """Span of each robot's model in pixels."""
        return self.projection.scale_at(robots) * display_scale(self.world.layout.side)

    def _robots(self, moment, robots, at, seen, alpha):
        """Marks for robots too small to be seen, and stems that show where the aerial ones are."""
        size = self._apparent_size(robots)
        for i in np.flatnonzero(seen):
            colour = self.colour(i, moment)
            foot = [*robots[i, :2], float(self.world.layout.ground_height(robots[i, :2]))]
            if i < self.n_uav and moment.activity[i] != Activity.FAILED:
                self._line([robots[i], foot], colour, 1.0, 0.5 * alpha[i])
            if moment.controller[i] >= 0:
                badge = ink.operator_colour(moment.controller[i])
                self.canvas.ring(at[i], 2.1 * self.robot_size, badge, 2 * self.unit, alpha[i])
            if size[i] < VISIBLE_SIZE * self.unit:
                nose = robots[i] + [np.cos(moment.heading[i]), np.sin(moment.heading[i]), 0]
                ahead = self.projection.pixels(nose)[0] - at[i]
                ahead = ahead / max(1e-6, np.linalg.norm(ahead))
                marks.draw_robot(self.canvas, at[i], ahead, colour, self.robot_size, i < self.n_uav, alpha[i])

    def _labels(self, moment, robots, at, seen, taken):
        """Names of robots and of the tasks that they head for; marks keep their places free."""
        size, count = 11.5 * self.unit, len(moment.xy)
        names = self.trace.scenario.robot_names
        gaps = np.maximum(9 * self.unit, 0.5 * self._apparent_size(robots))
        labels = []
        for i in np.flatnonzero(seen[:count]):
            width, priority = self._tag_width(i, moment, size), 3 if moment.controller[i] >= 0 else 2
            labels.append(Label(i, tuple(at[i]), width, 1.5 * size, float(gaps[i]), priority))
        targets = np.unique(moment.task[moment.task >= 0])
        for task in targets if len(targets) <= MAX_TASK_LABELS else []:
            if seen[count + task]:
                width = text_width(f"T{task}", size)
                labels.append(Label(f"T{task}", tuple(at[count + task]), width, 1.3 * size, 12 * self.unit, 1))
        busy = np.concatenate([at[:count][seen[:count]], at[count + targets][seen[count + targets]]])
        boxes = [*sorted(taken), *np.concatenate([busy - 7 * self.unit, busy + 7 * self.unit], axis=1)]
        size_of_picture = self.canvas.width, self.canvas.height
        places = place_labels(labels, boxes, size_of_picture, self.slots, may_go_far=count <= CROWD)
        self.slots = {key: place.slot for key, place in places.items()}
        for label in labels:
            if label.key in places:
                self._tag(label, places[label.key], names, moment, size)

    def _tag_width(self, robot, moment, size):
        width = text_width(self.trace.scenario.robot_names[robot], size, 500) + 0.8 * size
        if moment.controller[robot] >= 0:
            width += text_width(f"H{moment.controller[robot]}", size, 700) + 1.1 * size
        return width

    def _tag(self, label, place, names, moment, size):
        """A robot's chip with its operator's badge, or a task's bare name."""
        canvas, x, y = self.canvas, place.x, place.y
        if place.is_far:
            nearest = np.clip(label.anchor, [x, y], [x + label.width, y + label.height])
            canvas.lines([np.stack([label.anchor, nearest])], ink.INK, self.unit, 0.5)
        if isinstance(label.key, str):
            canvas.text(x, y + 0.95 * size, label.key, size, ink.INK, 500, halo=0.6)
            return
        robot = int(label.key)
        canvas.panel(x, y, label.width, label.height, ink.PANEL, 0.72, 0.4 * size)
        width = canvas.text(x + 0.4 * size, y + 1.12 * size, names[robot], size, self.colour(robot, moment), 500)
        if moment.controller[robot] >= 0:
            marks.draw_badge(canvas, x + width + 0.8 * size, y + label.height / 2, moment.controller[robot], 0.9 * size)
