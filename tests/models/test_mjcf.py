"""The MJCF model of a world: names, rays, counts, files."""

import mujoco
import numpy as np
import pytest

from commhg_mj.base.terms import TaskType
from commhg_mj.models import mjcf, obstacle_model
from commhg_mj.models.world import make_world
from commhg_mj.scenarios import SCENARIOS, from_dict


@pytest.fixture(scope="module")
def world():
    return make_world(SCENARIOS["large"], 3)


@pytest.fixture(scope="module")
def bare(world):
    return mjcf.build_model(world, pictures=False)


@pytest.fixture(scope="module")
def model(world):
    return mjcf.build_model(world)


def look_down(model, xy, group):
    """Height where a ray from far above meets a geom of `group`, NaN where it meets none."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    groups, hit = np.zeros(6, np.uint8), np.zeros(1, np.int32)
    groups[group] = 1
    down = np.array([0.0, 0.0, -1.0])
    tops = [mujoco.mj_ray(model, data, np.array([*p, 1e4]), down, groups, 1, -1, hit) for p in xy]
    return np.array([1e4 - top if top >= 0 else np.nan for top in tops])


def test_mountains_are_where_the_layout_says(world, bare, model):
    rng = np.random.default_rng(0)
    xy = np.concatenate([[m["x"], m["y"]] + rng.uniform(-m["b"], m["b"], (60, 2)) for m in world.layout.mountains])
    expected = world.layout.ground_height(xy)
    for each in (bare, model):
        heights = np.nan_to_num(look_down(each, xy, obstacle_model.Group.MOUNTAIN))
        np.testing.assert_allclose(heights, expected, atol=0.02)
    assert np.mean(expected > 1) > 0.5


def test_canopies_are_the_forest_parts(world, bare):
    forests = world.layout.forests
    geoms = [bare.geom(f"canopy{i}") for i in range(len(forests))]
    assert np.sum(bare.geom_group == obstacle_model.Group.CANOPY) == len(forests)
    for geom, part in zip(geoms, forests):
        bottom, top = geom.pos[2] - geom.size[1], geom.pos[2] + geom.size[1]
        np.testing.assert_allclose([*geom.pos[:2], geom.size[0]], [part["x"], part["y"], part["a"]])
        np.testing.assert_allclose([bottom, top], [0, part["height"]])
        assert geom.rgba[3] > 0  # mj_ray skips invisible geoms


def test_trees_stand_inside_the_canopies(world):
    forest = mjcf.meshes.plan_forest(world.layout, np.random.default_rng(0))
    trees, discs = forest.trees(), world.layout.forests
    away = np.hypot(trees[:, None, 0] - discs["x"], trees[:, None, 1] - discs["y"])
    assert np.all(np.any(away <= discs["a"], axis=1))
    assert 1000 < len(trees) <= mjcf.meshes.MOST_TREES
    assert trees[:, 2].max() <= discs["height"].max()


@pytest.mark.parametrize("pictures", [True, False])
def test_names(world, bare, model, pictures):
    each = model if pictures else bare
    scenario = world.scenario
    for robot in range(scenario.n_robots):
        assert each.body(scenario.robot_names[robot]).mocapid == robot
    bodies = {each.body(i).name for i in range(each.nbody)}
    assert bodies >= {"station", "mast", "operator5", "poi111"}
    assert {each.camera(i).name for i in range(each.ncam)} == {"overview", "station", "map"}
    if pictures:
        assert each.joint("uav3/rotor2").type == mujoco.mjtJoint.mjJNT_HINGE
        assert each.nq == 4 * scenario.n_uav


def test_pois_wear_shape_and_colour_of_their_type_on_the_ground(world, model):
    shapes = {TaskType.UAV_ONLY: "MESH", TaskType.UGV_ONLY: "BOX", TaskType.GENERAL: "SPHERE"}
    for i, poi_type in enumerate(world.poi_types):
        marker = model.geom(f"poi{i}/marker")
        assert marker.type == getattr(mujoco.mjtGeom, f"mjGEOM_{shapes[TaskType(poi_type)]}")
        np.testing.assert_allclose(marker.rgba[:3], mjcf.TYPE_COLOURS[TaskType(poi_type)], atol=1e-6)
        siblings = np.flatnonzero(model.geom_bodyid == marker.bodyid)
        assert {model.geom(g).name for g in siblings} == {f"poi{i}/{part}" for part in ("disc", "beam", "marker")}
    feet = np.array([model.body(f"poi{i}").pos for i in range(len(world.pois))])
    np.testing.assert_allclose(feet[:, 2], world.layout.ground_height(world.pois), atol=0.006)


def test_mast_ends_at_its_height(world, model):
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    antenna = model.geom("mast/antenna")
    top = data.geom("mast/antenna").xpos[2] + antenna.size[1] + antenna.size[0]
    assert top == pytest.approx(world.scenario.world.mast_height)


def test_cameras_frame_the_whole_map(world, model):
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    side = world.layout.side
    corners = np.array([[x, y, 0] for x in (0, side) for y in (0, side)])
    for name in ("overview", "map"):
        right, up, back = data.camera(name).xmat.reshape(3, 3).T
        seen = corners - data.camera(name).xpos
        slope = np.tan(np.radians(model.camera(name).fovy / 2))
        frame = np.stack([seen @ right / (16 / 9), seen @ up]) / (seen @ -back * slope)
        assert np.abs(frame).max() < 1
        assert np.abs(frame).max() > 0.9


ODD = [
    {"n_operators": 0, "world": {"n_forests": 0, "n_mountains": 0}},
    {"n_uav": 64, "n_ugv": 0, "n_operators": 24},
    {"n_uav": 0, "n_ugv": 1, "n_operators": 1, "n_tasks": 1},
    {"map_side": 20000.0, "n_tasks": 1024, "world": {"poi_spacing": 0.005}},
    {"map_side": 50.0, "tasks": {"type_shares": [1.0, 0.0, 0.0]}, "world": {"canopy_height": [3.0, 5.0]}},
    {"world": {"mountain_share": 0.3, "n_mountains": 1}},  # reaches beyond the textured ground
    {"map_side": 300.0, "world": {"n_forests": 64, "n_mountains": 32, "mast_height": 200.0}},
]


@pytest.mark.parametrize("change", ODD, ids=lambda change: ",".join(change))
@pytest.mark.parametrize("pictures", [True, False])
def test_any_counts_and_sizes_build(change, pictures):
    world = make_world(from_dict({"base": "small"} | change), 1)
    model = mjcf.build_model(world, pictures)
    assert model.nmocap == world.scenario.n_robots
    assert np.all(np.isfinite(model.geom_size))


def test_same_world_same_model(world, model):
    again = mjcf.build_model(world)
    for field in ("geom_pos", "geom_quat", "geom_rgba", "mesh_vert", "tex_data"):
        np.testing.assert_array_equal(getattr(again, field), getattr(model, field))
    other = mjcf.build_model(make_world(world.scenario, 4))
    assert other.tex_data.shape != model.tex_data.shape or np.any(other.tex_data != model.tex_data)


def test_written_world_is_the_same_world(world, model, tmp_path, monkeypatch):
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    for _ in range(2):  # the second call replaces the first
        mjcf.write_world(world, "../world.xml")
    read = mujoco.MjModel.from_xml_path(str(tmp_path / "world.xml"))
    for field in ("body_pos", "cam_pos", "geom_pos"):
        np.testing.assert_allclose(getattr(read, field), getattr(model, field), rtol=0, atol=1e-9)
    exact = np.isin(model.geom_type, [mujoco.mjtGeom.mjGEOM_CAPSULE], invert=True)  # slanted ones have odd lengths
    np.testing.assert_allclose(read.geom_size[exact], model.geom_size[exact], rtol=0, atol=1e-9)
    np.testing.assert_allclose(read.geom_size, model.geom_size, rtol=0, atol=1e-4)
    np.testing.assert_allclose(read.mesh_vert, model.mesh_vert, rtol=0, atol=1e-4)
    np.testing.assert_array_equal(read.tex_data, model.tex_data)
    np.testing.assert_array_equal(read.geom_group, model.geom_group)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["elsewhere", "world.xml", "world_assets"]
    assert len(list((tmp_path / "world_assets").iterdir())) == 4


def test_a_bad_path_is_refused_by_name(world, tmp_path):
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "world.txt", tmp_path / "none" / "world.xml", tmp_path / "file" / "world.xml"):
        with pytest.raises(ValueError, match=str(path)) as refusal:
            mjcf.write_world(world, path)
        assert "\n" not in str(refusal.value)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_no_picture_needs_a_shadow_pass(model):
    assert not model.light_castshadow.any()


def test_display_scale_grows_with_the_map():
    assert mjcf.display_scale(50.0) == 1.0
    assert mjcf.display_scale(2000.0) == 20.0
