"""Speeds of this machine, as rates per CPU-second (wall time on a shared machine says little)."""

import dataclasses
import os
import subprocess
import sys
import tempfile
import time
from typing import NamedTuple

from ..models.mjcf import build_model
from ..models.world import make_world
from ..policies import prepare
from ..scenarios import SCENARIOS, Scenario

SCALING = ((4, 64), (8, 128), (16, 256), (32, 512), (64, 1024))  # robots, tasks


class Speed(NamedTuple):
    what: str
    rate: float
    unit: str


def missions_rate(scenario, n_missions=64, repeats=3) -> Speed:
    """Ticks per CPU-second of a batch with Greedy, decisions and observations included; best of `repeats`."""
    ticks, seconds, _ = _fly_timed(scenario, n_missions, repeats)
    return Speed(f"{scenario.name}: {n_missions} missions", ticks / seconds, "ticks/CPU-s")


def epochs_rate(scenario, repeats=3) -> Speed:
    """Decision epochs per CPU-second of one mission alone; best of `repeats`."""
    _, seconds, epochs = _fly_timed(scenario, 1, repeats)
    return Speed(f"{scenario.name}: one mission alone", epochs / seconds, "epochs/CPU-s")


def _fly_timed(scenario, n_missions, repeats):
    """(ticks, CPU-seconds, epochs) of the fastest of some flights after a warm-up."""
    batch, policy = prepare("greedy", scenario, range(n_missions))
    best = None
    for _ in range(repeats + 1):
        observations, epochs = batch.reset(), 0
        start = time.process_time()
        while not batch.over.all():
            observations = batch.step(policy(observations))
            epochs += 1
        seconds = time.process_time() - start
        if best is None or seconds < best[1]:
            best = int(batch.time.sum()), seconds, epochs
    return best


def world_rate(scenario, n_worlds=5) -> Speed:
    """Worlds generated, routed and compiled with everything for the eye, per CPU-second."""
    start = time.process_time()
    for seed in range(n_worlds):
        build_model(make_world.__wrapped__(scenario, seed))
    return Speed(f"{scenario.name}: worlds", n_worlds / (time.process_time() - start), "worlds/CPU-s")


def scaling_rates(n_missions=4, time_limit=300) -> list[Speed]:
    """How the cost of a tick grows: (robot, task) pairs advanced per CPU-second should not fall."""
    speeds = []
    for robots, tasks in SCALING:
        scenario = _team(robots, tasks, time_limit)
        ticks, seconds, _ = _fly_timed(scenario, n_missions, repeats=1)
        rate = ticks * robots * tasks / seconds
        speeds.append(Speed(f"{robots} robots x {tasks} tasks", rate / 1e6, "M pairs/CPU-s"))
    return speeds


def _team(robots, tasks, time_limit) -> Scenario:
    base = SCENARIOS["large"]
    return dataclasses.replace(
        base, n_uav=robots // 2, n_ugv=robots - robots // 2, n_operators=max(1, robots * 3 // 8), n_tasks=tasks,
        time_limit=time_limit, world=dataclasses.replace(base.world, poi_spacing=0.01),
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


def all_speeds(scenarios, with_start: bool):
    """Yield every speed that `commhg-mj bench` prints."""
    for name in scenarios:
        yield missions_rate(SCENARIOS[name])
        yield epochs_rate(SCENARIOS[name])
        yield world_rate(SCENARIOS[name])
    yield from scaling_rates()
    if with_start:
        yield from start_times()
