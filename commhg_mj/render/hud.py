"""The head-up display: title bar with clock and score, panels on the left, legend at the bottom."""

import numpy as np

from ..base.terms import ROUTES, Activity, Fate, Session
from . import palette as ink
from .canvas import Canvas, text_width
from .legend import draw_legend
from .marks import draw_badge, draw_route_mark
from .minimap import Minimap
from .moment import Moment

BAR = 54  # height of the title bar
COLUMN = 206  # width of the panels on the left
EDGE = 12  # margin around panels
PANEL_ALPHA = 0.66
MAP_SIZE = 190
MAP_RIM = 5
ROOMY = (940, 520)  # smallest picture, in interface units, with panels and legend
PLAIN = (500, 260)  # smallest one with a full title bar and a corner map
FATE_ORDER = (Fate.DELIVERED, Fate.TERRAIN, Fate.LOST, Fate.OUT_OF_RANGE, Fate.EXPIRED, Fate.NO_TOKENS)
ACTIVITY_NAMES = {
    Activity.TRAVELLING: "travelling",
    Activity.SERVICING: "servicing",
    Activity.IDLE: "idle",
    Activity.FAILED: "failed",
}


class Hud:
    """The display of one trace for pictures of `size` = (width, height) pixels, with the key of a `Drape` if there is one.

    Lengths are in units: pixels of a 720p picture. Small pictures show less rather than illegible text.
    """

    def __init__(self, trace, world, size, drape=None):
        self.trace, self.canvas = trace, Canvas(*size)
        self.unit = max(0.75, min(size[0] / 1280, size[1] / 720))
        self.width, self.height = size[0] / self.unit, size[1] / self.unit
        self.is_roomy = self.width >= ROOMY[0] and self.height >= ROOMY[1]
        self.is_plain = self.width >= PLAIN[0] and self.height >= PLAIN[1]
        self.boxes = set()  # (x0, y0, x1, y1) in pixels of what it covers
        self._map_corner = self.width - EDGE - MAP_SIZE, BAR + EDGE
        x, y, inner = (round(v * self.unit) for v in (*self._map_corner, MAP_SIZE - 2 * MAP_RIM))
        rim = round(MAP_RIM * self.unit)
        self.minimap = Minimap(trace, world, self.canvas, x + rim, y + rim, inner, self.unit)
        if self.is_roomy:
            draw_legend(self)
            if drape:
                self._drape_key(drape)

    def draw(self, moment: Moment, projection) -> None:
        """Bring everything that changes up to date."""
        self._title_bar(moment)
        if self.is_plain:
            self.box(*self._map_corner, MAP_SIZE, MAP_SIZE)
            self.minimap.draw(moment, projection)
        if self.is_roomy:
            y = BAR + EDGE
            for panel in (self._operators, self._team, self._tasks, self._messages):
                y = panel(moment, y)

    def cover(self, canvas: Canvas) -> None:
        """Lay the display over another canvas."""
        for x0, y0, x1, y1 in self.boxes:
            canvas.pixels[y0:y1, x0:x1] = self.canvas.pixels[y0:y1, x0:x1]

    def claim(self, x, y, width, height) -> tuple:
        """Keep a box, given in units, for the display; returns it in pixels."""
        ends = np.array([x, y, x + width, y + height]) * self.unit
        box = tuple(int(v) for v in np.round(ends))
        self.boxes.add(box)
        return box

    def box(self, x, y, width, height) -> None:
        """Claim a box given in units and draw its empty panel."""
        u = self.unit
        x0, y0, x1, y1 = self.claim(x, y, width, height)
        self.canvas.pixels[y0:y1, x0:x1] = 0
        self.canvas.panel(x * u, y * u, width * u, height * u, ink.PANEL, PANEL_ALPHA, 7 * u)

    def text(self, x, y, string, size=12.0, colour=ink.INK, weight=400, anchor=0.0) -> float:
        """Text at units (x, baseline y); returns its width in units."""
        u = self.unit
        return self.canvas.text(x * u, y * u, string, size * u, colour, weight, anchor) / u

    def measure(self, string, size, weight=400) -> float:
        """Width of a text in units."""
        return text_width(string, size * self.unit, weight) / self.unit

    def bar(self, x, y, width, height, parts) -> None:
        u = self.unit
        self.canvas.bar(x * u, y * u, width * u, height * u, parts, ink.TROUGH)

    def _drape_key(self, drape):
        """A bar of the drape's colours, below the corner map."""
        width = max(MAP_SIZE, self.measure(drape.label, 11) + 20)
        left, right, y = self.width - EDGE - width + 10, self.width - EDGE - 10, BAR + EDGE + MAP_SIZE + 8
        self.box(left - 10, y, width, 50)
        self.text(left, y + 16, drape.label, 11, ink.MUTED)
        self.bar(left, y + 23, right - left, 9, [(1 / len(drape.colours), colour[::-1]) for colour in drape.colours])
        self.text(left, y + 44, drape.low, 11)
        self.text(right, y + 44, drape.high, 11, anchor=1.0)

    def _title_bar(self, moment):
        canvas, u, limit = self.canvas, self.unit, self.trace.scenario.time_limit
        canvas.box(0, 0, canvas.width, BAR * u, ink.PANEL, 0.72)
        canvas.box(0, (BAR - 2) * u, canvas.width, 2 * u, ink.TROUGH, 0.9)
        canvas.box(0, (BAR - 2) * u, canvas.width * min(1.0, moment.time / limit), 2 * u, ink.INK, 0.9)
        self.claim(0, 0, self.width, BAR)
        middle = self.width / 2 if self.is_plain else EDGE + 30
        self.text(middle, 33, _clock(moment.time), 25, weight=600, anchor=0.5)
        if self.is_plain:
            self.text(middle, 47, f"of {_clock(limit)}", 11, ink.MUTED, anchor=0.5)
            self._mission_name()
        self._score(moment)

    def _mission_name(self):
        trace = self.trace
        width = self.text(EDGE + 4, 25, trace.scenario.name.capitalize(), 19, weight=600)
        if trace.policy == "omniscient":
            self.text(EDGE + 16 + width, 24, "PRIVILEGED REFERENCE", 11, ink.PRIVILEGED, 700)
        facts = f"{trace.policy} policy  ·  {trace.links} links  ·  {trace.limitation}  ·  seed {trace.seed}"
        if text_width(facts, 12 * self.unit) < (self.width / 2 - 60) * self.unit:
            self.text(EDGE + 4, 43, facts, 12, ink.MUTED)

    def _score(self, moment):
        """TWCR so far, on a bar from 0 to 1: gained, still to be won, lost to lateness."""
        right = self.width - EDGE - 4
        width = 222 if self.is_plain else 0
        self.text(right - width - 12, 33, f"{moment.gained:.3f}", 25, ink.GAINED, 600, anchor=1.0)
        self.text(right - width - 12, 47, "TWCR", 11, ink.MUTED, anchor=1.0)
        if width:
            still_open = 1 - moment.gained - moment.lost
            parts = [(moment.gained, ink.GAINED), (still_open, ink.TROUGH), (moment.lost, ink.LATE)]
            self.bar(right - width, 18, width, 12, parts)
            done = f"{moment.done.sum()}/{len(moment.done)} tasks"
            self.text(right - width, 46, done, 11, ink.MUTED)
            self.text(right, 46, f"{moment.lost:.3f} lost to lateness", 11, ink.LATE, anchor=1.0)

    def _heading(self, y, title, aside=""):
        self.text(EDGE + 10, y + 17, title, 10.5, ink.MUTED, 600)
        self.text(EDGE + COLUMN - 10, y + 17, aside, 10.5, ink.MUTED, anchor=1.0)

    def _operators(self, moment, y):
        count = len(moment.fatigue)
        if not count:
            return y
        columns = 1 if count <= 8 else 2
        rows, step = -(-count // columns), 20 if count <= 8 else 15
        self.box(EDGE, y, COLUMN, 28 + rows * step)
        self._heading(y, "OPERATORS", "fatigue" if columns == 1 else "")
        for operator in range(count):
            column, row = divmod(operator, rows)
            x, width = EDGE + 10 + column * COLUMN / 2, COLUMN / columns - 16
            self._operator(moment, operator, x, y + 26 + row * step, width, step)
        return y + 28 + rows * step + 8

    def _operator(self, moment, operator, x, y, width, step):
        """Badge, whom it holds or calls, fatigue bar."""
        colour, size = ink.operator_colour(operator), 11.5 if step > 15 else 9.5
        badge = draw_badge(self.canvas, x * self.unit, (y + step / 2 - 2) * self.unit, operator, size * self.unit)
        session, robot = moment.session[operator], moment.operator_robot[operator]
        name = self.trace.scenario.robot_names[robot] if robot >= 0 else ""
        state = {Session.REST: "rest", Session.BID: f"calls {name}", Session.HELD: f"controls {name}"}[Session(session)]
        if step <= 15:
            state = name or "rest"
        self.text(x + badge / self.unit + 4, y + step / 2 + 2, state, size, ink.MUTED if robot < 0 else ink.INK)
        start = 116 if step > 15 else 64
        self.bar(x + start, y + step / 2 - 5, width - start, 6, [(float(moment.fatigue[operator]), colour)])

    def _team(self, moment, y):
        n_uav = self.trace.scenario.n_uav
        teams = [("UAV", moment.activity[:n_uav], ink.AIR[0]), ("UGV", moment.activity[n_uav:], ink.GROUND[0])]
        teams = [team for team in teams if len(team[1])]
        height = 40 + 18 * len(teams)
        self.box(EDGE, y, COLUMN, height)
        standing = f"{moment.standing.sum()} refused · " if moment.standing.any() else ""
        self._heading(y, "ROBOTS", f"{standing}{np.mean(moment.broadcast_tokens):.0%} tokens")
        for row, (name, activity, colour) in enumerate(teams):
            at = y + 26 + 18 * row
            self.text(EDGE + 10, at + 9, f"{len(activity)} {name}", 11.5, colour, 600)
            parts = [(float(np.mean(activity == a)), ink.ACTIVITY[a]) for a in ACTIVITY_NAMES]
            self.bar(EDGE + 66, at, COLUMN - 76, 9, parts)
        self._key(EDGE + 10, y + height - 7, [(name, ink.ACTIVITY[a]) for a, name in ACTIVITY_NAMES.items()])
        return y + height + 8

    def _tasks(self, moment, y):
        open_, late = moment.released & ~moment.done, moment.overdue
        states = [
            ("done", moment.done & ~late, ink.GAINED),
            ("done late", moment.done & late, ink.LATE),
            ("waiting", open_ & ~late, ink.MUTED),
            ("overdue", open_ & late, tuple(0.6 * c for c in ink.LATE)),
        ]
        self.box(EDGE, y, COLUMN, 60)
        self._heading(y, "TASKS", f"{(~moment.released).sum()} to come" if not moment.released.all() else "")
        self.bar(EDGE + 10, y + 25, COLUMN - 20, 9, [(float(mask.mean()), colour) for _, mask, colour in states])
        self._key(EDGE + 10, y + 51, [(name, colour) for name, _, colour in states])
        return y + 68

    def _messages(self, moment, y):
        """Messages that ended in the last minute: a bar for each route, and the fates' colours with their counts."""
        height = 88 + 15 * ((len(FATE_ORDER) + 1) // 2)
        if y + height > self.height - 44:
            return y
        self.box(EDGE, y, COLUMN, height)
        self._heading(y, "MESSAGES", "last minute")
        for route, name in enumerate(ROUTES):
            at, total = y + 26 + 18 * route, moment.counts[route, FATE_ORDER].sum()
            sign = (EDGE + 15) * self.unit, (at + 5) * self.unit
            draw_route_mark(self.canvas, sign, (1, 0), route, ink.INK, self.unit)
            self.text(EDGE + 26, at + 9, name, 11.5)
            parts = [(moment.counts[route, fate] / max(1, total), ink.FATE[fate]) for fate in FATE_ORDER]
            self.bar(EDGE + 86, at, COLUMN - 126, 9, parts)
            self.text(EDGE + COLUMN - 10, at + 9, str(total), 11.5, anchor=1.0)
        for index, fate in enumerate(FATE_ORDER):
            x, at = EDGE + 10 + 98 * (index % 2), y + 94 + 15 * (index // 2)
            u = self.unit
            self.canvas.disc(((x + 3) * u, (at - 4) * u), 3.2 * u, ink.FATE[fate])
            width = self.text(x + 10, at, ink.FATE_NAME[fate], 10.5, ink.MUTED)
            self.text(x + 14 + width, at, str(moment.counts[:, fate].sum()), 10.5)
        return y + height + 8

    def _key(self, x, y, entries):
        """Names in a row, each behind a dot of its colour."""
        u = self.unit
        for name, colour in entries:
            self.canvas.disc(((x + 3) * u, (y - 3.5) * u), 3 * u, colour)
            x += 8 + self.text(x + 8, y, name, 9.5, ink.MUTED) + 6


def _clock(time):
    return f"{int(time) // 60:d}:{int(time) % 60:02d}"
