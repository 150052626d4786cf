import mujoco
import numpy as np
import pytest

from commhg_mj.base.terms import TaskType
from commhg_mj.models.world import make_world
from commhg_mj.render import stage as stage_module
from commhg_mj.render.cameras import NEAR, Projection, check_camera, occluded
from commhg_mj.render.moment import Timeline
from commhg_mj.render.stage import Stage
from commhg_mj.scenarios import SCENARIOS

LEVEL = Projection(np.array([0.0, 0, 10]), np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), 100.0, 200, 100)


@pytest.fixture(scope="module")
def stage(trace):
    stage = Stage(make_world(trace.scenario, trace.seed), (640, 360))
    yield stage
    stage.close()


def test_points_ahead():
    at, seen = LEVEL.pixels([[0, 50, 10], [10, 100, 10], [0, 100, 20], [0, -5, 10], [500, 1, 10]])
    np.testing.assert_allclose(at[:3], [[100, 50], [110, 50], [100, 40]])
    assert seen.tolist() == [True, True, True, False, False]


def test_lines_are_cut_behind_the_camera():
    assert LEVEL.polyline([[0, -10, 10], [0, -20, 10]]) == []
    (piece,) = LEVEL.polyline([[5, -10, 10], [5, 50, 10]])
    np.testing.assert_allclose(piece, [[100 + 500 / NEAR, 50], [110, 50]])


@pytest.mark.parametrize("camera", ["overview", "map", "orbit", "follow:uav0", "follow:ugv1"])
def test_overlays_fall_where_the_picture_shows_things(trace, stage, camera):
    """A robot turned into a bright beacon appears where the projection says."""
    moment = Timeline(trace, 9.0).at(25.0)
    dark, projection = stage.render(moment, camera)
    robot = int(camera[-1]) + 2 * (camera[7:10] == "ugv") if camera.startswith("follow") else 0
    body = stage.model.body(trace.scenario.robot_names[robot]).id
    geoms = np.flatnonzero(stage.model.body_rootid[stage.model.geom_bodyid] == body)
    plain = stage._rgba[geoms].copy()
    stage._rgba[geoms] = [1, 0, 1, 1]
    lit, _ = stage.render(moment, camera)
    stage._rgba[geoms] = plain
    at, seen = projection.pixels(stage.positions(moment)[robot])
    changed = np.abs(lit.astype(int) - dark).sum(axis=-1)
    rows, columns = np.nonzero(changed > 12)
    assert seen and columns.min() - 3 <= at[0] <= columns.max() + 3 and rows.min() - 3 <= at[1] <= rows.max() + 3


def test_mountains_hide(stage):
    layout = stage.world.layout
    part = layout.mountains[0]
    summit = np.array([part["x"], part["y"], part["height"]])
    eye = summit + [-300, 0, -part["height"] + 5]
    view = Projection(eye, np.eye(3), 100.0, 200, 100)
    behind, before, above = summit + [200, 0, -part["height"] + 5], eye + [20, 0, 0], summit + [0, 0, 500]
    assert occluded(view, layout.ground_height, np.stack([behind, before, above])).tolist() == [True, False, False]


def test_the_sun_shines_from_where_it_stands(trace, stage, monkeypatch):
    """On a cube the face towards it is brighter than the one away from it."""
    cube = stage.pins[np.flatnonzero(stage.world.poi_types == TaskType.UGV_ONLY)[0]]
    monkeypatch.setattr(stage, "has_markers", True)

    def brightness(azimuth):
        """Of the middle of the picture, from near the cube."""
        camera = mujoco.MjvCamera()
        camera.lookat, camera.distance, camera.azimuth, camera.elevation = cube, 8.0, azimuth, 0.0
        monkeypatch.setattr(stage_module, "place_camera", lambda *_: (camera, 10.0))
        return stage.render(Timeline(trace, 9.0).at(25.0), "overview")[0][175:185, 315:325].mean()

    sun = stage.data.light("sun").xdir
    np.testing.assert_allclose(np.linalg.norm(sun), 1.0)
    assert sun[0] > 0 > sun[2], "it shines eastwards and down"
    assert brightness(0.0) > 1.3 * brightness(180.0), "seen from the west, and from the east"


def test_unknown_cameras_are_named():
    scenario = SCENARIOS["small"]
    for name in ("overview", "station", "map", "orbit", "follow:uav1", "follow:ugv0"):
        check_camera(name, scenario)
    for name in ("above", "follow", "follow:uav2", "follow:", "map:uav0", ""):
        with pytest.raises(ValueError, match=name or "''"):
            check_camera(name, scenario)


def test_failed_robots_lie_on_the_ground(trace, stage):
    moment = Timeline(trace, 9.0).at(50.0)
    assert stage.positions(moment)[-1, 2] <= stage.world.layout.ground_height(moment.xy[-1]) + 1
    stage.render(moment, "overview")
    assert mujoco.mj_name2id(stage.model, mujoco.mjtObj.mjOBJ_BODY, trace.scenario.robot_names[-1]) > 0
