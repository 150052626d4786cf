"""Cameras by name, and the projection from the world to pixels that overlays share with the picture."""

from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np

from ..base.arguments import said
from ..models.mjcf import display_scale, station_scale

NAMES = "overview, station, map, orbit or follow:ROBOT (such as follow:uav0)"
ORBIT_PERIOD = 1200.0  # s of the mission for a full circle
NEAR = 1.0  # m: overlays are clipped this far in front of the camera


def check_camera(name: str, scenario) -> None:
    """Refuse a camera that the mission does not have.

    Raises:
      ValueError: unknown camera or robot.
    """
    if not isinstance(name, str):
        raise ValueError(f"unknown camera {said(name)}: use {NAMES}")
    kind, _, robot = name.partition(":")
    if kind == "follow" and robot in scenario.robot_names:
        return
    if kind == "follow":
        raise ValueError(f"camera {name!r}: no robot {robot!r}; there are {', '.join(scenario.robot_names)}")
    if name not in ("overview", "station", "map", "orbit"):
        raise ValueError(f"unknown camera {name!r}: use {NAMES}")


def place_camera(name: str, world, moment, heights, aspect: float) -> tuple[mujoco.MjvCamera, float]:
    """(camera, vertical field of view [degrees]) at a moment.

    Args:
      name: as in `check_camera`.
      heights: [R] m, the robots' altitudes.
      aspect: width / height of the picture; narrow ones are taken from farther away.
    """
    side, middle = world.layout.side, 0.5 * world.layout.side
    kind, _, robot = name.partition(":")
    back = max(1.0, 16 / 9 / aspect)
    if kind == "overview":
        return _free((middle, 0.45 * side, 0.0), 1.41 * back * side, 97.0, -36.0), 38.0
    if kind == "orbit":
        turn = 360.0 * moment.time / ORBIT_PERIOD
        return _free((middle, middle, 0.0), 1.62 * back * side, 97.0 + turn, -32.0), 38.0
    if kind == "map":
        # From far away, so that mountains hardly lean.
        return _free((middle, 0.49 * side, 0.0), 2.85 * max(1.0, 1.05 / aspect) * side, 90.0, -90.0), 24.0
    if kind == "station":
        scale = station_scale(world)
        return _free((*world.layout.station + [0.0, 4.0 * scale], 6.5 * scale), 39.0 * scale, 76.0, -13.0), 50.0
    i = world.scenario.robot_names.index(robot)
    return _free((*moment.xy[i], heights[i]), 11.0 * display_scale(side), np.degrees(moment.course[i]), -20.0), 45.0


def _free(look_at, distance, azimuth, elevation):
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.lookat, camera.distance, camera.azimuth, camera.elevation = look_at, distance, azimuth, elevation
    return camera


@dataclass(frozen=True)
class Projection:
    """A pinhole camera: where points of the world [m] fall in a picture of `width` x `height` pixels."""

    position: np.ndarray  # [3]
    axes: np.ndarray  # [3, 3] rows right, down, forward
    focal: float  # pixels
    width: int
    height: int

    @staticmethod
    def of_scene(scene, width: int, height: int) -> "Projection":
        """The projection of an updated MuJoCo scene."""
        eyes = scene.camera
        forward, up = np.array(eyes[0].forward, float), np.array(eyes[0].up, float)
        position = (np.array(eyes[0].pos, float) + eyes[1].pos) / 2
        focal = height * eyes[0].frustum_near / (eyes[0].frustum_top - eyes[0].frustum_bottom)
        return Projection(position, np.stack([np.cross(forward, up), -up, forward]), focal, width, height)

    def view(self, points) -> np.ndarray:
        """Points [..., 3] in camera axes: metres right, down, forward."""
        return (np.asarray(points, float) - self.position) @ self.axes.T

    def pixels(self, points) -> tuple[np.ndarray, np.ndarray]:
        """(pixels [..., 2], visible [...]): where points [..., 3] fall; visible ones lie inside the picture."""
        seen = self.view(points)
        depth = np.maximum(seen[..., 2:], NEAR)
        at = seen[..., :2] / depth * self.focal + np.array([self.width, self.height]) / 2
        inside = np.all((at >= 0) & (at < [self.width, self.height]), axis=-1)
        return at, inside & (seen[..., 2] > NEAR)

    def polyline(self, points) -> list[np.ndarray]:
        """A polyline [k, 3] as pieces [2, 2] in pixels, cut where it passes behind the camera."""
        seen = self.view(points)
        pieces = []
        for a, b in pairwise(seen):
            if max(a[2], b[2]) <= NEAR:
                continue
            if min(a[2], b[2]) < NEAR:
                cut = a + (b - a) * (NEAR - a[2]) / (b[2] - a[2])
                a, b = (cut, b) if a[2] < NEAR else (a, cut)
            ends = np.stack([a, b])
            pieces.append(ends[:, :2] / ends[:, 2:] * self.focal + np.array([self.width, self.height]) / 2)
        return pieces

    def scale_at(self, points) -> np.ndarray:
        """Pixels per metre at points [..., 3]."""
        return self.focal / np.maximum(self.view(points)[..., 2], NEAR)


def occluded(projection: Projection, ground_height, points, samples=40) -> np.ndarray:
    """Which points [n, 3] lie behind a mountain, as seen from the camera."""
    along = np.linspace(0.0, 0.99, samples)[:, None, None]
    way = projection.position + (np.asarray(points) - projection.position) * along
    return np.any(ground_height(way[..., :2]) > way[..., 2] + 1.0, axis=0)
