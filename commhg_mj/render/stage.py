"""The 3D picture: the world's MuJoCo model posed for a moment and rendered off screen."""

import weakref

import cv2
import mujoco
import numpy as np

from ..base.opengl import make_context
from ..base.opengl_thread import free_on_gl_thread, on_gl_thread
from ..base.terms import Activity
from ..models.mjcf import build_model
from ..models.poses import attitude, robot_positions
from .cameras import Projection, place_camera
from .drape import lay_drape

SUPERSAMPLING = 1.5  # rendered this much larger, then reduced: cheaper and smoother than multisampling here
SPIN = 23.0  # rad/s of the mission: any odd number looks like spinning
FORWARD_PITCH = 0.12  # rad of a UAV on its way
FALLEN_ROLL = 0.5  # rad of a failed UAV on the ground
GREY = np.array([0.32, 0.32, 0.34, 1.0], np.float32)


class Stage:
    """One world's model with an off-screen renderer of pictures of `size` = (width, height) pixels.

    `drape`: a `Drape` over the ground.
    `has_markers`: show the model's own markers on the POIs, rather than leave their place to drawn marks.
    """

    def __init__(self, world, size, drape=None):
        self.world, self.size, self.has_markers = world, size, False
        self.model = build_model(world, pictures=True)
        if drape:
            lay_drape(self.model, drape.image)
        self.data = mujoco.MjData(self.model)
        width, height = (round(SUPERSAMPLING * n) for n in size)
        self.model.vis.global_.offwidth, self.model.vis.global_.offheight = width, height
        self._scene = mujoco.MjvScene(self.model, maxgeom=self.model.ngeom + 100)
        self._renderer = on_gl_thread(_Renderer, self.model, width, height)
        self._free = weakref.finalize(self, free_on_gl_thread, self._renderer.free)
        self._options = mujoco.MjvOption()
        self._rgba = self.model.geom_rgba.copy()
        mujoco.mj_kinematics(self.model, self.data)
        self._robots = [_Body(self.model, name) for name in world.scenario.robot_names]
        self._discs, self._beams, self._markers = (
            np.array([self.model.geom(f"poi{i}/{part}").id for i in range(len(world.pois))])
            for part in ("disc", "beam", "marker")
        )
        self.pins = self.data.geom_xpos[self._markers].copy()  # [T, 3] m, where tasks' marks go

    def positions(self, moment) -> np.ndarray:
        """Where the robots are [R, 3] m."""
        return robot_positions(self.world, moment.xy, moment.activity == Activity.FAILED)

    def render(self, moment, camera: str) -> tuple[np.ndarray, Projection]:
        """(picture [height, width, 3] in blue, green, red; the projection that it was taken with)."""
        self._pose(moment)
        heights, aspect = self.positions(moment)[:, 2], self.size[0] / self.size[1]
        view, self.model.vis.global_.fovy = place_camera(camera, self.world, moment, heights, aspect)
        catch = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self.model, self.data, self._options, None, view, catch, self._scene)
        rendered = on_gl_thread(self._renderer.render, self._scene)
        # OpenGL counts rows from the bottom.
        picture = cv2.resize(rendered[::-1], self.size, interpolation=cv2.INTER_AREA)
        return cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), Projection.of_scene(self._scene, *self.size)

    def close(self) -> None:
        """At the latest when the stage is collected or the process ends."""
        self._free()

    def _pose(self, moment):
        model, data = self.model, self.data
        model.geom_rgba[:] = self._rgba
        for i, (body, at) in enumerate(zip(self._robots, self.positions(moment))):
            failed, flying = moment.activity[i] == Activity.FAILED, i < self.world.scenario.n_uav
            roll, pitch = 0.0, 0.0
            if flying:
                roll, pitch = (FALLEN_ROLL, 0.0) if failed else (-moment.bank[i], FORWARD_PITCH * moment.moving[i])
            data.mocap_pos[body.mocap], data.mocap_quat[body.mocap] = at, attitude(moment.heading[i], pitch, roll)
            if failed:
                model.geom_rgba[body.geoms] = GREY
            data.qpos[body.joints] = 0.0 if failed else SPIN * moment.time * body.spins
        self._pose_pois(moment)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)  # without it the sun has no direction

    def _pose_pois(self, moment):
        """A beam stands while its task is open."""
        rgba = self.model.geom_rgba
        if not self.has_markers:
            rgba[self._markers, 3] = 0
        rgba[self._beams[~moment.released | moment.done], 3] = 0
        rgba[self._discs[~moment.released], 3] = 0
        rgba[self._discs[moment.done]] = GREY


class _Renderer:
    """MuJoCo's renderer of a model, in an OpenGL context; to be made and used on the thread for that alone."""

    def __init__(self, model, width, height):
        self._viewport = mujoco.MjrRect(0, 0, width, height)
        self._pixels = np.empty((height, width, 3), np.uint8)
        self._gl = make_context(width, height)
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)

    def render(self, scene):
        """[height, width, 3] from below, overwritten by the next."""
        self._gl.make_current()  # another one may have been
        mujoco.mjr_render(self._viewport, scene, self._context)
        mujoco.mjr_readPixels(self._pixels, None, self._viewport, self._context)
        return self._pixels

    def free(self):
        try:
            self._gl.make_current()
        except Exception:  # noqa: BLE001  at the end of the process dm_control may have shut the display, and all in it
            return
        self._context.free()
        self._gl.free()


class _Body:
    """Where a body and all below it lie in the model's arrays."""

    def __init__(self, model, name):
        body = model.body(name)
        inside = model.body_rootid == body.id
        self.mocap = body.mocapid[0]
        self.geoms = np.flatnonzero(inside[model.geom_bodyid])
        self.joints = model.jnt_qposadr[inside[model.jnt_bodyid]]
        self.spins = np.where(np.arange(len(self.joints)) % 2, 1, -1)  # neighbours turn against each other
