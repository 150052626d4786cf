"""Parts of scenarios: as dense as the whole."""

import numpy as np
import pytest
from hypothesis import given, settings
from strategies import change, scenarios

from commhg_mj.models.world import make_world
from commhg_mj.scenarios import SCENARIOS, part_of
from commhg_mj.scenarios.heightmap import PIXELS, to_text


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_part_is_as_dense_as_the_whole(name):
    whole, part = SCENARIOS[name], part_of(SCENARIOS[name], 4)
    assert (part.n_uav, part.n_ugv, part.n_operators) == (2, 2, 2)
    for count in ("n_robots", "n_tasks"):
        density = [getattr(scenario, count) / scenario.map_side**2 for scenario in (whole, part)]
        assert density[0] == pytest.approx(density[1])
    for table, field in (("communication", "range"), ("robots", "sensing_radius"), ("world", "poi_spacing")):
        in_metres = [scenario.map_side * np.array(getattr(getattr(scenario, table), field)) for scenario in (whole, part)]
        assert in_metres[0] == pytest.approx(in_metres[1])
    assert (whole.time_limit, whole.tasks, whole.operators) == (part.time_limit, part.tasks, part.operators)
    assert make_world(part, 1).scenario == part


def test_the_whole_is_its_own_part():
    small = SCENARIOS["small"]
    assert part_of(small, 4) is small and part_of(small, 64) is small
    assert part_of(small, 2).n_robots == 2


@settings(max_examples=40, deadline=None)
@given(scenarios())
def test_every_scenario_has_parts(scenario):
    part = part_of(scenario, 4)
    assert part.n_robots <= max(5, scenario.n_robots) and part.map_side <= scenario.map_side
    assert (part.n_uav > 0, part.n_ugv > 0, part.n_operators > 0) == (
        scenario.n_uav > 0, scenario.n_ugv > 0, scenario.n_operators > 0,
    )  # fmt: skip


def test_a_picture_of_mountains_is_not_cut():
    pictured = change(SCENARIOS["large"], heightmap=to_text(np.linspace(0.0, 1.0, PIXELS**2).reshape(PIXELS, PIXELS)))
    assert part_of(pictured, 4) is pictured
