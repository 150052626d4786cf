"""Link models of one's own: what the function gets, what becomes of its answer, and whom it is known to."""

import copy
import math
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from flying import Wanderer, copied, differences, fingerprint, flown, fly, history
from strategies import change

import commhg_mj
from commhg_mj.base.terms import Fate, Kind
from commhg_mj.mission.batch import MissionBatch
from commhg_mj.mission.propagation import link_between, link_to_station
from commhg_mj.models.world import make_world
from commhg_mj.planning.coverage import cover
from commhg_mj.planning.endpoints import parse_endpoint
from commhg_mj.policies import POLICIES, prepare
from commhg_mj.radio import LINK_MODELS, find_link_model
from commhg_mj.radio.link_models import LINK, OWN_MODELS
from commhg_mj.radio.links import passing_share
from commhg_mj.radio.world_links import WorldLinks
from commhg_mj.scenarios import SCENARIOS

SHORT = change(SCENARIOS["small"], time_limit=120)
MEDIUM = SCENARIOS["medium"]
SIZE = 160  # B
ANSWERED = ("mountain", "passing", "on_time", "late")  # what rays do not fill in, or not alone
link_model = commhg_mj.link_model


def fading(a, b, size, link):
    """Whatever there is to read."""
    if link.is_blocked and link.nu > 10.0:
        return 0.0
    low = 1.0 / (1.0 + math.exp(-0.1 * min(a[2], b[2])))
    return low * math.exp(-link.metres / 400.0 - link.forest / 50.0 - link.mountain / 90.0 - size / 1000.0)


def ends(a, b, size, link):
    return (a[0] + 10 * a[1] + 100 * a[2] + 1000 * b[0] + 10_000 * b[1] + 100_000 * b[2] + 1_000_000 * size) / 1e7


def clear(a, b, size, link):
    is_free = link.forest == 0.0 and link.mountain == 0.0 and link.is_blocked == 0.0 and link.nu == -np.inf
    return is_free and link.foliage == 0.0 and link.diffraction == 0.0 and link.snr > 50.0 and link.passing == 1.0


MODELS = {
    "fading": fading,
    "ends": ends,
    "clear": clear,
    "echo": lambda a, b, size, link: link.passing,
    "everything": lambda a, b, size, link: 1.0,
    "nothing": lambda a, b, size, link: 0.0,
    "size": lambda a, b, size, link: size,
    "whole": lambda a, b, size, link: 1,
    "truth": lambda a, b, size, link: link.metres < 300,
    "fresh": lambda a, b, size, link: np.isnan(link.on_time) and np.isnan(link.late),
}


@pytest.fixture(scope="module", autouse=True)
def registered():
    """Compiled where they are wanted alone."""
    for name, function in MODELS.items():
        assert link_model(f"test-{name}")(function) is function


def some_links(seed, n=400):
    """(world, antennas [n, 3], antennas [n, 3]) on the ground and in the air; some beyond the map."""
    world, rng = make_world(MEDIUM, seed), np.random.default_rng(seed)
    places = [np.c_[rng.uniform(-100, 1100, (n, 2)), rng.choice([1.0, 10.0, 60.0], n)] for _ in "ab"]
    for place in places:
        place[:, 2] += world.layout.ground_height(place[:, :2])
    return world, *places


@pytest.mark.parametrize("seed", [1, 2])
def test_the_share_is_the_formulas(seed):
    world, a, b = some_links(seed)
    links = WorldLinks(world, "test-fading")
    for found, ends_of in ((links.between(a, b, SIZE), b), (links.to_station(a, SIZE), np.broadcast_to(links.mast, b.shape))):
        expected = [fading(*link) for link in zip(a, ends_of, [SIZE] * len(a), found.view(np.recarray))]
        np.testing.assert_allclose(found["passing"], expected, rtol=1e-12)
        assert 0 < np.sum(found["passing"] == 0) < np.sum(found["passing"] > 0.01)
        np.testing.assert_allclose(found["on_time"], 0.9 * found["passing"])
        np.testing.assert_allclose(found["late"], 0.05 * found["passing"])


def test_both_ends_arrive_in_their_order():
    found = WorldLinks(make_world(MEDIUM, 1), "test-ends").between(np.array([[1, 2, 3]]), np.array([[4, 5, 6]]), 7)
    assert found["passing"][0] == 0.7654321


def test_missions_ask_what_worlds_answer():
    batch = fly(MissionBatch(MEDIUM, [1], links="test-fading"), Wanderer(), seconds=200)
    before, mission, links = copied(batch.state), batch.state.missions[0], WorldLinks(batch.worlds[0], "test-fading")
    robots = batch.state.robots[0]
    antennas = links.robot_antennas(np.stack([robots["x"], robots["y"]], -1), robots["embodiment"])
    broadcast, telemetry = MEDIUM.communication.broadcast_bytes, MEDIUM.communication.telemetry_bytes
    for r in range(len(robots)):
        shares = [link_between(mission, r, other, Kind.BROADCAST) for other in range(len(robots))]
        assert shares == links.between(antennas[[r]], antennas, broadcast)["passing"].tolist()
    shares = [link_to_station(mission, r, Kind.TELEMETRY) for r in range(len(robots))]
    assert shares == links.to_station(antennas, telemetry)["passing"].tolist() and min(shares) < 1
    assert differences(before, batch.state) == []


def test_the_function_gets_what_rays_find_and_the_plan_of_mountains():
    world, a, b = some_links(1)
    own, rays, planar = (WorldLinks(world, links) for links in ("test-echo", "raycast", "abstract"))
    for ask in (lambda links: links.between(a, b, SIZE), lambda links: links.to_station(a, SIZE)):
        found, cast = ask(own), ask(rays)
        for name in set(LINK.names) - {*ANSWERED}:
            assert np.array_equal(found[name], cast[name], equal_nan=True), name
        assert np.array_equal(found["mountain"], ask(planar)["mountain"]) and found["mountain"].any()
    assert np.all(WorldLinks(world, "test-fresh").between(a, b, SIZE)["passing"] == 1)


@pytest.mark.parametrize("profile", ["matched", "edge"])
def test_an_echo_lets_pass_what_rays_do_but_for_the_range(profile):
    _, a, b = some_links(1)
    world = make_world(change(MEDIUM, profile=profile), 1)
    own, rays = (WorldLinks(world, links) for links in ("test-echo", "raycast"))
    found, cast = own.between(a, b, SIZE)["passing"], rays.between(a, b, SIZE)["passing"]
    near = np.hypot(*(b - a)[:, :2].T) <= rays.rules["range"]
    assert np.array_equal(found[near], cast[near]) and not cast[~near].any()
    assert own.rules["range"] == np.inf and (profile == "edge" or found[~near].any())
    assert np.array_equal(own.to_station(a, SIZE)["passing"], rays.to_station(a, SIZE)["passing"])


@pytest.mark.parametrize("links", ["test-echo", "test-everything", "test-whole"])
def test_without_obstacles_and_range_all_models_are_the_same(links):
    """Bit by bit, as among the built-in ones."""
    scenario = change(SHORT, forest_share=0.0, mountain_share=0.0, range=(2.0, 2.0, 2.0))
    states = [history(flown(scenario, [1, 2], Wanderer(), links=name)) for name in (links, "abstract")]
    assert differences(*states) == [] and states[0].counters["fate"][..., Fate.DELIVERED].sum() > 0


def test_where_nothing_passes_nothing_is_delivered():
    fates = flown(SHORT, [1, 2], Wanderer(), links="test-nothing").state.counters["fate"].sum(axis=0)
    assert fates[:, Fate.DELIVERED].sum() == 0 and fates[:, Fate.TERRAIN].sum() > 0
    assert fates[Kind.BROADCAST, Fate.OUT_OF_RANGE] == fates[Kind.BROADCAST].sum() > 0


def test_where_everything_passes_the_limitation_alone_loses():
    fates = flown(MEDIUM, [1], Wanderer(), links="test-everything").state.counters["fate"].sum(axis=(0, 1))
    assert fates[Fate.TERRAIN] == fates[Fate.OUT_OF_RANGE] == 0 and fates[Fate.LOST] > 0
    assert fates[Fate.DELIVERED] / (fates[Fate.DELIVERED] + fates[Fate.LOST]) == pytest.approx(0.95, abs=0.02)


@pytest.mark.parametrize("answer, share", [(-1, 0), (-np.inf, 0), (np.nan, 0), (0.25, 0.25), (1.5, 1), (np.inf, 1)])
def test_answers_are_clamped(answer, share):
    links = WorldLinks(make_world(MEDIUM, 1), "test-size")
    assert links._measure(np.zeros((1, 3)), np.ones((1, 3)), answer, True)["passing"] == share  # no message has such a size


def test_answers_may_be_whole_or_true():
    world, a, b = some_links(1)
    found = WorldLinks(world, "test-truth").between(a, b, SIZE)
    assert np.array_equal(found["passing"], (found["metres"] < 300).astype(float)) and 0 < found["passing"].sum() < len(a)


@pytest.mark.parametrize("divisor, share", [(0.0, 1), (2.0, 0.5)])
def test_a_division_by_zero_is_infinite(divisor, share):
    link_model("test-divided")(lambda a, b, size, link: 1.0 / size)
    links = WorldLinks(make_world(MEDIUM, 1), "test-divided")
    assert links._measure(np.zeros((1, 3)), np.ones((1, 3)), divisor, True)["passing"] == share


def test_an_exception_is_said_and_nothing_passes(monkeypatch):
    @link_model("test-raising")
    def raising(a, b, size, link):
        if size > 100:
            raise ValueError("too large for me")
        return 1.0

    said = []
    monkeypatch.setattr(sys, "unraisablehook", said.append)
    links = WorldLinks(make_world(MEDIUM, 1), "test-raising")
    assert links.to_station(np.ones((3, 3)), 200)["passing"].tolist() == [0, 0, 0]
    assert [str(each.exc_value) for each in said] == ["too large for me"] * 3
    assert links.to_station(np.ones((1, 3)), 10)["passing"] == 1 and len(said) == 3


def test_radios_in_one_place_have_a_clear_way_not_another_links():
    world, a, b = some_links(1)
    links = WorldLinks(world, "test-clear")
    found = links.between(a, b, SIZE)
    (i,) = np.flatnonzero((found["is_blocked"] == 1) & (found["forest"] > 0))[:1]
    assert found["passing"][i] == 0 and links.between(a[:1], a[:1], SIZE)["passing"] == 1
    for start, end, share in ((a[i], b[i], 0), (a[i], a[i], 1), (b[i], a[i], 0)):  # one scratch, as in missions
        assert passing_share(links.rules, links.obstacles, tuple(start), tuple(end), float(SIZE)) == share


@pytest.mark.parametrize("policy", POLICIES)
def test_every_policy_flies(policy):
    batch, pilot = prepare(policy, SHORT, [1, 2], links="test-fading")
    assert all(0 <= score.twcr <= 1 for score in fly(batch, pilot).scores())


def test_missions_do_not_depend_on_their_batch():
    def states(seeds):
        state = fly(*prepare("greedy", SHORT, seeds, links="test-fading")).state
        return {seed: fingerprint(state, slice(e, e + 1)) for e, seed in enumerate(seeds)}

    together = states([1, 2, 5])
    assert together == states([5, 1, 2]) and states([2]) == {2: together[2]} and len(set(together.values())) == 3


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))], ids=["copy", "pickle"])
def test_copies_fly_on_to_the_same_end(duplicate):
    batch = fly(MissionBatch(SHORT, [1, 2], links="test-fading"), Wanderer(1), seconds=40)
    other = duplicate(batch)
    assert np.all(other.state.missions["rules"]["radio"]["share_at"] == OWN_MODELS["test-fading"])
    assert differences(history(fly(batch, Wanderer(2))), history(fly(other, Wanderer(2)))) == []


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))], ids=["copy", "pickle"])
@pytest.mark.parametrize("links", ["test-fading", "raycast"])
def test_copies_of_links_have_addresses_of_their_own(links, duplicate):
    world, a, b = some_links(1)
    one = WorldLinks(world, links, "low")
    other = duplicate(one)
    assert other.world.rays.model is not world.rays.model and other.obstacles.calls is other.world.rays.arrays.calls
    assert one.between(a, b, SIZE).tobytes() == other.between(a, b, SIZE).tobytes()


SCRIPT = """
import pickle, sys
from pathlib import Path

batch = Path(sys.argv[1]).read_bytes()
for stored in (batch, Path(sys.argv[2]).read_bytes()):
    try:
        pickle.loads(stored)
    except ValueError as error:
        print(error)
import test_custom as here

here.link_model("test-fading")(here.fading)
print(here.fingerprint(here.history(here.fly(pickle.loads(batch), here.Wanderer(2)))))
"""


def test_another_process_refuses_what_it_does_not_know_and_looks_up_what_it_does(tmp_path):
    batch = fly(MissionBatch(SHORT, [1, 2], links="test-fading"), Wanderer(1), seconds=40)
    (tmp_path / "batch").write_bytes(pickle.dumps(batch))
    (tmp_path / "links").write_bytes(pickle.dumps(WorldLinks(batch.worlds[0], "test-fading")))
    here = Path(__file__).parent
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (here, here.parent, here.parent.parent)))}
    command = [sys.executable, "-c", SCRIPT, tmp_path / "batch", tmp_path / "links"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    *refusals, state = done.stdout.splitlines()
    assert len(refusals) == 2 and all("unknown link model 'test-fading': use abstract" in refusal for refusal in refusals)
    assert state == fingerprint(history(fly(batch, Wanderer(2))))


def test_traces_and_coverage_carry_the_name(tmp_path, monkeypatch):
    batch = fly(*prepare("greedy", SHORT, [1], links="test-fading", record=True))
    (trace,), path = commhg_mj.make_traces(batch, "greedy"), tmp_path / "own.npz"
    commhg_mj.save_trace(trace, path)
    assert commhg_mj.load_trace(path).links == "test-fading" and np.any(trace.link_quality % 95)
    covered = cover(batch.worlds[0], parse_endpoint("station", SHORT, "from"), 1.5, models=("test-fading",)).delivered
    assert 0 <= covered["test-fading"].min() < covered["test-fading"].max() < 0.95
    monkeypatch.delitem(OWN_MODELS, "test-fading")
    with pytest.raises(ValueError, match=r"own\.npz: unknown link model 'test-fading': use .* or register it"):
        commhg_mj.load_trace(path)


def test_a_name_registered_again_is_for_batches_made_or_reset_afterwards():
    def delivered(batch):
        return fly(batch, Wanderer(), seconds=30).state.counters["fate"][..., Fate.DELIVERED].sum()

    link_model("test-again")(lambda a, b, size, link: 1.0)
    old = MissionBatch(SHORT, [1], links="test-again")
    link_model("test-again")(lambda a, b, size, link: 0.0)
    assert delivered(MissionBatch(SHORT, [1], links="test-again")) == 0 < delivered(old)
    old.reset()
    assert delivered(old) == 0


def test_own_models_are_found_listed_and_not_among_the_built_in_ones():
    assert find_link_model("test-fading").name == "CUSTOM" and not {*OWN_MODELS} & {*LINK_MODELS}
    assert "custom" not in LINK_MODELS and len(LINK_MODELS) == 7
    with pytest.raises(ValueError, match="unknown link model 'smoke': use abstract, .*perfect, .*test-fading.*, or register it"):
        find_link_model("smoke")


def test_the_function_is_given_back_and_may_be_compiled_already():
    compiled = numba.njit(lambda a, b, size, link: 0.5)
    assert fading.__name__ == "fading" and link_model("test-compiled")(compiled) is compiled
    assert WorldLinks(make_world(MEDIUM, 1), "test-compiled").between(np.zeros((1, 3)), np.ones((1, 3)), SIZE)["passing"] == 0.5


@pytest.mark.parametrize("name", ["", "two slopes", "-x", "a/b", "x" * 65, "ü", None, 3, fading])
def test_names_that_are_none_are_refused(name):
    with pytest.raises(ValueError, match="^a link model's name must be up to 64 letters, .* and begin with one, is "):
        link_model(name)


@pytest.mark.parametrize("name", [*LINK_MODELS, "nominal", "matched"])
def test_names_that_are_taken_are_refused(name):
    with pytest.raises(ValueError, match=f"link model '{name}': the name is taken, choose one other than abstract"):
        link_model(name)


def helper(metres):
    return math.exp(-metres)


def forgets(a, b, size, link):
    if size > 3:
        return 1.0


def imports(a, b, size, link):
    import scipy

    return scipy.special.erf(link.snr)


BAD = {
    "a helper that is not compiled": (lambda a, b, size, link: helper(link.metres), "not compile: Untyped global name 'helper'"),
    "no such field": (lambda a, b, size, link: link.metre, "not compile: .*metre"),
    "no such name": (lambda a, b, size, link: smoke, "not compile: NameError: name 'smoke' is not defined"),  # noqa: F821
    "wrong types": (lambda a, b, size, link: math.exp(a), r"not compile: No implementation of .* >>> exp\(UniTuple"),
    "an import": (imports, "not compile: .*IMPORT_NAME"),
    "too few arguments": (lambda a, b, size: 1.0, "not compile: .*function takes 3 arguments"),
    "no function": (3, "not compile: .*is not a function"),
    "a built-in function": (math.exp, "not compile: .*is not a function"),
    "None": (lambda a, b, size, link: None, "must return a number wherever it ends, returns none"),
    "no return on one way": (forgets, r"must return a number wherever it ends, returns OptionalType\(float64\)"),
    "a tuple": (lambda a, b, size, link: a, "must return a number wherever it ends, returns UniTuple"),
    "a record": (lambda a, b, size, link: link, "must return a number wherever it ends, returns Record"),
    "text": (lambda a, b, size, link: "all", "must return a number wherever it ends, returns unicode_type"),
}


@pytest.mark.parametrize("case", BAD)
def test_functions_that_do_not_compile_to_a_number_are_refused_by_name(case):
    function, message = BAD[case]
    with pytest.raises(ValueError, match=message) as refusal:
        link_model("test-bad")(function)
    assert str(refusal.value).startswith("link model 'test-bad' ") and "\n" not in str(refusal.value)
    assert "test-bad" not in OWN_MODELS, "nothing is left behind"
