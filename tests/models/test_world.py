"""Worlds: points of interest, reproducibility, and what does not fit."""

import numpy as np
import pytest
from hypothesis import given, settings
from strategies import change, scenarios, seeds

from commhg_mj.base.terms import TaskType
from commhg_mj.models.layout import inside_any, unit_frame
from commhg_mj.models.world import kept_world, make_world
from commhg_mj.scenarios import SCENARIOS


@settings(max_examples=25)
@given(scenarios(), seeds)
def test_pois_keep_their_distance_lie_on_the_map_and_are_reachable_where_they_must(scenario, seed):
    world = make_world(scenario, seed)
    assert world.pois.shape == (scenario.n_tasks, 2) and len(world.poi_types) == scenario.n_tasks
    assert np.all((world.pois > 0) & (world.pois < scenario.map_side))
    gap = np.hypot(*(world.pois[:, None] - world.pois).transpose(2, 0, 1))
    np.fill_diagonal(gap, np.inf)
    assert gap.min() >= scenario.world.poi_spacing * scenario.map_side - 1e-9
    ground = np.flatnonzero(world.poi_types != TaskType.UAV_ONLY)
    inflated = unit_frame(world.layout.parts, scenario.world.ugv_radius)
    assert not inside_any(inflated, world.pois[ground]).any()
    for start in world.layout.starts[[0, -1]]:
        for task in ground[:20]:
            assert np.isfinite(world.path(start, task)).all()


def test_a_world_depends_on_scenario_and_seed_alone():
    scenario = SCENARIOS["small"]
    world = make_world(scenario, 3)
    kept_world.cache_clear()
    again, other = make_world(scenario, 3), make_world(scenario, 4)
    assert again is not world and again is make_world(scenario, 3)
    for name in ("pois", "poi_types"):
        assert np.array_equal(getattr(world, name), getattr(again, name))
        assert not np.array_equal(getattr(world, name), getattr(other, name))
    assert all(np.array_equal(a, b) for a, b in zip(world.routes, again.routes))


def test_no_two_of_many_worlds_are_alike():
    pois = {make_world(SCENARIOS["small"], seed).pois.tobytes() for seed in range(25)}
    assert len(pois) == 25


def test_rules_of_communication_do_not_move_the_world():
    one = make_world(SCENARIOS["small"], 3)
    other = make_world(change(SCENARIOS["small"], refill=1.0, malfunction=0.5), 3)
    assert np.array_equal(one.pois, other.pois) and np.array_equal(one.layout.parts, other.layout.parts)


def test_types_come_in_their_shares():
    types = np.concatenate([make_world(SCENARIOS["large"], seed).poi_types for seed in range(8)])
    share = np.bincount(types, minlength=3) / len(types)
    np.testing.assert_allclose(share, [0.25, 0.25, 0.5], atol=4 * np.sqrt(0.25 / len(types)))


def test_pois_that_do_not_fit_are_refused_by_their_field():
    with pytest.raises(ValueError, match="n_tasks = 1024 .*world.poi_spacing = 0.1"):
        make_world(change(SCENARIOS["small"], n_tasks=1024, poi_spacing=0.1), 0)
