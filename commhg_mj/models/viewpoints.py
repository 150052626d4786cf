"""Fixed cameras of a world, framed for pictures of 16:9."""

import mujoco
import numpy as np

from .layout import Layout

OVERVIEW_PITCH, OVERVIEW_FOVY = np.radians(27), 50
MAP_FOVY = 10  # degrees: so little that the map looks flat (orthographic cameras see at most 180 m)


def add_cameras(spec: mujoco.MjSpec, layout: Layout, station_scale: float) -> None:
    """Add `overview`, `station` and `map`; the station's buildings are enlarged by `station_scale`."""
    side = layout.side
    middle = np.array([side / 2, side / 2, 0])
    corners = np.array([[x, y, 0] for x in (0, side) for y in (0, side)])
    forward = np.array([0.14, np.cos(OVERVIEW_PITCH), -np.sin(OVERVIEW_PITCH)])
    _add_camera(spec, "overview", _fit(corners, forward, OVERVIEW_FOVY), forward, OVERVIEW_FOVY)
    eye = np.array([*layout.station, 0]) + station_scale * np.array([-8, -21, 8])
    target = np.array([*layout.station, 0]) + station_scale * np.array([0.5, 8, 3])
    _add_camera(spec, "station", eye, target - eye, 45)
    far = 0.52 * side / np.tan(np.radians(MAP_FOVY / 2))
    spec.worldbody.add_camera(name="map", pos=np.round(middle + [0, 0, far], 1), fovy=MAP_FOVY)


def _fit(points, forward, fovy):
    """The nearest eye [3] that sees all `points` [n, 3]; the upper part of the frame is left to sky and HUD."""
    right, up = _camera_axes(forward)
    forward = np.cross(up, right)
    x, y, z = np.stack([right, up, forward]) @ points.T
    slope = np.tan(np.radians(fovy / 2))
    wide, above, below = 0.95 * slope * 16 / 9, 0.68 * slope, 0.93 * slope
    # Every point must lie between the planes x = ±wide depth and y = above depth, y = -below depth.
    back = max(
        (np.max(x - wide * z) - np.min(x + wide * z)) / (2 * wide),
        (np.max(y - above * z) - np.min(y + below * z)) / (above + below),
    )
    eye_x = (np.max(x - wide * z) + np.min(x + wide * z)) / 2
    eye_y = np.min(y + below * z) + below * back
    return eye_x * right + eye_y * up - back * forward


def _camera_axes(forward):
    """The right and up axes [3] of a level camera."""
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    return right, np.cross(right, forward)


def _add_camera(spec, name, eye, forward, fovy):
    camera = spec.worldbody.add_camera(name=name, pos=np.round(eye, 1), fovy=fovy)
    camera.alt.type = mujoco.mjtOrientation.mjORIENTATION_XYAXES
    camera.alt.xyaxes = np.concatenate(_camera_axes(np.asarray(forward) / np.linalg.norm(forward)))
