"""MuJoCo's model of a world's obstacles, and how kernels reach MuJoCo's ray casts.

Kernels call libmujoco's functions through their addresses. Where the library cannot be loaded, the same functions
answer through Python: the same values, slower.
"""

import ctypes
import warnings
import weakref
from functools import lru_cache
from pathlib import Path

import mujoco
import numpy as np

from .layout import Layout
from .obstacle_model import Group, build_obstacles
from .rays import CALLS, CANOPY, RayArrays


class RayModel:
    """Owns the MuJoCo model behind `arrays`, which hold its address."""

    def __init__(self, layout: Layout):
        self.model = build_obstacles(layout)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, self.data)
        _alive[self.model._address] = self
        self.arrays = RayArrays(self._canopies(), self._mountains(layout), self._calls())

    def _canopies(self):
        geoms = np.flatnonzero(self.model.geom_group == Group.CANOPY)
        canopies = np.zeros(len(geoms), CANOPY)
        canopies["pos"], canopies["mat"] = self.data.geom_xpos[geoms], self.data.geom_xmat[geoms]
        canopies["size"], canopies["kind"] = self.model.geom_size[geoms], self.model.geom_type[geoms]
        centre, half = canopies["pos"][:, 2], canopies["size"][:, 1]
        canopies["bottom"], canopies["top"] = centre - half, centre + half
        return canopies

    def _mountains(self, layout):
        mountains = layout.terrain.copy()
        mountains["geom"] = [self.model.geom(f"mountain{i}").id for i in range(len(mountains))]
        return mountains

    def _calls(self):
        return np.array([(*ray_functions(), self.model._address, self.data._address)], CALLS)


_alive = weakref.WeakValueDictionary()  # ray models by their model's address, for the functions in Python


@lru_cache(maxsize=1)
def ray_functions() -> tuple[int, int]:
    """Addresses of mju_rayGeom and mj_rayMesh."""
    try:
        library = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco*.*"))))
        return _address(library.mju_rayGeom), _address(library.mj_rayMesh)
    except (OSError, AttributeError, StopIteration) as error:
        warnings.warn(f"libmujoco cannot be loaded ({error}): rays are cast through Python, slowly", stacklevel=2)
        return python_ray_functions()


def python_ray_functions() -> tuple[int, int]:
    """Addresses of stand-ins for mju_rayGeom and mj_rayMesh that call MuJoCo through Python."""
    return _address(_ray_geom), _address(_ray_mesh)


def _address(function) -> int:
    return ctypes.cast(function, ctypes.c_void_p).value or 0


def _vector(address, n=3):
    return np.ctypeslib.as_array(ctypes.cast(address, ctypes.POINTER(ctypes.c_double)), (n,))


@ctypes.CFUNCTYPE(ctypes.c_double, *[ctypes.c_void_p] * 5, ctypes.c_int, ctypes.c_void_p)
def _ray_geom(pos, mat, size, point, direction, kind, normal):
    return mujoco.mju_rayGeom(_vector(pos), _vector(mat, 9), _vector(size), _vector(point), _vector(direction), kind)


@ctypes.CFUNCTYPE(ctypes.c_double, *[ctypes.c_void_p] * 2, ctypes.c_int, *[ctypes.c_void_p] * 3)
def _ray_mesh(model, data, geom, point, direction, normal):
    rays = _alive[model]
    return mujoco.mj_rayMesh(rays.model, rays.data, geom, _vector(point), _vector(direction))
