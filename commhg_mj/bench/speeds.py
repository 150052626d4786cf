"""Speeds of this machine, as rates per CPU-second (wall time on a shared machine says little)."""

import dataclasses
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from ..models.layout import draw_layout
from ..models.mjcf import build_model
from ..models.world import World, draw_world
from ..policies import prepare
from ..policies.planner import Planner
from ..policies.whole_missions import fly_whole
from ..radio import DEFAULT_LINKS
from ..radio.world_links import WorldLinks
from ..scenarios import SCENARIOS, Scenario

LINKS = ("abstract", "raycast")
OBSTACLES, FEWEST = (1, 4, 16), (4, 2)  # times so many forests and mountains, on the same share of the map
SCALING = ((4, 64), (8, 128), (16, 256), (32, 512), (64, 1024))  # robots, tasks
MOST_OBSTACLES = {"n_forests": 64, "n_mountains": 32}


class Speed(NamedTuple):
    what: str
    rate: float
    unit: str


class Flight(NamedTuple):
    """A timed flight of a batch to its end."""

    ticks: int
    epochs: int
    seconds: float  # of CPU

    @property
    def rate(self) -> float:
        """Ticks per CPU-second."""
        return self.ticks / self.seconds


def missions_rates(scenario, n_missions=64, repeats=3) -> list[Speed]:
    """Ticks per CPU-second of a batch with Greedy, decisions and observations included, under both link models."""
    planar, rays = _fly_timed(scenario, n_missions, repeats, LINKS)
    what = f"{scenario.name}: {n_missions} missions"
    return [
        Speed(f"{what}, abstract links", planar.rate, "ticks/CPU-s"),
        Speed(f"{what}, ray-cast links", rays.rate, "ticks/CPU-s"),
        Speed(f"{what}, ray-cast over abstract", rays.rate / planar.rate, "ratio"),
    ]


def epochs_rate(scenario, repeats=3) -> Speed:
    """Decision epochs per CPU-second of one mission alone; best of `repeats`."""
    (flight,) = _fly_timed(scenario, 1, repeats)
    return Speed(f"{scenario.name}: one mission alone", flight.epochs / flight.seconds, "epochs/CPU-s")


def planner_costs(scenario, n_missions=16, repeats=2) -> list[Speed]:
    """Milliseconds of CPU for a whole mission by the planner inside one kernel, and for one robot's decision in Python's loop."""
    batch, _ = prepare("planner", scenario, range(n_missions), links="abstract")
    whole = min(_cpu_seconds(partial(fly_whole, batch)) for _ in range(repeats + 1))
    observations, planner = batch.reset(), Planner(batch)
    decided, seconds = 0, 0.0
    while not batch.over.all():
        start = time.process_time()
        decisions = planner(observations)
        seconds += time.process_time() - start
        decided += len(observations.robots)
        observations = batch.step(decisions)
    what = f"{scenario.name}: the planner, abstract links"
    return [
        Speed(f"{what}, a whole mission", 1e3 * whole / n_missions, "CPU-ms"),
        Speed(f"{what}, a robot's decision", 1e3 * seconds / decided, "CPU-ms"),
    ]


def _fly_timed(scenario, n_missions, repeats, models=(DEFAULT_LINKS,)) -> list[Flight]:
    """The fastest of some flights of each link model after a warm-up, in turns: the machine's moods meet all alike."""
    teams = [prepare("greedy", scenario, range(n_missions), links=links) for links in models]
    rounds = [[_fly_once(*team) for team in teams] for _ in range(repeats + 1)]
    return [min(flights, key=lambda flight: flight.seconds) for flights in zip(*rounds)]


def _fly_once(batch, policy) -> Flight:
    observations, epochs = batch.reset(), 0
    start = time.process_time()
    while not batch.over.all():
        observations = batch.step(policy(observations))
        epochs += 1
    return Flight(int(batch.time.sum()), epochs, time.process_time() - start)


def link_costs(n_links=20_000, repeats=5) -> list[Speed]:
    """Microseconds of CPU for one ray-cast link between robots on the large map, with more and more obstacles."""
    large, costs = SCENARIOS["large"], []
    for times in OBSTACLES:
        forests, mountains = FEWEST[0] * times, FEWEST[1] * times
        rules = dataclasses.replace(large.world, n_forests=forests, n_mountains=mountains)
        scenario, rng = dataclasses.replace(large, world=rules), np.random.default_rng(0)
        layout = draw_layout(scenario, rng)
        links = WorldLinks(World(scenario, 0, layout, np.empty((0, 2)), np.empty(0), None), "raycast")  # type: ignore: nobody drives
        starts = rng.uniform(0, layout.side, (n_links, 2))
        ends = np.clip(starts + rng.uniform(-1, 1, (n_links, 2)) * links.rules["range"] / np.sqrt(2), 0, layout.side)
        a, b = (links.robot_antennas(xy, rng.integers(0, 2, n_links)) for xy in (starts, ends))
        seconds = min(_cpu_seconds(partial(links.between, a, b, 160)) for _ in range(repeats + 1))
        what = f"one link, {times}x obstacles ({len(layout.forests)} discs, {len(layout.mountains)} mountains)"
        costs.append(Speed(what, 1e6 * seconds / n_links, "CPU-us"))
    return costs


def _cpu_seconds(work) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def world_rate(scenario, n_worlds=5) -> Speed:
    """Worlds generated, routed and compiled with everything for the eye, per CPU-second."""
    start = time.process_time()
    for seed in range(n_worlds):
        build_model(draw_world(scenario, seed))
    return Speed(f"{scenario.name}: worlds", n_worlds / (time.process_time() - start), "worlds/CPU-s")


def scaling_rates(n_missions=4, time_limit=300) -> list[Speed]:
    """How the cost of a tick grows: (robot, task) pairs advanced per CPU-second should not fall."""
    speeds = []
    for robots, tasks in SCALING:
        scenario = _team(robots, tasks, time_limit)
        (flight,) = _fly_timed(scenario, n_missions, repeats=1)
        rate = flight.rate * robots * tasks
        speeds.append(Speed(f"{robots} robots x {tasks} tasks", rate / 1e6, "M pairs/CPU-s"))
    return speeds


def largest_costs(time_limit=300) -> list[Speed]:
    """Milliseconds of CPU for one second of one mission of the largest team: what the longest mission may take."""
    (robots, tasks), costs = SCALING[-1], []
    for words, obstacles in (("", {}), (", most obstacles", MOST_OBSTACLES)):
        scenario = _team(robots, tasks, time_limit, **obstacles)
        for policy, links in (("greedy", "perfect"), ("greedy", "abstract"), ("greedy", "raycast"), ("random", "raycast")):
            batch, act = prepare(policy, scenario, [0], links)
            flight = min((_fly_once(batch, act) for _ in range(2)), key=lambda flight: flight.seconds)
            what = f"{robots} robots x {tasks} tasks{words}: {policy}, {links} links"
            costs.append(Speed(what, 1e3 / flight.rate, "CPU-ms/s"))
    return costs


def _team(robots, tasks, time_limit, **obstacles) -> Scenario:
    base = SCENARIOS["large"]
    return dataclasses.replace(
        base, n_uav=robots // 2, n_ugv=robots - robots // 2, n_operators=max(1, robots * 3 // 8), n_tasks=tasks,
        time_limit=time_limit, world=dataclasses.replace(base.world, poi_spacing=0.01, **obstacles),
    )  # fmt: skip


def start_times() -> list[Speed]:
    """CPU-seconds of a start with an empty kernel cache and of the next one, to the end of a short mission."""
    command = [sys.executable, "-m", "commhg_mj.cli", "run", "--scenario", "small", "--json"]
    with tempfile.TemporaryDirectory() as cache:
        speeds = []
        for label in ("first start, kernels compiled", "later start"):
            before = os.times()
            subprocess.run(command, env={**os.environ, "NUMBA_CACHE_DIR": cache}, capture_output=True, check=True)
            after = os.times()
            seconds = after.children_user + after.children_system - before.children_user - before.children_system
            speeds.append(Speed(label, seconds, "CPU-s"))
    return speeds


def all_speeds(scenarios, with_start: bool) -> Iterator[Speed]:
    """Yield every speed of kernel, links and worlds; interfaces.py and training_rates.py have others."""
    for name in scenarios:
        yield from missions_rates(SCENARIOS[name])
        yield epochs_rate(SCENARIOS[name])
        yield world_rate(SCENARIOS[name])
        yield from planner_costs(SCENARIOS[name])
    yield from link_costs()
    yield from scaling_rates()
    yield from largest_costs()
    if with_start:
        yield from start_times()
