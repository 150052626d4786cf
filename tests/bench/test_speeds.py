"""The benchmark measures what it says; how fast this machine is belongs to no test."""

import itertools
import re
import subprocess
from functools import partial

import numpy as np
import pytest

from commhg_mj.bench import speeds as bench
from commhg_mj.scenarios import SCENARIOS, from_dict

TINY = from_dict({"base": "small", "name": "tiny", "n_tasks": 4, "time_limit": 40})


@pytest.fixture
def second_a_call(monkeypatch):
    """A clock on which everything takes one second."""
    clock = iter(range(10**6))
    monkeypatch.setattr(bench.time, "process_time", lambda: next(clock))


def test_rates_count_ticks_epochs_and_worlds(second_a_call):
    planar, rays, ratio = bench.missions_rates(TINY, n_missions=5, repeats=2)
    assert planar == ("tiny: 5 missions, abstract links", 5 * 40, "ticks/CPU-s")
    assert rays == ("tiny: 5 missions, ray-cast links", 5 * 40, "ticks/CPU-s")
    assert ratio == ("tiny: 5 missions, ray-cast over abstract", 1, "ratio")
    epochs = bench.epochs_rate(TINY, repeats=1)
    assert epochs.unit == "epochs/CPU-s" and 4 <= epochs.rate <= 41
    assert bench.world_rate(TINY, n_worlds=2) == ("tiny: worlds", 2, "worlds/CPU-s")


@pytest.mark.parametrize(
    "seconds, planar, rays",
    [
        ([1, 8, 2, 5, 4, 4, 3, 10], 200 / 1, 200 / 4),
        ([7, 2, 9, 2, 5, 2, 6, 2], 200 / 5, 200 / 2),
    ],
)
def test_both_models_take_turns_and_the_best_of_each_counts(monkeypatch, seconds, planar, rays):
    """Flights of the two models alternate; each lasts as long as it is told here."""
    starts = 1000 * np.arange(len(seconds))
    clock = itertools.chain.from_iterable(zip(starts, starts + seconds))
    monkeypatch.setattr(bench.time, "process_time", lambda: next(clock))
    speeds = bench.missions_rates(TINY, n_missions=5, repeats=3)
    assert [speed.rate for speed in speeds] == pytest.approx([planar, rays, rays / planar])
    assert next(clock, None) is None


def test_link_models_of_the_rates(monkeypatch):
    flown = []
    prepare = bench.prepare
    monkeypatch.setattr(bench, "prepare", lambda *args, **kwargs: flown.append(kwargs["links"]) or prepare(*args, **kwargs))
    bench.missions_rates(TINY, n_missions=1, repeats=1)
    bench.epochs_rate(TINY, repeats=1)
    assert flown == ["abstract", "raycast", "raycast"]


def test_a_link_is_timed_with_more_and_more_obstacles(second_a_call):
    costs = bench.link_costs(n_links=50, repeats=1)
    assert [speed.rate for speed in costs] == pytest.approx([1e6 / 50] * 3) and {speed.unit for speed in costs} == {"CPU-us"}
    discs, mountains = np.array([list(map(int, re.findall(r"(\d+) (?:discs|mountains)", speed.what))) for speed in costs]).T
    assert all(np.diff(discs) > 0) and all(np.diff(mountains) > 0)
    assert [speed.what.split(",")[1].split()[0] for speed in costs] == ["1x", "4x", "16x"]


def test_a_timed_link_is_in_range_and_ray_cast(monkeypatch):
    asked = []

    class Links(bench.WorldLinks):
        def between(self, a, b, size):
            found = super().between(a, b, size)
            asked.append((a, found))
            return found

    monkeypatch.setattr(bench, "WorldLinks", Links)
    bench.link_costs(n_links=400, repeats=0)
    shares = []
    for antennas, found in asked:
        assert np.isfinite(found["snr"]).all() and len(found) == 400
        clear = (found["forest"] == 0) & (found["diffraction"] == 0)
        assert np.all(found["passing"][clear] == 1), "a clear link passes nothing only out of range"
        assert antennas[:, 2].min() >= 1 and antennas[:, 2].max() >= 60
        shares.append((found["forest"] > 0).mean())
    assert len(asked) == 3 and min(shares) > 0.05


def test_scaling_counts_pairs(second_a_call, monkeypatch):
    monkeypatch.setattr(bench, "SCALING", ((2, 3), (5, 7)))
    speeds = bench.scaling_rates(n_missions=2, time_limit=20)
    assert [speed.what for speed in speeds] == ["2 robots x 3 tasks", "5 robots x 7 tasks"]
    assert [speed.rate * 1e6 for speed in speeds] == pytest.approx([2 * 20 * 6, 2 * 20 * 35])


def test_the_largest_missions_are_timed_a_second_of_theirs(second_a_call, monkeypatch):
    monkeypatch.setattr(bench, "SCALING", ((2, 3),))
    costs = bench.largest_costs(time_limit=20)
    assert [speed.rate for speed in costs] == [pytest.approx(1e3 / 20)] * 8 and {speed.unit for speed in costs} == {"CPU-ms/s"}
    assert costs[0].what == "2 robots x 3 tasks: greedy, perfect links" and "most obstacles: random, raycast" in costs[-1].what


def test_teams_of_the_scaling_are_possible():
    for robots, tasks in bench.SCALING:
        scenario = bench._team(robots, tasks, 300)
        assert (scenario.n_robots, scenario.n_tasks, scenario.time_limit) == (robots, tasks, 300)
    assert (robots, tasks) == (64, 1024)


def test_everything_that_bench_prints(monkeypatch):
    monkeypatch.setattr(bench, "SCALING", ((2, 3),))
    for name in SCENARIOS:
        monkeypatch.setitem(SCENARIOS, name, TINY)
    monkeypatch.setattr(bench, "missions_rates", partial(bench.missions_rates, n_missions=3, repeats=1))
    monkeypatch.setattr(bench, "link_costs", partial(bench.link_costs, n_links=100, repeats=1))
    monkeypatch.setattr(bench, "world_rate", partial(bench.world_rate, n_worlds=1))
    monkeypatch.setattr(bench, "planner_costs", partial(bench.planner_costs, n_missions=2, repeats=1))
    speeds = list(bench.all_speeds(["small", "large"], with_start=False))
    for_each = ["abstract links", "ray-cast links", "ray-cast over abstract", "one mission alone", "worlds"]
    for_each += ["a whole mission", "a robot's decision"]
    said = [re.split(r", |: ", speed.what)[-1] for speed in speeds]
    assert said[:14] == 2 * for_each and len(speeds) == 14 + len(bench.OBSTACLES) + 1 + 8
    assert [speed.what.startswith("one link, ") for speed in speeds[14:]] == 3 * [True] + 9 * [False]
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
