"""Links: metres through footprints, range, and what every model promises."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import change

from commhg_mj.base.terms import Footprint
from commhg_mj.models.layout import inside_any, unit_frame
from commhg_mj.models.world import make_world
from commhg_mj.radio import LINK_MODELS, find_link_model
from commhg_mj.radio.abstract import metres_inside
from commhg_mj.radio.link_models import radio_rules
from commhg_mj.radio.links import fates
from commhg_mj.radio.world_links import WorldLinks
from commhg_mj.scenarios import LIMITATIONS, SCENARIOS


def metres(world, kind, a, b):
    parts = world.layout.parts
    scratch = np.empty((2, max(1, len(parts))))
    return metres_inside(unit_frame(parts), np.ascontiguousarray(parts["kind"]), int(kind), *map(float, (*a, *b)), scratch)


def flat(points):
    """Antennas [n, 3] on the plain."""
    return np.c_[points, np.zeros(len(points))]


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


def test_planar_shares_are_exponential_in_the_metres_up_to_the_range():
    world = make_world(SCENARIOS["medium"], 2)
    a, b = np.random.default_rng(1).uniform(0, 1000, (2, 40, 2))
    links = WorldLinks(world, "abstract").between(flat(a), flat(b), 160)
    for link, start, end in zip(links, a, b):
        forest, mountain = (metres(world, kind, start, end) for kind in (Footprint.FOREST, Footprint.MOUNTAIN))
        assert (link["forest"], link["mountain"]) == pytest.approx((forest, mountain), abs=1e-9)
        in_range = np.hypot(*(end - start)) <= 300
        assert link["passing"] == pytest.approx(in_range * np.exp(-forest / 73.0 - mountain / 10.0))


@pytest.mark.parametrize("links", ["abstract", "abstract-fit", "raycast"])
def test_a_world_without_obstacles_lets_everything_pass_up_to_the_range(links):
    world = make_world(change(SCENARIOS["medium"], forest_share=0.0, mountain_share=0.0), 0)
    a, apart = np.array([[100.0, 100.0, 1.0]]), np.array([0.0, 1.0, 299.9, 300.0, 300.1])
    found = WorldLinks(world, links).between(a, a + apart[:, None] * [1, 0, 0], 160)
    assert found["passing"].tolist() == [1, 1, 1, 1, 0]
    assert found["on_time"].tolist() == [0.9, 0.9, 0.9, 0.9, 0] and found["late"] == pytest.approx([0.05] * 4 + [0])


@pytest.mark.parametrize("limitation", LIMITATIONS)
def test_one_passing_share_is_one_fate_under_every_model(limitation):
    """So a comparison differs by terrain alone."""
    models = [links for links in LINK_MODELS if links not in ("perfect", "known")]
    for passing in (0.0, 0.3, 1.0):
        assert len({fates(radio_rules(SCENARIOS["medium"], links, limitation), passing) for links in models}) == 1


def test_unknown_link_models_are_refused():
    with pytest.raises(ValueError, match="unknown link model 'smoke': use abstract, abstract-fit, raycast"):
        find_link_model("smoke")
