"""The physics of a mission: where bodies stand, what lies between antennas, other worlds, copies."""

import copy
import pickle

import mujoco
import numpy as np
import pytest
from playing import BRIEF, BRITTLE, Dice

from commhg_mj import WorldLinks, make_world
from commhg_mj.base.terms import Activity
from commhg_mj.models.obstacle_model import Group
from commhg_mj.models.poses import FALLEN_HEIGHT, attitude
from commhg_mj.scenarios import SCENARIOS
from commhg_mj.tasks.physics import Physics
from commhg_mj.tasks.surveillance import make

SAMPLES = 5_001


@pytest.fixture(scope="module", params=[("small", 0), ("medium", 1), ("large", 2)], ids="{0[0]}".format)
def physics(request):
    name, seed = request.param
    return Physics.from_world(make_world(SCENARIOS[name], seed), pictures=False, timestep=1.0)


def scatter(physics, rng):
    """Put every robot somewhere, by hand; ground robots low, so that something stands between them."""
    scenario, side = physics.world.scenario, physics.world.layout.side
    xy = rng.uniform(0.02 * side, 0.98 * side, (scenario.n_robots, 2))
    heights = np.where(np.arange(scenario.n_robots) < scenario.n_uav, rng.uniform(5, 60, scenario.n_robots), 0.0)
    physics.data.mocap_pos[:] = np.c_[xy, physics.world.layout.ground_height(xy) + heights]
    physics.forward()


def antennas(physics):
    """[R + 1, 3] of the robots and of the station, from the scenario's numbers."""
    scenario, station = physics.world.scenario, physics.world.layout.station
    heights = [scenario.radio.uav_antenna] * scenario.n_uav + [scenario.radio.ugv_antenna] * scenario.n_ugv
    robots = physics.data.mocap_pos + np.c_[np.zeros((len(heights), 2)), heights]
    mast = [*station, physics.world.layout.ground_height(station[None])[0] + scenario.world.mast_height]
    return np.concatenate([robots, [mast]])


def hits_mountain(physics, a, b):
    """MuJoCo's own ray, asked among the mountains."""
    groups, hit, way = np.zeros(6, np.uint8), np.zeros(1, np.int32), np.linalg.norm(b - a)
    groups[Group.MOUNTAIN] = 1
    first = mujoco.mj_ray(physics.model.ptr, physics.data.ptr, a, (b - a) / way, groups, 1, -1, hit)
    return 0 <= first < way


def sampled_canopies(physics, a, b):
    """Metres inside the model's canopies, from samples."""
    model, data = physics.model, physics.data
    points, inside = a + np.linspace(0, 1, SAMPLES)[:, None] * (b - a), np.zeros(SAMPLES, bool)
    for geom in np.flatnonzero(model.geom_group == Group.CANOPY):
        radius, half = model.geom_size[geom][:2]
        away = points - data.geom_xpos[geom]
        inside |= (np.hypot(away[:, 0], away[:, 1]) < radius) & (np.abs(away[:, 2]) < half)
    return inside.mean() * np.linalg.norm(b - a)


def test_antennas_stand_on_their_bodies(physics):
    scatter(physics, np.random.default_rng(0))
    names = [*physics.world.scenario.robot_names, "station"]
    np.testing.assert_allclose([physics.antenna(name) for name in names], antennas(physics))
    links = WorldLinks(physics.world, "raycast")
    np.testing.assert_allclose(physics.antenna("station"), links.mast)
    physics.place_robots(physics.world.layout.starts, np.zeros(physics.world.scenario.n_robots, bool), 0.0)
    kinds = (np.arange(physics.world.scenario.n_robots) >= physics.world.scenario.n_uav).astype(int)
    expected = links.robot_antennas(physics.world.layout.starts, kinds)
    np.testing.assert_allclose([physics.antenna(name) for name in names[:-1]], expected)


def test_what_lies_between_antennas_is_what_links_and_brute_force_find(physics):
    """Bodies moved by hand are asked about where they stand."""
    rng, links = np.random.default_rng(1), WorldLinks(physics.world, "raycast")
    names, clear, depths, blocks = [*physics.world.scenario.robot_names, "station"], [], [], []
    for _ in range(12):
        scatter(physics, rng)
        at = antennas(physics)
        for _ in range(10):
            i, j = rng.choice(len(names), 2, replace=False)
            link = links.between(at[i : i + 1], at[j : j + 1], 100)[0]
            depth, is_clear = physics.canopy_depth(names[i], names[j]), physics.line_of_sight(names[i], names[j])
            assert depth == pytest.approx(link["forest"], abs=1e-9)
            assert is_clear == (not link["is_blocked"] and link["forest"] == 0)
            assert depth == pytest.approx(sampled_canopies(physics, at[i], at[j]), abs=20 * np.ptp(at) / SAMPLES)
            blocks.append(hits_mountain(physics, at[i], at[j]))
            assert is_clear == (not blocks[-1] and depth == 0)
            assert physics.line_of_sight(names[j], names[i]) == is_clear
            assert physics.canopy_depth(names[j], names[i]) == pytest.approx(depth)
            assert physics.distance(names[i], names[j]) == pytest.approx(
                np.linalg.norm(physics.position(names[i]) - physics.position(names[j]))
            )
            clear.append(is_clear), depths.append(depth)
    assert any(clear) and not all(clear) and any(blocks) and np.count_nonzero(depths) > 5


def test_nothing_lies_between_antennas_in_one_place(physics):
    physics.data.mocap_pos[:] = [0.3 * physics.world.layout.side, 0.3 * physics.world.layout.side, 10.0]
    physics.forward()
    assert physics.line_of_sight("uav0", "uav1") and physics.canopy_depth("uav0", "uav1") == 0.0
    assert physics.line_of_sight("ugv0", "ugv0") and physics.distance("ugv0", "ugv1") == 0.0


def test_moving_a_body_by_hand_changes_the_answers():
    world = make_world(SCENARIOS["medium"], 1)
    physics, forest = Physics.from_world(world, pictures=False, timestep=1.0), world.layout.forests[0]
    beside = np.array([forest["x"], forest["y"], 1.0])
    physics.data.mocap_pos[4], physics.data.mocap_pos[5] = beside - [forest["a"] + 1, 0, 0], beside + [forest["a"] + 1, 0, 0]
    before = physics.canopy_depth("ugv0", "ugv1")
    physics.forward()
    assert before == 0.0 and physics.canopy_depth("ugv0", "ugv1") >= 2 * forest["a"] - 0.1
    assert not physics.line_of_sight("ugv0", "ugv1")
    np.testing.assert_array_equal(physics.robot_positions(), physics.data.mocap_pos)


@pytest.mark.parametrize("scenario", [BRIEF, BRITTLE, SCENARIOS["large"]], ids=["brief", "brittle", "large"])
def test_bodies_stand_where_the_mission_has_its_robots(scenario):
    env, dice, has_failed = make(scenario, random=3, pictures=False, period=5), Dice(scenario), False
    timestep, world = env.reset(), env.physics.world
    for _ in range(20):
        robots = env.task.team.batch.state.robots[0]
        xy = np.stack([robots["x"], robots["y"]], axis=-1)
        flies = np.arange(len(xy)) < scenario.n_uav
        failed = robots["activity"] == Activity.FAILED
        has_failed |= failed[:1].any()
        on_ground = world.layout.ground_height(xy) + np.where(flies, FALLEN_HEIGHT, 0.0)
        flying = world.layout.flight_floor(xy) + scenario.world.uav_height
        expected = np.c_[xy, np.where(flies & ~failed, flying, on_ground)]
        np.testing.assert_array_equal(env.physics.robot_positions(), expected)
        np.testing.assert_array_equal(env.physics.data.mocap_pos, expected)
        for i, name in enumerate(scenario.robot_names):
            np.testing.assert_array_equal(env.physics.position(name), expected[i])
            np.testing.assert_array_equal(env.physics.named.data.xpos[name], expected[i])
        if timestep.last():
            break
        timestep = env.step(dice.open(env.task.team.mask[0]))
    assert has_failed == (scenario is BRITTLE)


def test_bodies_that_stand_still_stay_where_they_are(physics):
    world = physics.world
    np.testing.assert_allclose(physics.position("station")[:2], world.layout.station)
    for task in (0, world.scenario.n_tasks - 1):
        np.testing.assert_allclose(physics.position(f"poi{task}")[:2], world.pois[task])
    assert np.isfinite(physics.position(f"operator{world.scenario.n_operators - 1}")).all()


def test_robots_face_the_way_that_they_have_come():
    world = make_world(SCENARIOS["small"], 2)
    physics, xy, well = Physics.from_world(world, pictures=False, timestep=1.0), world.layout.starts.copy(), np.zeros(4, bool)
    xy[0] += [0.0, 30.0]
    xy[2] -= [2.0, 2.0]
    before = physics.data.mocap_quat.copy()
    physics.place_robots(xy, well, 1.0)
    quat = physics.data.mocap_quat
    np.testing.assert_allclose(quat[0], attitude(np.pi / 2), atol=1e-12)
    np.testing.assert_allclose(quat[2], attitude(-3 * np.pi / 4), atol=1e-12)
    np.testing.assert_array_equal(quat[[1, 3]], before[[1, 3]])
    turned = quat.copy()
    physics.place_robots(xy, well, 2.0)
    np.testing.assert_array_equal(physics.data.mocap_quat, turned, "who stands looks on")
    assert physics.time() == 2.0


@pytest.mark.parametrize(
    "ask",
    [
        lambda p: p.position("uav9"),
        lambda p: p.position(""),
        lambda p: p.position(0),
        lambda p: p.position(None),
        lambda p: p.distance("uav0", "nobody"),
        lambda p: p.distance("nobody", "uav0"),
        lambda p: p.antenna("poi0"),
        lambda p: p.antenna("operator0"),
        lambda p: p.antenna(3),
        lambda p: p.line_of_sight("uav0", "uav9"),
        lambda p: p.line_of_sight("uav9", "uav0"),
        lambda p: p.canopy_depth("uav0", "mast"),
        lambda p: p.canopy_depth("", "uav0"),
    ],
)
def test_unknown_names_are_refused(physics, ask):
    with pytest.raises(ValueError, match="use uav0, uav1, .*station"):
        ask(physics)


def test_another_world_takes_the_place_of_one():
    one, two = (make_world(SCENARIOS["small"], seed) for seed in (1, 2))
    physics = Physics.from_world(one, pictures=False, timestep=3.0)
    data = physics.data
    physics.reload(one)
    assert physics.data is data, "the same world needs no other model"
    physics.reload(two)
    fresh = Physics.from_world(two, pictures=False, timestep=3.0)
    assert physics.data is not data and physics.world is two and physics.timestep() == 3.0 and physics.time() == 0.0
    np.testing.assert_array_equal(physics.data.xpos, fresh.data.xpos)
    np.testing.assert_array_equal(physics.model.geom_pos, fresh.model.geom_pos)
    at = {"ugv0": two.layout.forests[0], "ugv1": two.layout.forests[-1]}
    for each in (physics, fresh):
        for i, place in enumerate(at.values()):
            each.data.mocap_pos[2 + i] = place["x"], place["y"], 1.0
        each.forward()
    assert physics.canopy_depth("ugv0", "ugv1") == fresh.canopy_depth("ugv0", "ugv1") > 10
    physics.reload(one)
    np.testing.assert_array_equal(physics.robot_positions()[:, :2], one.layout.starts)


def test_seeds_of_equal_worlds_look_alike():
    """However many missions were flown before."""
    flown, fresh = make(BRIEF, random=3, pictures=False), make(BRIEF, random=3, pictures=False)
    flown.reset(), fresh.reset()
    for _ in range(20):
        flown.step(Dice(BRIEF).any())
    flown.reset(seed=3)
    for name in ("mocap_pos", "mocap_quat", "xpos", "xquat", "qpos"):
        np.testing.assert_array_equal(getattr(flown.physics.data, name), getattr(fresh.physics.data, name), name)


def underway():
    """An environment in which robots have turned and moved."""
    env, dice = make(BRIEF, random=3, pictures=False), Dice(BRIEF)
    env.reset()
    while env.task.team.time[0] < 30:
        env.step(dice.open(env.task.team.mask[0]))
    return env


@pytest.mark.parametrize("copy_of", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["deepcopy", "pickle"])
def test_a_copy_stands_where_the_original_does(copy_of):
    env = underway()
    physics, other = env.physics, copy_of(env).physics
    for name in ("mocap_pos", "xpos"):
        np.testing.assert_array_equal(getattr(other.data, name), getattr(physics.data, name), name)
    assert (other.time(), other.timestep(), other.has_pictures) == (physics.time(), physics.timestep(), physics.has_pictures)
    assert other.canopy_depth("ugv0", "ugv1") == physics.canopy_depth("ugv0", "ugv1")
    other.data.mocap_pos[:] += 1.0
    other.forward()
    assert not np.array_equal(other.robot_positions(), physics.robot_positions()), "nothing is shared"


@pytest.mark.parametrize("copy_of", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["deepcopy", "pickle"])
def test_a_copy_looks_where_the_original_does(copy_of):
    env = underway()
    np.testing.assert_array_equal(copy_of(env).physics.data.mocap_quat, env.physics.data.mocap_quat)


def test_dm_controls_own_copy_answers_questions():
    physics = underway().physics
    other = physics.copy()
    assert other.line_of_sight("uav0", "ugv0") == physics.line_of_sight("uav0", "ugv0")
    np.testing.assert_array_equal(other.robot_positions(), physics.robot_positions())
