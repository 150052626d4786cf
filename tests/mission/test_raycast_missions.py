"""Missions under ray-cast links: the same as under planar ones without obstacles, others with them."""

import copy
import ctypes
import pickle
import warnings

import numpy as np
import pytest
from flying import differences, fingerprint, fly, history
from strategies import change

from commhg_mj.base.terms import Fate, Kind
from commhg_mj.mission.batch import MissionBatch
from commhg_mj.mission.draw import others
from commhg_mj.mission.propagation import link_between, link_to_station
from commhg_mj.models.raymodel import python_ray_functions, ray_functions
from commhg_mj.policies import POLICIES, prepare
from commhg_mj.radio.link_models import LINK_MODELS, RAY_MODELS
from commhg_mj.radio.world_links import WorldLinks
from commhg_mj.scenarios import LIMITATIONS, PROFILES, SCENARIOS

SHORT = change(SCENARIOS["small"], time_limit=120)
RAYS = [name for name, model in LINK_MODELS.items() if model in RAY_MODELS]
ELSEWISE = ("abstract", "abstract-fit", "raycast")  # one world without obstacles under each
COMMUNICATING = [name for name, info in POLICIES.items() if not info.is_privileged]


def end(scenario, seeds, links, policy="random", limitation="nominal"):
    """A batch after its mission."""
    return fly(*prepare(policy, scenario, seeds, links=links, limitation=limitation))


def bare(scenario):
    return change(scenario, forest_share=0.0, mountain_share=0.0)


@pytest.mark.parametrize("limitation", LIMITATIONS)
@pytest.mark.parametrize("policy", COMMUNICATING)
@pytest.mark.parametrize("name", SCENARIOS)
def test_without_obstacles_every_model_is_the_same_bit_by_bit(name, policy, limitation):
    scenario = change(bare(SCENARIOS[name]), time_limit=300)
    batches = [end(scenario, [3, 8, 13], links, policy, limitation) for links in ELSEWISE]
    states = [history(batch) for batch in batches]
    assert differences(states[0], states[1]) == [] and differences(states[0], states[2]) == []
    counters = states[0].counters["fate"].sum(axis=(0, 1))
    assert counters[Fate.TERRAIN] == 0 and counters[Fate.LOST] > 0 and counters[Fate.DELIVERED] > 0


@pytest.mark.parametrize("name", SCENARIOS)
def test_with_obstacles_the_models_differ(name):
    scenario = change(SCENARIOS[name], time_limit=300)
    ends = {links: fingerprint(history(end(scenario, [3, 8], links, "greedy"))) for links in ELSEWISE[::2]}
    assert len(set(ends.values())) == 2


def test_what_differs_is_the_fate_of_messages():
    """The worlds, the tasks and the draws are those of the other model: common random numbers."""
    one, other = (MissionBatch(SHORT, [1, 2], links=links) for links in ("abstract", "raycast"))
    assert differences(history(one), history(other)) == []


@pytest.mark.parametrize("links", RAYS)
@pytest.mark.parametrize("policy", COMMUNICATING)
def test_missions_do_not_depend_on_their_batch(links, policy):
    def ends(seeds):
        state = history(end(SHORT, seeds, links, policy))
        return {seed: fingerprint(state, slice(e, e + 1)) for e, seed in enumerate(seeds)}

    together = ends([1, 2, 5])
    assert len(set(together.values())) == 3
    assert ends([5, 1, 2]) == together and ends([2]) == {2: together[2]} and ends([1, 1, 5])[1] == together[1]


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda batch: pickle.loads(pickle.dumps(batch))], ids=["copy", "pickle"])
def test_copies_fly_on_to_the_same_end(duplicate):
    batch, pilot = prepare("random", SHORT, [1, 2], links="raycast")
    fly(batch, pilot, seconds=40)
    other = duplicate(batch)
    assert other.state.missions["calls_at"][0] != batch.state.missions["calls_at"][0]
    assert other.worlds[0].rays.model is not batch.worlds[0].rays.model
    before = fingerprint(other.state)
    fly(batch, pilot)
    assert fingerprint(other.state) == before != fingerprint(batch.state), "the original leaves its copy alone"
    fly(other, pilot)
    assert differences(history(batch), history(other)) == []


def test_missions_fly_the_same_where_libmujoco_cannot_be_loaded(monkeypatch):
    scenario = change(SHORT, time_limit=60, refill=16.0, broadcast_refill=160.0)
    batch, pilot = prepare("random", scenario, [7, 8], links="raycast")
    ray_functions.cache_clear()

    def fail(*args, **kwargs):
        raise OSError("no such library")

    try:
        with monkeypatch.context() as broken, warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            broken.setattr(ctypes, "CDLL", fail)
            other = pickle.loads(pickle.dumps(batch))  # with ray models of its own
            addresses = {tuple(world.rays.arrays.calls[["ray_geom", "ray_mesh"]][0]) for world in other.worlds}
        assert len(said) == 1 and "libmujoco cannot be loaded" in str(said[0].message)
        assert addresses == {python_ray_functions()}
        assert differences(history(fly(batch, pilot)), history(fly(other, pilot))) == []
    finally:
        ray_functions.cache_clear()
    assert batch.state.counters["fate"][..., Fate.TERRAIN].sum() > 0, "rays have met something"


@pytest.mark.parametrize("missing", ["forest_share", "mountain_share", "n_forests", "n_mountains"])
def test_worlds_with_one_kind_of_obstacle(missing):
    crowded = change(SCENARIOS["medium"], time_limit=600, forest_share=0.2, mountain_share=0.2)
    batch = end(change(crowded, **{missing: 0 if missing.startswith("n_") else 0.0}), [1, 2], "raycast")
    canopies, mountains = batch.state.missions["n_canopies"], batch.state.missions["n_mountains"]
    none, some = (canopies, mountains) if "forest" in missing else (mountains, canopies)
    assert np.all(none == 0) and np.all(some > 0) and batch.over.all()
    assert batch.state.counters["fate"][..., Fate.TERRAIN].sum() > 0, "the other kind stands in the way"


@pytest.mark.parametrize("profile", PROFILES)
def test_a_mission_asks_the_links_that_python_sees(profile):
    """Both antennas above the ground below them, the size of the message, the cap of the profile."""
    batch, pilot = prepare("random", change(SCENARIOS["medium"], time_limit=300, profile=profile), [4], links="raycast")
    fly(batch, pilot, seconds=250)
    links, robots, mission = WorldLinks(batch.worlds[0]), batch.state.robots[0], batch.state.missions[0]
    antennas = links.robot_antennas(np.c_[robots["x"], robots["y"]], robots["embodiment"])
    for kind in (Kind.BROADCAST, Kind.QUERY):
        size = batch.rules["message_bytes"][0, kind]
        mast = links.to_station(antennas, size)["passing"]
        assert [link_to_station(mission, r, kind) for r in range(len(robots))] == mast.tolist()
        for a in range(len(robots)):
            row = links.between(antennas[a][None], antennas, size)["passing"]
            assert [link_between(mission, a, b, kind) for b in range(len(robots))] == row.tolist()


@pytest.mark.parametrize("n", [2, 3, 8, 64])
def test_shuffled_radios_are_a_permutation_without_fixed_points(n):
    drawn = [others(n, seed) for seed in range(20)]
    for radios in drawn:
        assert sorted(radios) == list(range(n)) and not np.any(radios == np.arange(n))
    np.testing.assert_array_equal(drawn[3], others(n, 3))
    assert len({tuple(radios) for radios in drawn}) > min(1, n - 2)


def test_one_robot_keeps_its_radio():
    assert others(1, 0).tolist() == [0]
    batch = end(change(SHORT, n_uav=1, n_ugv=0), [1], "raycast-shuffled")
    assert batch.over.all() and batch.state.robots["radio_of"].tolist() == [[0]]


def test_shuffled_robots_have_each_others_links():
    batches = [MissionBatch("medium", [1], links=links) for links in RAYS]
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 1000, (2, 8))
    for batch in batches:
        batch.state.robots["x"], batch.state.robots["y"] = x, y
    own, shuffled = (batch.state.missions[0] for batch in batches)
    radio_of = batches[1].state.robots["radio_of"][0]
    assert np.all(batches[0].state.robots["radio_of"][0] == np.arange(8))
    np.testing.assert_array_equal(radio_of, others(8, 1))
    table = np.array([[link_between(own, a, b, Kind.BROADCAST) for b in range(8)] for a in range(8)])
    found = np.array([[link_between(shuffled, a, b, Kind.BROADCAST) for b in range(8)] for a in range(8)])
    np.testing.assert_array_equal(found, table[np.ix_(radio_of, radio_of)])
    assert np.any(found != table)
    stations = [[link_to_station(m, r, Kind.QUERY) for r in range(8)] for m in (own, shuffled)]
    np.testing.assert_array_equal(stations[1], np.array(stations[0])[radio_of])
