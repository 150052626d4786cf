"""The benchmark measures what it says; how fast this machine is belongs to no test."""

import subprocess

import numpy as np
import pytest

from commhg_mj.scenarios import SCENARIOS, from_dict
from commhg_mj.study import bench

TINY = from_dict({"base": "small", "name": "tiny", "n_tasks": 4, "time_limit": 40})


@pytest.fixture
def second_a_call(monkeypatch):
    """A clock on which everything takes one second."""
    clock = iter(range(10**6))
    monkeypatch.setattr(bench.time, "process_time", lambda: next(clock))


def test_rates_count_ticks_epochs_and_worlds(second_a_call):
    assert bench.missions_rate(TINY, n_missions=5, repeats=2) == ("tiny: 5 missions", 5 * 40, "ticks/CPU-s")
    epochs = bench.epochs_rate(TINY, repeats=1)
    assert epochs.unit == "epochs/CPU-s" and 4 <= epochs.rate <= 41
    assert bench.world_rate(TINY, n_worlds=2) == ("tiny: worlds", 2, "worlds/CPU-s")


def test_scaling_counts_pairs(second_a_call, monkeypatch):
    monkeypatch.setattr(bench, "SCALING", ((2, 3), (5, 7)))
    speeds = bench.scaling_rates(n_missions=2, time_limit=20)
    assert [speed.what for speed in speeds] == ["2 robots x 3 tasks", "5 robots x 7 tasks"]
    assert [speed.rate * 1e6 for speed in speeds] == pytest.approx([2 * 20 * 6, 2 * 20 * 35])


def test_teams_of_the_scaling_are_possible():
    for robots, tasks in bench.SCALING:
        scenario = bench._team(robots, tasks, 300)
        assert (scenario.n_robots, scenario.n_tasks, scenario.time_limit) == (robots, tasks, 300)
    assert (robots, tasks) == (64, 1024)


def test_everything_that_bench_prints(monkeypatch):
    monkeypatch.setattr(bench, "SCALING", ((2, 3),))
    for name in SCENARIOS:
        monkeypatch.setitem(SCENARIOS, name, TINY)
    speeds = list(bench.all_speeds(["small", "large"], with_start=False))
    assert len(speeds) == 2 * 3 + 1
    assert all(np.isfinite(speed.rate) and speed.rate > 0 for speed in speeds)


def test_starts_are_timed_with_a_kernel_cache_of_their_own(monkeypatch):
    caches = []

    def run(command, env, capture_output, check):
        caches.append(env["NUMBA_CACHE_DIR"])
        assert check and "small" in command

    monkeypatch.setattr(subprocess, "run", run)
    first, later = bench.start_times()
    assert len(caches) == 2 and len(set(caches)) == 1, "empty first, then filled"
    assert (first.unit, later.unit) == ("CPU-s", "CPU-s") and "first" in first.what and "later" in later.what
