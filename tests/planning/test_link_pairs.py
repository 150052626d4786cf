"""Pairs: every link along a mission, held against links asked one by one and against the mission's own log."""

import itertools

import numpy as np
import pytest
from strategies import change

from commhg_mj.base.terms import Activity
from commhg_mj.flights.fly import fly_to_end
from commhg_mj.mission.trace import make_traces
from commhg_mj.models.world import make_world
from commhg_mj.planning.link_pairs import CLASSES, links_of
from commhg_mj.radio.world_links import WorldLinks
from commhg_mj.scenarios import SCENARIOS

THICK = change(
    SCENARIOS["small"], n_tasks=10, time_limit=120, n_uav=3, n_ugv=3, forest_share=0.35, n_forests=8, mountain_share=0.1,
    mountain_height=(100.0, 150.0), malfunction=0.5, uav_height=25.0, autonomous_speed=(18.0, 10.0),
)  # fmt: skip
FITTED = THICK.radio.fitted_forest_decay, THICK.radio.fitted_mountain_decay
STATION = THICK.n_robots
SEED, LEVEL = 7, "low"


def trace_of(links):
    return make_traces(fly_to_end("greedy", THICK, [SEED], links, LEVEL, record=True), "greedy")[0]


@pytest.fixture(scope="module")
def trace():
    return trace_of("raycast")


@pytest.fixture(scope="module")
def links(trace):
    return links_of(trace)


def antennas(world, trace, time):
    """[R + 1, 3] of the robots and the station, by the scenario's own numbers."""
    xy = np.concatenate([trace.robot_xy[time].astype(float), world.layout.station[None]])
    heights = np.array([25.0] * 3 + [1.0] * 3 + [15.0])
    base = np.where(np.arange(len(xy)) < 3, world.layout.flight_floor(xy), world.layout.ground_height(xy))
    return np.c_[xy, base + heights]


def test_the_mission_shows_something(trace, links):
    assert (trace.robot_activity[-1] == Activity.FAILED).any() and set(links["kind"]) == {0, 1, 2, 3}
    robots = links[(links["b"] != STATION) & links["in_range"]]
    assert (robots["planar_forest"] > 0).mean() > 0.05 and (robots["ray_forest"] > 0).any() and links["ray_blocked"].any()
    assert not links["in_range"].all()


def test_every_living_pair_has_a_row_a_second_in_order(trace, links):
    expected = [
        (time, a, b)
        for time in range(trace.ticks + 1)
        for a, b in itertools.combinations(range(STATION + 1), 2)
        if trace.robot_activity[time, a] != Activity.FAILED
        and (b == STATION or trace.robot_activity[time, b] != Activity.FAILED)
    ]
    assert [tuple(row) for row in links[["time", "a", "b"]].tolist()] == expected


def test_classes(links):
    for row in links:
        ends = sorted("UAV" if robot < 3 else "UGV" for robot in (row["a"], row["b"]) if robot != STATION)
        assert CLASSES[row["kind"]] == ("robot-station" if row["b"] == STATION else "-".join(ends))


def test_rows_agree_with_links_asked_one_by_one(trace, links):
    world = make_world(THICK, SEED)
    models = {model: WorldLinks(world, model, LEVEL) for model in ("abstract", "abstract-fit", "raycast")}
    chosen = np.random.default_rng(0).choice(len(links), 150, replace=False)
    interesting = np.flatnonzero(links["ray_blocked"] | (links["ray_forest"] > 0))[:100]
    for row in links[np.unique(np.r_[chosen, interesting])]:
        places = antennas(world, trace, row["time"])
        a, b = places[[row["a"]]], places[[row["b"]]]
        if row["b"] == STATION:
            seen = {name: model.to_station(a, 64)[0] for name, model in models.items()}
        else:
            seen = {name: model.between(a, b, 160)[0] for name, model in models.items()}
        flat, fit, cast = seen.values()
        excess = cast["foliage"] + cast["diffraction"]
        for name, value in (
            ("planar_forest", flat["forest"]), ("planar_mountain", flat["mountain"]), ("planar_passing", flat["passing"]),
            ("planar_delivered", flat["on_time"] + flat["late"]), ("fit_delivered", fit["on_time"] + fit["late"]),
            ("ray_forest", cast["forest"]), ("ray_blocked", cast["is_blocked"]), ("ray_excess", excess),
            ("ray_delivered", cast["on_time"] + cast["late"]),
        ):  # fmt: skip
            assert row[name] == pytest.approx(value, rel=1e-5, abs=1e-6), (name, row)


def test_the_range_is_the_limitation_levels_and_planar(trace, links):
    robots = links[links["b"] != STATION]
    xy = trace.robot_xy.astype(float)
    way = np.linalg.norm(xy[robots["time"], robots["a"]] - xy[robots["time"], robots["b"]], axis=-1)
    np.testing.assert_array_equal(robots["in_range"], way <= 0.22 * 500)
    assert (robots["planar_delivered"][~robots["in_range"]] == 0).all()
    assert (robots["ray_delivered"][~robots["in_range"]] == 0).all(), "matched: the same cap"


def test_planar_columns_are_the_papers_formula(links):
    for deliver, forest, mountain in (("planar_delivered", 73.0, 10.0), ("fit_delivered", *FITTED)):
        robots = links[(links["b"] != STATION) & links["in_range"]]
        expected = 0.9 * np.exp(-robots["planar_forest"] / forest - robots["planar_mountain"] / mountain)
        np.testing.assert_allclose(robots[deliver], expected, atol=1e-5)


def test_station_rows_have_no_range_and_no_planar_terrain(links):
    station = links[links["b"] == STATION]
    assert station["in_range"].all() and (station["kind"] == 3).all() and not (links["a"] == STATION).any()
    np.testing.assert_allclose(station["planar_delivered"], 0.9, atol=1e-6)
    assert station["ray_delivered"].min() < 0.5, "rays see it"


@pytest.mark.parametrize("model, column", [("raycast", "ray_delivered"), ("abstract", "planar_delivered")])
def test_rows_are_what_the_mission_itself_logged(model, column):
    """The trace's link qualities come from the mission's kernels, seen from its own state."""
    trace = trace_of(model)
    rows = links_of(trace, trace.link_period)
    logged = trace.link_quality[rows["time"] // trace.link_period, rows["a"], rows["b"]].astype(float)
    assert np.abs(logged - 100 * rows[column]).max() <= 0.6, "rounded to percent; positions of a trace are rounded too"
    assert 0 < np.mean(logged < 50) < 1


def test_the_period_thins(trace, links):
    np.testing.assert_array_equal(links_of(trace, 7), links[links["time"] % 7 == 0])


@pytest.mark.parametrize("team", [(1, 0), (0, 1), (2, 0), (0, 2)])
def test_the_smallest_teams(team):
    scenario = change(THICK, n_uav=team[0], n_ugv=team[1], n_operators=0, n_tasks=2, time_limit=10, malfunction=0.0)
    trace = make_traces(fly_to_end("greedy", scenario, [1], record=True), "greedy")[0]
    rows, n = links_of(trace), sum(team)
    assert len(rows) == (trace.ticks + 1) * n * (n + 1) // 2
    assert set(rows["kind"]) == ({3} if n == 1 else {3, 0 if team[0] else 2})


def test_shadowing_counts_as_excess():
    scenario = change(THICK, shadowing=4.0, time_limit=10, n_tasks=2, malfunction=0.0, forest_share=0.0, mountain_share=0.0)
    trace = make_traces(fly_to_end("greedy", scenario, [1], record=True), "greedy")[0]
    rows = links_of(trace)
    assert (rows["ray_forest"] == 0).all() and (rows["ray_excess"] != 0).all() and np.abs(rows["ray_excess"]).max() < 25
