"""A made-up mission for render tests: plausible motion, control and messages without the simulator."""

import dataclasses

import numpy as np

from commhg_mj.base.terms import Activity, Fate, Kind, Mode, Session, TaskType
from commhg_mj.mission.recorder import NOT_DECIDED, SAMPLE_PERIOD
from commhg_mj.mission.trace import Trace
from commhg_mj.models.world import make_world
from commhg_mj.scenarios import SCENARIOS

TRAVEL, SERVICE = Activity.TRAVELLING, Activity.SERVICING
RELAYED = (Kind.BROADCAST, Kind.TELEMETRY, Kind.QUERY, Kind.REQUEST)


def make_trace(scenario="medium", seed=0, ticks=None, policy="greedy", **changes) -> Trace:
    """A synthetic trace of `ticks` seconds (default: the time limit); `changes` override scenario fields."""
    scenario = dataclasses.replace(SCENARIOS[scenario], **changes)
    world, rng = make_world(scenario, seed), np.random.default_rng(seed)
    ticks = ticks or scenario.time_limit
    tasks = _draw_tasks(scenario, world, rng)
    robots = _fly(scenario, world, tasks, ticks, rng)
    operators = _supervise(scenario, robots, ticks, rng)
    messages = _talk(scenario, ticks, rng)
    return Trace(
        scenario=scenario,
        seed=seed,
        policy=policy,
        links="abstract",
        limitation="nominal",
        link_quality=_link_quality(scenario, world, robots["robot_xy"]),
        reward=np.zeros((ticks, 2)),
        records={},
        **tasks,
        **robots,
        **operators,
        **messages,
    )


def _draw_tasks(scenario, world, rng):
    n, limit = scenario.n_tasks, scenario.time_limit
    release = np.where(rng.random(n) < 0.7, 0.0, rng.uniform(0, 0.6, n) * limit)
    changes = (rng.random(n) < 0.2) & (world.poi_types == TaskType.GENERAL)
    return {
        "task_xy": world.pois.astype("f4"),
        "task_type": world.poi_types.astype("i1"),
        "task_changed_to": np.where(changes, rng.integers(0, 2, n), world.poi_types).astype("i1"),
        "task_changed_at": np.where(changes, release + rng.uniform(0, 0.3, n) * limit, -1).astype("f4"),
        "task_difficulty": rng.random(n).astype("f4"),
        "task_value": rng.integers(1, 4, n).astype("f4"),
        "task_deadline": (release + rng.uniform(0.1, 0.45, n) * limit).astype("f4"),
        "task_decay": (rng.uniform(0.08, 0.2, n) * limit).astype("f4"),
        "task_release": release.astype("f4"),
        "task_done": np.full(n, -1, "f4"),
        "task_done_by": np.full(n, -1, "i2"),
    }


def _fly(scenario, world, tasks, ticks, rng):
    """Robots visit the nearest open task in turn; one of them fails halfway."""
    r = scenario.n_robots
    log = {
        "robot_xy": np.zeros((ticks + 1, r, 2), "f4"),
        "robot_activity": np.zeros((ticks + 1, r), "i1"),
        "robot_mode": np.zeros((ticks + 1, r), "i1"),
        "robot_task": np.full((ticks + 1, r), -1, "i2"),
        "robot_controller": np.full((ticks + 1, r), -1, "i1"),
        "robot_progress": np.zeros((ticks + 1, r), "f4"),
        "robot_choice": np.full((ticks + 1, r), NOT_DECIDED, "i2"),
        "robot_broadcast": np.zeros((ticks + 1, r), "i1"),
        "robot_query": np.full((ticks + 1, r), -1, "i1"),
        "robot_request": np.zeros((ticks + 1, r), "i1"),
        "robot_tokens": rng.uniform(0, 192, (ticks + 1, r)).astype("f4"),
        "robot_broadcast_tokens": rng.uniform(0, 640, (ticks + 1, r)).astype("f4"),
        "robot_stand_left": np.zeros((ticks + 1, r), "f4"),
    }
    owned = np.zeros(scenario.n_tasks, bool)
    fails = ticks // 2 if r > 1 else ticks + 1
    trips = [_Trip(world.layout.starts[i], i >= scenario.n_uav) for i in range(r)]
    for tick in range(ticks + 1):
        for i, trip in enumerate(trips):
            if i == r - 1 and tick >= fails:
                trip.activity, trip.task = Activity.FAILED, -1
            else:
                trip.advance(tick, world, tasks, owned)
            log["robot_xy"][tick, i] = trip.xy
            log["robot_activity"][tick, i] = trip.activity
            log["robot_task"][tick, i] = trip.task
            log["robot_progress"][tick, i] = trip.progress
    log["robot_stand_left"][log["robot_activity"] == Activity.IDLE] = 7.0
    return log


class _Trip:
    """One robot's errands."""

    def __init__(self, xy, on_ground):
        self.xy, self.on_ground = np.array(xy, float), on_ground
        self.activity, self.task, self.progress, self.route = Activity.IDLE, -1, 0.0, []

    def advance(self, tick, world, tasks, owned):
        if self.activity == Activity.IDLE:
            self._choose(tick, world, tasks, owned)
        elif self.activity == TRAVEL:
            self._drive(5.0 if self.on_ground else 18.0)
        elif self.activity == SERVICE:
            self.progress += 1 / (20 + 60 * tasks["task_difficulty"][self.task])
            if self.progress >= 1:
                tasks["task_done"][self.task] = tick
                self.activity, self.task, self.progress = Activity.IDLE, -1, 0.0

    def _choose(self, tick, world, tasks, owned):
        wrong = TaskType.UAV_ONLY if self.on_ground else TaskType.UGV_ONLY
        open_ = (tasks["task_release"] <= tick) & ~owned & (tasks["task_type"] != wrong)
        if open_.any():
            distance = np.linalg.norm(world.pois - self.xy, axis=1)
            self.task = int(np.argmin(np.where(open_, distance, np.inf)))
            owned[self.task] = True
            self.activity = TRAVEL
            goal = world.pois[self.task]
            self.route = list(world.path(self.xy, self.task)[1:] if self.on_ground else [goal])

    def _drive(self, reach):
        while self.route and reach > 0:
            leg = self.route[0] - self.xy
            length = np.hypot(*leg)
            self.xy = self.xy + leg * min(1.0, reach / max(length, 1e-9))
            reach -= length
            if reach >= 0:
                self.route.pop(0)
        if not self.route:
            self.activity = SERVICE


def _supervise(scenario, robots, ticks, rng):
    """Operators take robots in turn, a minute each, with a bid and a handover before and a rest after."""
    h, r = scenario.n_operators, scenario.n_robots
    session = np.zeros((ticks + 1, h), "i1")
    robot = np.full((ticks + 1, h), -1, "i2")
    fatigue = np.zeros((ticks + 1, h), "f4")
    for tick in range(ticks + 1):
        for i in range(h):
            phase, choice = (tick + 17 * i) % 90, (i + h * ((tick + 17 * i) // 90)) % r
            alive = robots["robot_activity"][tick, choice] != Activity.FAILED
            if i < r and alive and phase < 60:
                session[tick, i], robot[tick, i] = (Session.BID if phase < 3 else Session.HELD), choice
                if phase >= 3:
                    robots["robot_controller"][tick, choice] = i
                    robots["robot_mode"][tick, choice] = Mode.HANDOVER if phase < 8 else Mode.CONTROLLED
            drift = 0.002 if session[tick, i] == Session.HELD else -0.003
            fatigue[tick, i] = np.clip(fatigue[max(0, tick - 1), i] + drift, 0, 1)
    log = {"operator_fatigue": fatigue, "operator_session": session, "operator_robot": robot}
    log["operator_tokens"] = rng.uniform(0, 192, (ticks + 1, h)).astype("f4")
    log["operator_choice"] = np.full((ticks + 1, h), NOT_DECIDED, "i2")
    return log


def _talk(scenario, ticks, rng):
    h, r = scenario.n_operators, scenario.n_robots
    m = max(8, int(0.4 * ticks * r))
    kinds = [k for k in Kind if (h or k in RELAYED) and (r > 1 or k != Kind.BROADCAST)]
    kind = rng.choice(kinds, m)
    robot, other, operator = rng.integers(0, r, m), rng.integers(1, max(2, r), m), rng.integers(0, max(1, h), m)
    climbs = (kind > Kind.BROADCAST) & (kind <= Kind.REQUEST)
    falls = kind > Kind.REQUEST
    fate = rng.choice(len(Fate), m, p=[0.01, 0.76, 0.04, 0.06, 0.06, 0.03, 0.04])
    queued = np.sort(rng.uniform(0, ticks, m))
    flies = (fate != Fate.EXPIRED) & (fate != Fate.NO_TOKENS)
    flight = np.where(rng.random(m) < 0.1, rng.integers(3, 9, m), 1)
    sent = np.where(flies, np.minimum(queued + rng.integers(0, 3, m), ticks), -1)
    return {
        "message_kind": kind.astype("i1"),
        "message_sender": np.where(falls, r + operator, robot).astype("i2"),
        "message_receiver": np.where(climbs, r + h, np.where(falls, robot, (robot + other) % r)).astype("i2"),
        "message_queued": queued.astype("f4"),
        "message_sent": sent.astype("f4"),
        "message_ended": np.where(fate == Fate.UNDERWAY, -1, np.where(flies, sent + flight, queued + 24)).astype("f4"),
        "message_fate": fate.astype("i1"),
        "message_late": flight > 1,
        "message_bytes": np.full(m, 64, "i2"),
    }


def _link_quality(scenario, world, xy):
    radios = xy[::SAMPLE_PERIOD]
    station = np.broadcast_to(world.layout.station.astype("f4"), (len(radios), 1, 2))
    ends = np.concatenate([radios, station], axis=1)
    distance = np.linalg.norm(radios[:, :, None] - ends[:, None], axis=-1) / scenario.map_side
    quality = np.where(distance < 0.3, 100 * np.sqrt(np.clip(1 - distance / 0.3, 0.05, 1)), 0)
    return quality.astype("u1")
