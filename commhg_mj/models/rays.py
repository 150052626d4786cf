"""MuJoCo's ray casts inside kernels: whether a mountain stands in a link's way, and the metres through canopies.

Kernels call libmujoco's functions through the addresses that models/raymodel.py finds, so that nothing is linked,
compiled kernels stay valid on disk, and MuJoCo is loaded only where rays are cast.
"""

from typing import NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ..base.kernels import kernel, record
from .intervals import crossing, insert_interval, union_length
from .terrain import MOUNTAIN

CANOPY = record(  # an upright cylinder as MuJoCo's geom
    pos=("f8", (3,)), mat=("f8", (9,)), size=("f8", (3,)), kind="i8", bottom="f8", top="f8",
)  # fmt: skip
CALLS = record(ray_geom="i8", ray_mesh="i8", model="i8", data="i8")  # addresses of mju_rayGeom, mj_rayMesh and their model
RAY = record(point=("f8", (3,)), direction=("f8", (3,)))
END = 0.01  # m: what a ray meets nearer than this to its ends is the radio's own ground
CERTAIN = 1.0  # m: a ray that clears the profile by this much meets no mesh; the two agree to centimetres
NO_NORMAL = 0


class RayArrays(NamedTuple):
    """The obstacles of one world in three dimensions."""

    canopies: np.ndarray  # [n] CANOPY
    mountains: np.ndarray  # [n] terrain.MOUNTAIN
    calls: np.ndarray  # [1] CALLS


NO_RAYS = RayArrays(np.zeros(0, CANOPY), np.zeros(0, MOUNTAIN), np.zeros(1, CALLS))


def call_address(context, builder, signature, arguments) -> ir.CallInstr:
    """Call the C function of a float64 at the address that comes first, with the other arguments."""
    address, *arguments = arguments
    prototype = ir.FunctionType(ir.DoubleType(), [argument.type for argument in arguments])
    return builder.call(builder.inttoptr(address, prototype.as_pointer()), arguments)


WORD, INT = types.int64, types.int32  # a pointer travels like any word


@intrinsic
def ray_geom(typing_context, function, pos, mat, size, point, direction, kind, normal):
    """mju_rayGeom: distance from `point` along the unit vector `direction` to a geom's surface, -1: none."""
    return types.float64(WORD, WORD, WORD, WORD, WORD, WORD, INT, WORD), call_address


@intrinsic
def ray_mesh(typing_context, function, model, data, geom, point, direction, normal):
    """mj_rayMesh: the same for a mesh geom of a model."""
    return types.float64(WORD, WORD, WORD, INT, WORD, WORD, WORD), call_address


@kernel
def is_blocked(mountain, calls, ray, a, b, length):
    """Whether MuJoCo's ray from a to b meets a mountain's mesh; a and b are (x, y, z) in m, `length` apart."""
    point, direction = ray.point, ray.direction
    for k in range(3):
        direction[k] = (b[k] - a[k]) / length
        point[k] = a[k] + END * direction[k]
    hit = ray_mesh(calls.ray_mesh, calls.model, calls.data, mountain.geom, point.ctypes.data, direction.ctypes.data, NO_NORMAL)
    return 0.0 <= hit < length - 2.0 * END


@kernel
def metres_in_canopies(canopies, calls, ray, intervals, a, b, length):
    """Metres of the ray from a to b inside the union of the canopies, by MuJoCo's rays.

    Args:
      intervals: [2, n] scratch.
    """
    count = 0
    dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    low, high = min(a[2], b[2]), max(a[2], b[2])
    for i in range(canopies.shape[0]):
        canopy = canopies[i]
        if low >= canopy.top or high <= canopy.bottom:
            continue
        radius = canopy.size[0]
        enter, leave = crossing((a[0] - canopy.pos[0]) / radius, (a[1] - canopy.pos[1]) / radius, dx / radius, dy / radius)
        if enter >= leave:
            continue
        first, last = a[2] + enter * dz, a[2] + leave * dz
        if min(first, last) >= canopy.top or max(first, last) <= canopy.bottom:
            continue
        enter, leave = cut(canopy, calls, ray, a, b, length)
        if enter < leave:
            count = insert_interval(intervals, count, enter, leave)
    return union_length(intervals, count)


@kernel
def cut(canopy, calls, ray, a, b, length):
    """The metres from a at which the ray to b enters and leaves a canopy; enter >= leave: it misses.

    Cast from outside on either side: from inside MuJoCo reports where a ray leaves.
    """
    point, direction = ray.point, ray.direction
    beyond = 2.0 * canopy.size[0] + canopy.top - canopy.bottom
    before, after = -beyond, length + beyond
    for k in range(3):
        direction[k] = (b[k] - a[k]) / length
        point[k] = a[k] + before * direction[k]
    enter = before + ray_canopy(canopy, calls, ray)
    if enter < before:
        return 1.0, 0.0
    for k in range(3):
        direction[k] = -direction[k]
        point[k] = a[k] - after * direction[k]
    leave = after - ray_canopy(canopy, calls, ray)
    return max(0.0, enter), min(length, leave)


@kernel
def ray_canopy(canopy, calls, ray):
    """MuJoCo's ray from the ray's point along its direction to a canopy's surface [m], -1: none."""
    return ray_geom(
        calls.ray_geom, canopy.pos.ctypes.data, canopy.mat.ctypes.data, canopy.size.ctypes.data,
        ray.point.ctypes.data, ray.direction.ctypes.data, canopy.kind, NO_NORMAL,
    )  # fmt: skip
