"""Layouts: obstacles, their surfaces, and the free ground around the station."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from strategies import change

from commhg_mj.base.terms import Footprint
from commhg_mj.models.layout import SURFACE_NODES, draw_layout, inside_any, surface_half_width, unit_frame
from commhg_mj.scenarios import SCENARIOS


def layout_of(scenario, seed):
    return draw_layout(scenario, np.random.default_rng(seed))


def grid(side, n=200):
    axis = (np.arange(n) + 0.5) / n * side
    return np.stack(np.meshgrid(axis, axis), axis=-1)


terrains = st.builds(
    dict,
    map_side=st.sampled_from([50.0, 120.0, 200.0, 500.0, 2000.0, 1e5]),
    forest_share=st.sampled_from([0.0, 0.1, 0.25, 0.4]),
    mountain_share=st.sampled_from([0.0, 0.05, 0.3]),
    n_forests=st.sampled_from([0, 1, 7, 64]),
    n_mountains=st.sampled_from([0, 1, 3, 32]),
    n_uav=st.integers(0, 32),
    n_ugv=st.integers(1, 32),
)


def crowded(map_side, **fields):
    """A small map full of obstacles."""
    full = dict(forest_share=0.25, mountain_share=0.3, n_forests=7, n_mountains=1, n_uav=32, n_ugv=32)
    return full | dict(map_side=map_side) | fields


@settings(max_examples=40)
@given(terrains, st.integers(0, 10**6))
@example(crowded(50.0, n_forests=64), 0)
@example(crowded(50.0, n_forests=64), 1)
@example(crowded(120.0, n_mountains=32), 2)
@example(crowded(120.0, n_mountains=32), 3)
def test_robots_and_station_stand_on_free_ground_within_the_map(terrain, seed):
    scenario = change(SCENARIOS["medium"], **terrain)
    layout = layout_of(scenario, seed)
    inflated = unit_frame(layout.parts, scenario.world.ugv_radius)
    assert not inside_any(inflated, layout.station) and not inside_any(unit_frame(layout.parts), layout.operators).any()
    assert not inside_any(inflated, layout.starts).any(), "robots start inside an obstacle"
    for places in (layout.station[None], layout.starts, layout.operators):
        assert np.all((places >= 0) & (places <= layout.side))
    assert layout.starts.shape == (scenario.n_robots, 2) and layout.operators.shape == (scenario.n_operators, 2)
    assert len(np.unique(layout.starts, axis=0)) == scenario.n_robots


@pytest.mark.parametrize("name", SCENARIOS)
def test_obstacles_cover_their_share_of_the_area(name):
    scenario, covered = SCENARIOS[name], []
    for seed in range(12):
        layout = layout_of(scenario, seed)
        points = grid(layout.side)
        covered.append([np.mean(inside_any(unit_frame(parts), points)) for parts in (layout.forests, layout.mountains)])
    forest, mountain = np.mean(covered, axis=0)
    assert 0.75 * 0.10 < forest < 1.15 * 0.10 and 0.75 * 0.05 < mountain < 1.05 * 0.05


@pytest.mark.parametrize("seed", range(4))
def test_surfaces_vanish_outside_footprints_and_reach_their_height(seed):
    layout = layout_of(SCENARIOS["large"], seed)
    assert layout.surfaces.shape == (5, SURFACE_NODES, SURFACE_NODES)
    for part, surface in zip(layout.mountains, layout.surfaces):
        assert surface.max() == pytest.approx(part["height"]) and surface.min() == 0
        assert 60 <= part["height"] <= 150
        half = surface_half_width(part)
        axis = np.linspace(-half, half, SURFACE_NODES)
        nodes = np.stack(np.meshgrid(axis, axis), axis=-1) + [part["x"], part["y"]]
        inside = inside_any(unit_frame(np.array([part])), nodes)
        assert np.all(surface[~inside] == 0) and np.mean(surface[inside] > 0) > 0.9


@pytest.mark.parametrize("seed", range(3))
def test_ground_height_is_the_surface_at_nodes_and_zero_on_the_plain(seed):
    layout = layout_of(SCENARIOS["medium"], seed)
    points = grid(layout.side)
    height = layout.ground_height(points)
    cell = max(2 * surface_half_width(part) / (SURFACE_NODES - 1) for part in layout.mountains)
    near = inside_any(unit_frame(layout.mountains, 1.5 * cell), points)
    assert np.all(height[~near] == 0) and np.all(height >= 0) and height.max() > 40
    part, surface = layout.mountains[0], layout.surfaces[0]
    half = surface_half_width(part)
    axis = np.linspace(-half, half, SURFACE_NODES)
    nodes = np.stack(np.meshgrid(axis, axis), axis=-1) + [part["x"], part["y"]]
    np.testing.assert_allclose(np.maximum(layout.ground_height(nodes), surface), layout.ground_height(nodes), atol=1e-6)
    assert layout.ground_height(layout.station) == 0 and layout.ground_height(points[0, 0]).shape == ()


def test_ground_height_is_continuous():
    layout = layout_of(SCENARIOS["large"], 1)
    part = layout.mountains[0]
    line = np.stack(
        [
            np.linspace(part["x"] - 1.2 * part["a"], part["x"] + 1.2 * part["a"], 20_001),
            np.full(20_001, part["y"] + 3.0),
        ],
        -1,
    )
    step = line[1, 0] - line[0, 0]
    assert np.abs(np.diff(layout.ground_height(line))).max() < 15 * step


def test_layouts_depend_on_the_seed_alone():
    one, same, other = (layout_of(SCENARIOS["medium"], seed) for seed in (1, 1, 2))
    assert np.array_equal(one.parts, same.parts) and np.array_equal(one.surfaces, same.surfaces)
    assert np.array_equal(one.starts, same.starts) and not np.array_equal(one.parts, other.parts)


@settings(max_examples=15)
@given(terrains, st.integers(0, 10**6))
def test_parts_are_ordered_rounded_and_of_their_kind(terrain, seed):
    scenario = change(SCENARIOS["medium"], **terrain)
    layout = layout_of(scenario, seed)
    rules, parts = scenario.world, layout.parts
    assert np.all(np.diff(parts["kind"]) <= 0) or np.array_equal(
        parts, np.concatenate([layout.mountains, layout.forests])
    )
    assert len(layout.mountains) == len(layout.surfaces) <= (rules.n_mountains if rules.mountain_share > 0 else 0)
    forests = layout.forests
    assert len(np.unique(forests["group"])) <= (rules.n_forests if rules.forest_share > 0 else 0)
    assert np.all(forests["a"] == forests["b"]) and np.all(np.bincount(forests["group"], minlength=1) <= 4)
    assert np.all((forests["height"] >= 12) & (forests["height"] <= 20))
    for name in ("x", "y", "a", "b", "height"):
        assert np.array_equal(parts[name], np.round(parts[name], 2))
    assert np.all((parts["kind"] == Footprint.FOREST) | (parts["kind"] == Footprint.MOUNTAIN))


@pytest.mark.parametrize("name", SCENARIOS)
def test_named_scenarios_have_all_their_obstacles(name):
    rules = SCENARIOS[name].world
    for seed in range(20):
        layout = layout_of(SCENARIOS[name], seed)
        assert len(layout.mountains) == rules.n_mountains and len(np.unique(layout.forests["group"])) == rules.n_forests


def test_inside_any_agrees_with_the_definition_of_an_ellipse():
    layout = layout_of(SCENARIOS["large"], 3)
    points = np.random.default_rng(0).uniform(0, layout.side, (2000, 2))
    inside = np.zeros(len(points), bool)
    for part in layout.parts:
        dx, dy = points[:, 0] - part["x"], points[:, 1] - part["y"]
        along = np.cos(part["angle"]) * dx + np.sin(part["angle"]) * dy
        across = -np.sin(part["angle"]) * dx + np.cos(part["angle"]) * dy
        inside |= (along / part["a"]) ** 2 + (across / part["b"]) ** 2 < 1
    assert np.array_equal(inside_any(unit_frame(layout.parts), points), inside)
