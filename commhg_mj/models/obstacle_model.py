"""Mountains and canopies in MuJoCo, for rays: what a layout alone decides."""

from enum import IntEnum

import mujoco
import numpy as np

from .layout import Layout
from .meshes import Mesh, mountain_mesh

RAY_MEMORY = 1 << 16  # B to compute in: MuJoCo takes 13 MB where nobody says so


class Group(IntEnum):
    """Geom groups, for `MjvOption.geomgroup` and the `geomgroup` of mj_ray."""

    GROUND = 0
    MOUNTAIN = 1  # one surface for rays and pictures
    VISUAL = 2  # robots, station, operators, POIs, trees, far ground: never hit by radio rays
    SOLID = 3  # what bodies collide with, where the world has such geoms (models/solids.py); pictures hide it
    CANOPY = 4  # cylinders for rays only; pictures hide them. Opaque enough for mj_ray, which skips alpha 0


def build_obstacles(layout: Layout) -> mujoco.MjModel:
    """The compiled mountains and canopies alone, with the names and groups that they have in `build_model`."""
    spec = mujoco.MjSpec()
    spec.memory = RAY_MEMORY
    add_mountains(spec, layout, {})
    add_canopies(spec, layout)
    return spec.compile()


def add_mountains(spec, layout: Layout, material: dict) -> None:
    """One mesh a mountain, its surface alone."""
    for i, (part, surface) in enumerate(zip(layout.mountains, layout.surfaces)):
        name = f"mountain{i}"
        add_mesh(spec, name, mountain_mesh(part, surface, layout.side), smooth=True)
        pos = [part["x"], part["y"], 0]
        add_geom(spec.worldbody, "mesh", Group.MOUNTAIN, name=name, meshname=name, pos=pos, **material)


def add_canopies(spec, layout: Layout) -> None:
    """One cylinder a forest disc, from the ground to the canopy's top: P.833 counts woodland, trunks included."""
    for i, part in enumerate(layout.forests):
        half = part["height"] / 2
        pos, size = [part["x"], part["y"], half], [part["a"], half, 0]
        rgba = [0.2, 0.6, 0.2, 0.3]
        add_geom(spec.worldbody, "cylinder", Group.CANOPY, name=f"canopy{i}", pos=pos, size=size, rgba=rgba)


def add_mesh(spec, name, mesh: Mesh, smooth=False) -> None:
    """A mesh asset. Most meshes here are open, hence no volume; MuJoCo counts v from the picture's top."""
    asset = spec.add_mesh(
        name=name,
        uservert=mesh.vertices.ravel(),
        userface=mesh.faces.ravel(),
        usertexcoord=np.abs(mesh.uv - [0, 1]).ravel(),
        userfacetexcoord=mesh.faces.ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    asset.smoothnormal = smooth


def add_geom(body, kind: str, group: Group, collides: bool = False, **attributes) -> mujoco.MjsGeom:
    """A geom; nothing collides with it unless `collides`."""
    kind = getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}")
    return body.add_geom(type=kind, group=group, contype=collides, conaffinity=collides, **attributes)
