"""Ground routes: shortest, around every footprint, the same both ways."""

import numpy as np
import pytest
from flying import Wanderer, flown
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.csgraph import dijkstra
from strategies import change, scenarios, seeds

from commhg_mj.base.terms import TaskType
from commhg_mj.models.layout import inside_any, unit_frame
from commhg_mj.models.world import make_world
from commhg_mj.scenarios import SCENARIOS

NAMED = [("small", 1), ("small", 2), ("medium", 1), ("large", 5)]
SLACK = 0.05  # m that a route may graze into the inflated rim


def length_of(path):
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def crosses(world, path, slack=SLACK):
    """Whether points along a route lie inside the inflated footprints."""
    frames = unit_frame(world.layout.parts, world.scenario.world.ugv_radius - slack)
    for a, b in zip(path, path[1:]):
        n = max(2, int(2 * np.hypot(*(b - a))))
        if inside_any(frames, a + np.linspace(0, 1, n)[:, None] * (b - a)).any():
            return True
    return False


def ground_tasks(world):
    return np.flatnonzero(world.poi_types != TaskType.UAV_ONLY)


@pytest.mark.parametrize("name, seed", NAMED)
def test_routes_go_around_every_inflated_footprint(name, seed):
    world = make_world(SCENARIOS[name], seed)
    start = world.layout.starts.mean(axis=0)
    for task in ground_tasks(world):
        path = world.path(start, task)
        assert np.array_equal(path[0], start) and np.array_equal(path[-1], world.pois[task])
        assert not crosses(world, path)
        assert np.all((path >= 0) & (path <= world.layout.side))


@pytest.mark.parametrize("name, seed", NAMED)
def test_lengths_are_symmetric_no_shorter_than_straight_and_obey_the_triangle(name, seed):
    world = make_world(SCENARIOS[name], seed)
    tasks = ground_tasks(world)
    lengths = world.routes.between[np.ix_(tasks, tasks)].astype(float)
    straight = np.hypot(*(world.pois[tasks][:, None] - world.pois[tasks]).transpose(2, 0, 1))
    assert np.all(np.isfinite(lengths)) and np.all(np.diag(lengths) == 0)
    assert np.all(lengths >= straight - 1e-2)
    np.testing.assert_allclose(lengths, lengths.T, atol=0.05)
    detour = lengths[:, :, None] + lengths[None]
    assert np.all(lengths[:, None] <= detour.transpose(0, 1, 2) + 0.1)
    assert np.any(lengths > straight + 1), "nothing to go around"


@pytest.mark.parametrize("name, seed", NAMED[:3])
def test_stored_lengths_are_those_of_the_paths(name, seed):
    world = make_world(SCENARIOS[name], seed)
    tasks = ground_tasks(world)
    for i in tasks[:8]:
        for j in tasks:
            path = world.path(world.pois[i], j)
            assert length_of(path) == pytest.approx(world.routes.between[i, j], abs=0.05)


def fine_lengths(world, start, tasks, corners=40):
    """Shortest lengths by a finer polygon around every part, all pairs checked: an independent reference."""
    parts, radius = world.layout.parts, world.scenario.world.ugv_radius
    turn = 2 * np.pi * np.arange(corners) / corners
    reach = 1.0005 / np.cos(np.pi / corners)
    nodes = [np.array([start]), world.pois[tasks]]
    for part in parts:
        u, v = (part["a"] + radius) * reach * np.cos(turn), (part["b"] + radius) * reach * np.sin(turn)
        cos, sin = np.cos(part["angle"]), np.sin(part["angle"])
        nodes.append(np.stack([part["x"] + cos * u - sin * v, part["y"] + sin * u + cos * v], axis=-1))
    nodes = np.concatenate(nodes)
    frames = unit_frame(parts, radius)
    inside = inside_any(frames, nodes) | np.any((nodes < radius) | (nodes > world.layout.side - radius), axis=1)
    inside[: 1 + len(tasks)] = False
    nodes = nodes[~inside]
    delta = nodes[None] - nodes[:, None]
    lengths = np.hypot(*delta.transpose(2, 0, 1))
    blocked = np.zeros(lengths.shape, bool)
    for x, y, m00, m01, m10, m11 in frames:
        p = np.stack(
            [m00 * (nodes[:, 0] - x) + m01 * (nodes[:, 1] - y), m10 * (nodes[:, 0] - x) + m11 * (nodes[:, 1] - y)], -1
        )
        d = p[None] - p[:, None]
        along = -np.einsum("ik,ijk->ij", p, d) / np.maximum(1e-12, np.einsum("ijk,ijk->ij", d, d))
        closest = p[:, None] + np.clip(along, 0, 1)[..., None] * d
        blocked |= np.einsum("ijk,ijk->ij", closest, closest) < 1 - 1e-6
    lengths[blocked] = 0  # no edge
    return dijkstra(lengths, indices=0)[1 : 1 + len(tasks)]


@pytest.mark.parametrize("name, seed", [("small", 1), ("small", 7), ("medium", 2)])
def test_routes_are_as_short_as_a_finer_independent_search_finds(name, seed):
    world = make_world(SCENARIOS[name], seed)
    start, tasks = world.layout.starts.mean(axis=0), ground_tasks(world)
    ours = np.array([length_of(world.path(start, task)) for task in tasks])
    finer = fine_lengths(world, start, tasks)
    assert np.all(ours >= finer * (1 - 1e-4) - 0.05), "shorter than possible"
    assert np.all(ours <= finer * 1.03 + 0.5), "longer than a twelve-cornered polygon explains"


def test_uav_only_tasks_on_obstacles_have_no_ground_route():
    for seed in range(20):
        world = make_world(SCENARIOS["medium"], seed)
        frames = unit_frame(world.layout.parts, world.scenario.world.ugv_radius)
        for task in np.flatnonzero(inside_any(frames, world.pois)):
            assert world.poi_types[task] == TaskType.UAV_ONLY
            assert not np.isfinite(world.routes.between[task]).any()
            return
    raise AssertionError("no POI on any obstacle of twenty worlds")


def test_crowded_worlds_have_true_routes():
    """As many obstacles as a scenario may have: more corners in sight than one query considers by default."""
    scenario = change(
        SCENARIOS["large"],
        n_forests=64,
        n_mountains=32,
        forest_share=0.15,
        mountain_share=0.05,
        n_tasks=60,
        poi_spacing=0.005,
    )
    for seed in range(2):
        world = make_world(scenario, seed)
        for start in (world.layout.starts.mean(axis=0), world.pois[ground_tasks(world)[0]]):
            for task in ground_tasks(world):
                assert not crosses(world, world.path(start, task))


@settings(max_examples=12)
@given(scenarios(n_ugv=4, n_uav=2), seeds, st.sampled_from([0.02, 0.5]))
def test_ground_robots_never_drive_into_a_footprint(scenario, seed, restless):
    batch = flown(scenario, [seed], Wanderer(seed % 99, restless), record=True)
    log = batch.log.robots[0][: batch.time[0] + 1, scenario.n_uav :]
    frames = unit_frame(batch.worlds[0].layout.parts, scenario.world.ugv_radius - 0.2)
    assert not inside_any(frames, np.stack([log["x"], log["y"]], axis=-1)).any()


@pytest.mark.parametrize("name, seed", [*NAMED, ("small", 1001511)])  # the last: a POI close to a forest, within its polygon
def test_every_ground_task_is_reached_from_every_other(name, seed):
    world = make_world(SCENARIOS[name], seed)
    tasks = ground_tasks(world)
    assert np.isfinite(world.routes.between[np.ix_(tasks, tasks)]).all()


def test_a_vehicle_between_an_obstacle_and_its_polygon_finds_a_way():
    """Where a leg passed close to a forest of this world and was given up, no corner lies along a tangent."""
    world = make_world(SCENARIOS["small"], 1002614)
    for task in ground_tasks(world):
        path = world.path(np.array([239.3185272216797, 433.069091796875]), task)
        assert not crosses(world, path) and np.isfinite(length_of(path))
