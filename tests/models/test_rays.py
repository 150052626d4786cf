"""MuJoCo's rays inside kernels: metres through canopies, blocking mountains, and the ways to reach libmujoco."""

import ctypes
import pickle
import warnings

import mujoco
import numpy as np
import pytest

from commhg_mj.base.terms import Footprint
from commhg_mj.models import mjcf, obstacle_model, raymodel
from commhg_mj.models.layout import PART, SURFACE_NODES, Layout
from commhg_mj.models.raymodel import RayModel, python_ray_functions, ray_functions
from commhg_mj.models.rays import NO_RAYS, RAY, is_blocked, metres_in_canopies
from commhg_mj.models.terrain import NOTHING, add_profile
from commhg_mj.models.world import make_world
from commhg_mj.scenarios import SCENARIOS

WORLDS = [("small", 0), ("medium", 1), ("large", 2)]
every_world = pytest.mark.parametrize("name, seed", WORLDS)


def floats(point):
    return tuple(map(float, point))


def length_of(a, b):
    return float(np.linalg.norm(np.subtract(b, a)))


def metres(rays, a, b):
    """Metres in canopies of the link from a to b."""
    canopies, calls, scratch = rays.arrays.canopies, rays.arrays.calls[0], np.zeros(1, RAY)[0]
    intervals = np.empty((2, max(1, len(canopies))))
    return metres_in_canopies(canopies, calls, scratch, intervals, floats(a), floats(b), length_of(a, b))


def blocked(rays, a, b):
    """Whether any mountain stands in the way from a to b."""
    calls, scratch = rays.arrays.calls[0], np.zeros(1, RAY)[0]
    return any(is_blocked(each, calls, scratch, floats(a), floats(b), length_of(a, b)) for each in rays.arrays.mountains)


def sampled_metres(forests, a, b, n=10_001):
    """Metres of the link inside the union of upright cylinders, from samples."""
    points = np.asarray(a) + np.linspace(0, 1, n)[:, None] * np.subtract(b, a)
    inside = np.zeros(n, bool)
    for part in forests:
        inside |= (np.hypot(points[:, 0] - part["x"], points[:, 1] - part["y"]) < part["a"]) & (points[:, 2] < part["height"])
    return np.mean(inside & (points[:, 2] > 0)) * length_of(a, b)


def grove(*discs):
    """A ray model with canopies (x, y, radius, height)."""
    parts = np.array([(Footprint.FOREST, 0, x, y, r, r, 0, height) for x, y, r, height in discs], PART)
    surfaces = np.zeros((0, SURFACE_NODES, SURFACE_NODES))
    return RayModel(Layout(200.0, parts, surfaces, np.zeros(2), np.zeros((0, 2)), np.zeros((1, 2)), 0.4))


def links_near(parts, n, rng, heights):
    """[n, 2, 3]: links with both ends around some obstacle, some of them beyond the map."""
    near = parts[rng.integers(len(parts), size=n)]
    xy = np.c_[near["x"], near["y"]][:, None] + rng.uniform(-2, 2, (n, 2, 2)) * near["a"][:, None, None]
    return np.concatenate([xy, rng.choice(heights, (n, 2, 1)) * rng.uniform(0.5, 1.5, (n, 2, 1))], axis=-1)


@every_world
def test_metres_in_canopies_agree_with_dense_sampling(name, seed):
    world = make_world(SCENARIOS[name], seed)
    forests, rng = world.layout.forests, np.random.default_rng(seed)
    links = links_near(forests, 100, rng, [1.0, 10.0, 15.0, 60.0])
    found = np.array([metres(world.rays, a, b) for a, b in links])
    sampled = np.array([sampled_metres(forests, a, b) for a, b in links])
    ways = np.linalg.norm(links[:, 1] - links[:, 0], axis=1)
    np.testing.assert_allclose(found, sampled, atol=8 * ways.max() / 10_000, rtol=0)
    assert np.sum(found > 1) > 50 and np.any(found == 0) and np.any(np.isclose(found, ways)), "all, some and nothing"


@pytest.mark.parametrize(
    "a, b, expected",
    [
        ((0, 50, 1), (100, 50, 1), 40.0),  # through the middle
        ((100, 50, 1), (0, 50, 1), 40.0),
        ((50, 50, 1), (100, 50, 1), 20.0),  # from the middle
        ((45, 50, 1), (55, 50, 9), np.hypot(10, 8)),  # both ends inside
        ((0, 50, 10), (100, 50, 10), 0.0),  # along the top
        ((0, 50, 9.999), (100, 50, 9.999), 40.0),
        ((0, 50, 10.001), (100, 50, 10.001), 0.0),
        ((0, 70, 1), (100, 70, 1), 0.0),  # touching the side
        ((0, 69.99, 1), (100, 69.99, 1), 2 * np.sqrt(20**2 - 19.99**2)),
        ((50, 50, 1), (50, 50, 60), 9.0),  # upright
        ((50, 50, 60), (50, 50, 1), 9.0),
        ((50, 50, 2), (50, 50, 5), 3.0),
        ((50, 50, 12), (50, 50, 60), 0.0),
        ((70, 50, 1), (70, 50, 60), 0.0),  # upright on the rim
        ((69.999, 50, 1), (69.999, 50, 60), 9.0),
        ((71, 50, 1), (71, 50, 60), 0.0),
        ((30, 50, 0), (50, 50, 10), np.hypot(20, 10)),  # from foot to top
        ((20, 50, 20), (80, 50, -10), np.hypot(20, 10)),  # in at the top, out below
        ((0, 50, 9), (100, 50, 19), 0.0),  # over it: 12 m high at the rim
        ((-500, 50, 1), (900, 50, 1), 40.0),  # from beyond the map
        ((50, 50, 1), (50 + 1e-5, 50, 1), 1e-5),  # almost co-located
        ((50, 50, 1), (50 + 1e-9, 50, 21), 9.0),  # almost upright
    ],
)  # fmt: skip
def test_metres_in_one_canopy(a, b, expected):
    """A cylinder of 20 m radius and 10 m height around (50, 50)."""
    assert metres(grove((50, 50, 20, 10)), a, b) == pytest.approx(expected, abs=1e-6)


def test_overlapping_canopies_count_once():
    a, b = (0, 50, 5), (200, 50, 5)
    assert metres(grove((50, 50, 20, 10), (50, 50, 20, 10), (55, 50, 5, 30)), a, b) == pytest.approx(40)
    assert metres(grove((80, 50, 20, 10), (50, 50, 20, 10)), a, b) == pytest.approx(70), "sorted, whatever their order"
    assert metres(grove((150, 50, 20, 10), (50, 50, 20, 10), (100, 50, 40, 4)), a, b) == pytest.approx(80)


@every_world
def test_mountains_block_what_mujocos_own_ray_meets(name, seed):
    """The first hit of mj_ray among all geoms of the pictures' mountains is nearer than the other end."""
    world = make_world(SCENARIOS[name], seed)
    model = mjcf.build_model(world, pictures=False)
    data, groups, hit = mujoco.MjData(model), np.zeros(6, np.uint8), np.zeros(1, np.int32)
    mujoco.mj_kinematics(model, data)
    groups[obstacle_model.Group.MOUNTAIN] = 1
    layout, rng, found = world.layout, np.random.default_rng(seed), []
    for a, b in links_near(layout.mountains, 300, rng, [1.0, 15.0, 60.0]):
        for end in (a, b):
            end[2] += layout.ground_height(end[:2])
        way = length_of(a, b)
        first = mujoco.mj_ray(model, data, a, (b - a) / way, groups, 1, -1, hit)
        found.append(blocked(world.rays, a, b))
        assert found[-1] == (0 <= first < way)
        assert blocked(world.rays, b, a) == found[-1]
    assert 60 < sum(found) < 240


@every_world
def test_a_ray_is_blocked_where_the_profile_rises_above_it(name, seed):
    """But for the centimetres of the mesh's rounding."""
    world = make_world(SCENARIOS[name], seed)
    layout, rng, clear_cut = world.layout, np.random.default_rng(seed + 9), 0
    for a, b in links_near(layout.mountains, 300, rng, [1.0, 15.0, 60.0]):
        for end in (a, b):
            end[2] += layout.ground_height(end[:2])
        highest = max(add_profile(each, floats(a), floats(b), NOTHING)[0] for each in world.rays.arrays.mountains)
        if abs(highest) > 0.03:
            clear_cut += 1
            assert blocked(world.rays, a, b) == (highest > 0)
    assert clear_cut > 250


@every_world
def test_the_ray_model_has_the_geoms_of_the_pictures(name, seed):
    world = make_world(SCENARIOS[name], seed)
    rays, model = world.rays.model, mjcf.build_model(world, pictures=False)
    names = [rays.geom(i).name for i in range(rays.ngeom)]
    assert len(names) == len(world.layout.parts) == len(set(names))
    for each in names:
        own, other = rays.geom(each), model.geom(each)
        for field in ("pos", "size", "quat", "type", "group"):
            np.testing.assert_array_equal(getattr(own, field), getattr(other, field))
    arrays = world.rays.arrays
    np.testing.assert_allclose(arrays.canopies["bottom"], 0)
    np.testing.assert_allclose(arrays.canopies["top"], world.layout.forests["height"])
    assert [rays.geom(int(i)).name for i in arrays.mountains["geom"]] == [f"mountain{i}" for i in range(len(arrays.mountains))]
    assert rays.nmeshvert == model.nmeshvert
    np.testing.assert_array_equal(rays.mesh_vert, model.mesh_vert)


def test_a_layout_without_obstacles_has_rays_that_meet_nothing():
    rays = grove()
    assert [len(arrays) for arrays in rays.arrays] == [len(arrays) for arrays in NO_RAYS] == [0, 0, 1]
    assert metres(rays, (0, 0, 1), (9, 9, 1)) == 0 and not blocked(rays, (0, 0, 1), (9, 9, 1))


@every_world
def test_stand_ins_through_python_see_the_same(name, seed):
    layout = make_world(SCENARIOS[name], seed).layout
    native, standing_in = RayModel(layout), RayModel(layout)
    geom, mesh = python_ray_functions()
    standing_in.arrays.calls["ray_geom"], standing_in.arrays.calls["ray_mesh"] = geom, mesh
    assert (geom, mesh) != tuple(native.arrays.calls[["ray_geom", "ray_mesh"]][0])
    rng, canopies, mountains = np.random.default_rng(seed), 0, 0
    links = [links_near(parts, 80, rng, [1.0, 10.0, 60.0]) for parts in (layout.forests, layout.mountains)]
    for a, b in np.concatenate(links):
        found = metres(native, a, b), blocked(native, a, b)
        assert found == (metres(standing_in, a, b), blocked(standing_in, a, b))
        canopies, mountains = canopies + (found[0] > 0), mountains + found[1]
    assert canopies > 30 and mountains > 10


@pytest.fixture
def no_library(monkeypatch):
    """libmujoco cannot be opened."""

    def fail(*args, **kwargs):
        raise OSError("no such library")

    monkeypatch.setattr(ctypes, "CDLL", fail)
    ray_functions.cache_clear()
    yield
    ray_functions.cache_clear()


def test_a_library_that_cannot_be_loaded_is_said_once(no_library):
    layout = make_world(SCENARIOS["small"], 0).layout
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        models = [RayModel(layout) for _ in range(3)]
    assert [str(warning.message) for warning in said] == [
        "libmujoco cannot be loaded (no such library): rays are cast through Python, slowly"
    ]
    assert all(tuple(each.arrays.calls[["ray_geom", "ray_mesh"]][0]) == python_ray_functions() for each in models)


def test_a_library_without_the_functions_is_no_library(monkeypatch):
    monkeypatch.setattr(raymodel.ctypes, "CDLL", lambda path: object())
    ray_functions.cache_clear()
    with pytest.warns(UserWarning, match="rays are cast through Python"):
        assert ray_functions() == python_ray_functions()
    ray_functions.cache_clear()


def test_copied_worlds_have_ray_models_of_their_own():
    world = make_world(SCENARIOS["small"], 0)
    own = world.rays.arrays.calls[0]["model"]
    other = pickle.loads(pickle.dumps(world))
    assert other.rays is not world.rays and other.rays.arrays.calls[0]["model"] != own
    (x, y, radius) = world.layout.forests[["x", "y", "a"]][0]
    link = (x - radius, y, 1.0), (x + radius, y, 1.0)
    assert metres(other.rays, *link) == metres(world.rays, *link) >= 2 * radius - 1e-9
