"""A world that holds bodies: they come to rest on its ground, its mountains and against its trunks; by default they fall."""

import mujoco
import numpy as np
import pytest

from commhg_mj.models import mjcf
from commhg_mj.models.obstacle_model import Group
from commhg_mj.models.world import make_world
from commhg_mj.scenarios import from_dict
from commhg_mj.scenarios.heightmap import PIXELS, to_text

RADIUS = 0.5  # m
SINKS = 0.05  # m: contacts are soft, and height fields lie a little lower than they are drawn


@pytest.fixture(scope="module")
def world():
    return make_world(from_dict({"base": "small", "world": {"mountain_height": [15.0, 15.0]}}), 3)


@pytest.fixture(scope="module")
def written(world, tmp_path_factory):
    """{collide: file} as the command writes them."""
    folder = tmp_path_factory.mktemp("worlds")
    files = {collide: folder / f"{collide}.xml" for collide in (False, True)}
    for collide, file in files.items():
        mjcf.write_world(world, file, collide)
    return files


def add_ball(spec, place, height, friction=(1.0, 0.01, 0.5)):
    """A free ball at xy [2], so high above the plain; its rolling friction [m] stops it on slopes."""
    body = spec.worldbody.add_body(pos=[*place, height])
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS, 0, 0], condim=6, friction=friction)
    return body


def settle(spec, speeds=None, seconds=6.0):
    """(places [balls, 3], speeds [balls] m/s) of the free bodies in the end."""
    model = spec.compile()
    data = mujoco.MjData(model)
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    for joint, speed in zip(free, speeds if speeds is not None else []):
        data.qvel[model.jnt_dofadr[joint] : model.jnt_dofadr[joint] + 3] = speed
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
    assert not any(warning.number for warning in data.warning)
    starts = model.jnt_dofadr[free]
    return data.xpos[model.jnt_bodyid[free]], np.array([np.linalg.norm(data.qvel[i : i + 3]) for i in starts])


def flanks(world):
    """Places [n, 2] on mountains, where a ball can lie: steep ground it slides down."""
    rng, found = np.random.default_rng(0), []
    for part in world.layout.mountains:
        for xy in [part["x"], part["y"]] + rng.uniform(-0.6, 0.6, (200, 2)) * part["b"]:
            ring = xy + 2.0 * np.stack([np.cos(np.arange(8)), np.sin(np.arange(8))], axis=-1)
            around = world.layout.ground_height(ring)
            if around.min() > 3.0 and 0.5 < np.ptp(around) < 2.0:
                found.append(xy)
    return np.array(found[:8])


def test_balls_come_to_rest_on_ground_and_mountains(world, written):
    slopes, station = flanks(world), world.layout.station
    places = np.concatenate([slopes, [station - [15.0, 12.0], station + [20.0, -10.0]]])
    ground = world.layout.ground_height(places)
    assert len(slopes) == 8 and ground[:8].min() > 3.0 and ground[8:].max() == 0.0
    spec = mujoco.MjSpec.from_file(str(written[True]))
    for place, height in zip(places, ground):
        add_ball(spec, place, height + RADIUS + 2.0)
    ends, speeds = settle(spec)
    above = ends[:, 2] - world.layout.ground_height(ends[:, :2])
    assert speeds.max() < 0.002 and np.abs(ends[:, :2] - places).max() < 0.5
    np.testing.assert_allclose(above[8:], RADIUS, atol=0.01)
    assert above.min() > RADIUS - SINKS and above.max() < RADIUS / np.cos(np.radians(45)) + SINKS  # a slope touches sidewards


def test_a_trunk_stops_what_runs_into_it(world, written):
    spec = mujoco.MjSpec.from_file(str(written[True]))
    trunks = [geom for geom in spec.geoms if geom.name.startswith("trunk")]
    discs, radius = world.layout.forests, np.array([trunk.size[0] for trunk in trunks])
    feet = np.array([trunk.pos[:2] for trunk in trunks])
    assert np.all(np.any(np.hypot(*(feet[:, None] - np.stack([discs["x"], discs["y"]], -1)).T) <= discs["a"][:, None], axis=0))
    gaps = np.hypot(*(feet[:, None] - feet).T) + 1e9 * np.eye(len(feet))
    lone = np.argsort(-gaps.min(axis=0))[:4]
    for i in lone:
        add_ball(spec, feet[i] - [RADIUS + radius[i] + 1.0, 0.0], RADIUS, friction=(0.1, 0.0, 0.0))
    ends, _ = settle(spec, [[4.0, 0.0, 0.0]] * len(lone), seconds=1.0)
    assert np.all(ends[:, 0] < feet[lone, 0] - radius[lone] - RADIUS + SINKS)


def test_by_default_nothing_is_held(world, written):
    spec = mujoco.MjSpec.from_file(str(written[False]))
    assert not any(geom.contype or geom.conaffinity for geom in spec.geoms)
    spec.option.gravity = [0, 0, -9.81]
    add_ball(spec, world.layout.station - [15.0, 12.0], 2.0)
    ends, _ = settle(spec, seconds=2.0)
    assert ends[0, 2] < -10.0


def test_the_files_say_which_they_are(written):
    for collide, words in ((False, "no gravity, no contacts"), (True, "gravity is on")):
        head = written[collide].read_text()[:400]
        assert words in head[head.index("<!--") : head.index("-->")] and "--collide" in head


def test_what_holds_and_what_does_not(world):
    model = mjcf.build_spec(world, pictures=False, collide=True).compile()
    solid = {model.geom(i).name for i in np.flatnonzero(model.geom_contype)}
    mountains = {f"mountain{i}/solid" for i in range(len(world.layout.mountains))}
    trunks = {f"trunk{i}" for i in range(len(solid) - len(mountains) - 1)}
    assert solid == {"ground"} | mountains | trunks and len(trunks) > 100
    hidden = np.isin(model.geom_group, Group.SOLID)
    assert {model.geom(i).name for i in np.flatnonzero(hidden)} == mountains | trunks
    np.testing.assert_array_equal(model.geom_contype, model.geom_conaffinity)


def test_height_fields_are_the_mountains(world):
    """Their rays from above meet the ground that the world says, a little lower."""
    row, column = np.mgrid[-1 : 1 : PIXELS * 1j, -1 : 1 : PIXELS * 1j]
    plateau = np.where(row < 0, 1 - np.hypot(row, column) / 1.5, 0)  # some of its surfaces begin above the plain
    relief = make_world(from_dict({"base": "small", "n_tasks": 4, "world": {"heightmap": to_text(plateau)}}), 0)
    assert relief.layout.surfaces.min(axis=(1, 2)).max() > 10
    for each in (world, relief):
        model = mjcf.build_spec(each, pictures=False, collide=True).compile()
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        groups, hit = np.zeros(6, np.uint8), np.zeros(1, np.int32)
        groups[[Group.SOLID, Group.GROUND]] = 1
        model.geom_rgba[[model.geom(i).name.startswith("trunk") for i in range(model.ngeom)], 3] = 0  # rays pass them
        places = np.random.default_rng(0).uniform(0, each.layout.side, (400, 2))
        down = np.array([0.0, 0.0, -1.0])
        tops = [1e3 - mujoco.mj_ray(model, data, np.array([*p, 1e3]), down, groups, 1, -1, hit) for p in places]
        expected = each.layout.ground_height(places)
        assert np.ptp(expected) > 10
        np.testing.assert_allclose(tops, expected, atol=0.025)
