"""Links: metres through footprints, range, and what every model promises."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import change

from commhg_mj.mission.batch import MissionBatch
from commhg_mj.models.layout import inside_any, unit_frame
from commhg_mj.models.world import make_world
from commhg_mj.radio import find_link_model
from commhg_mj.radio.abstract import metres_inside, planar_clearance
from commhg_mj.radio.links import robot_link
from commhg_mj.scenarios import SCENARIOS
from commhg_mj.terms import Footprint


def terrain(world):
    """(frames, kinds, scratch) of a world's footprints."""
    parts = world.layout.parts
    return unit_frame(parts), np.ascontiguousarray(parts["kind"]), np.empty((2, max(1, len(parts))))


def metres(world, kind, a, b):
    frames, kinds, scratch = terrain(world)
    return metres_inside(frames, kinds, int(kind), *map(float, (*a, *b)), scratch)


def sampled_metres(parts, a, b, n=40_001):
    points = a + np.linspace(0, 1, n)[:, None] * (b - a)
    return np.mean(inside_any(unit_frame(parts), points)) * np.hypot(*(b - a))


@pytest.mark.parametrize("kind, name", [(Footprint.FOREST, "forests"), (Footprint.MOUNTAIN, "mountains")])
def test_metres_inside_agree_with_dense_sampling(kind, name):
    rng, touched = np.random.default_rng(0), 0
    for seed in range(4):
        world = make_world(SCENARIOS["medium"], seed)
        for a, b in rng.uniform(0, 1000, (12, 2, 2)):
            exact, sampled = metres(world, kind, a, b), sampled_metres(getattr(world.layout, name), a, b)
            assert exact == pytest.approx(sampled, abs=0.2)
            touched += exact > 1
    assert touched >= 8


coordinates = st.tuples(st.floats(0, 1000), st.floats(0, 1000)).map(np.array)


@settings(max_examples=60)
@given(coordinates, coordinates, st.floats(0, 1))
def test_metres_are_symmetric_additive_and_no_more_than_the_way(a, b, share):
    world = make_world(SCENARIOS["medium"], 1)
    middle, way = a + share * (b - a), np.hypot(*(b - a))
    for kind in Footprint:
        whole = metres(world, kind, a, b)
        assert 0 <= whole <= way + 1e-9
        assert whole == pytest.approx(metres(world, kind, b, a), abs=1e-6)
        assert whole == pytest.approx(metres(world, kind, a, middle) + metres(world, kind, middle, b), abs=1e-6)


def test_overlapping_discs_of_one_forest_count_once():
    world = make_world(SCENARIOS["medium"], 1)
    part = world.layout.forests[:1].copy()
    twice = np.concatenate([part, part, part])
    twice["a"][2] = twice["b"][2] = part["a"][0] / 2
    kinds, scratch = np.ascontiguousarray(twice["kind"]), np.empty((2, 3))
    x, y, radius = part["x"][0], part["y"][0], part["a"][0]
    inside = metres_inside(
        unit_frame(twice), kinds, int(Footprint.FOREST), x - 2 * radius, y, x + 2 * radius, y, scratch
    )
    assert inside == pytest.approx(2 * radius)


def test_metres_inside_a_footprint_are_the_way_itself():
    world = make_world(SCENARIOS["medium"], 1)
    part = world.layout.mountains[0]
    centre = np.array([part["x"], part["y"]])
    near = centre + [0.3 * part["b"], 0.2 * part["b"]]
    assert metres(world, Footprint.MOUNTAIN, centre, near) == pytest.approx(np.hypot(*(near - centre)))
    assert metres(world, Footprint.MOUNTAIN, centre, centre) == 0


def test_clearance_is_exponential_in_the_metres():
    world = make_world(SCENARIOS["medium"], 2)
    frames, kinds, scratch = terrain(world)
    for a, b in np.random.default_rng(1).uniform(0, 1000, (20, 2, 2)):
        forest, mountain = (metres(world, kind, a, b) for kind in (Footprint.FOREST, Footprint.MOUNTAIN))
        share = planar_clearance(frames, kinds, 73.0, 10.0, *a, *b, scratch)
        assert share == pytest.approx(np.exp(-forest / 73.0 - mountain / 10.0)) and 0 <= share <= 1


def test_a_world_without_obstacles_lets_everything_pass_up_to_the_range():
    scenario = change(SCENARIOS["medium"], forest_share=0.0, mountain_share=0.0)
    world = make_world(scenario, 0)
    rules = MissionBatch(scenario, [0]).state.missions[0]["rules"]
    frames, kinds, scratch = terrain(world)
    for metres_apart, share in ((0.0, 1.0), (1.0, 1.0), (299.9, 1.0), (300.0, 1.0), (300.1, 0.0)):
        assert robot_link(rules, frames, kinds, scratch, 100.0, 100.0, 100.0 + metres_apart, 100.0) == share


def test_unknown_link_models_are_refused():
    with pytest.raises(ValueError, match="unknown link model 'smoke': use abstract, perfect"):
        find_link_model("smoke")
