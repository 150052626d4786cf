"""What bodies of other people meet in a world: solid ground, mountains and trunks (docs/worlds.md).

MuJoCo's meshes collide by their convex hulls, so each mountain's surface comes once more, as a height field: the same
nodes, cut into the same triangles. Trees are drawn in clumps, so each gets a capsule where its trunk is.
"""

import mujoco
import numpy as np

from .layout import SURFACE_NODES, Layout, surface_half_width
from .meshes import TRUNK_HEIGHT, TRUNK_RADIUS, Forest
from .obstacle_model import Group, add_geom

GRAVITY = 9.81  # m/s²
FRICTION_OVER_NORMAL = 10.0  # impedance: what lies on a slope creeps by less than 1 mm/s, by MuJoCo's own by 1 cm/s
DEPTH = 10.0  # m: height fields reach so far below the plain; what has sunk in is then pushed out upwards, not through
SUNK = 0.02  # m: they lie so much lower than what is drawn, that nothing stumbles over their rims in the plain


def make_solid(spec, layout: Layout, forest: Forest) -> None:
    """Switch gravity on and let ground, mountains and trunks touch whatever is added to the world.

    Friction and solver parameters of the geoms stay MuJoCo's own: of two in contact the rougher one counts.
    """
    spec.option.gravity = [0, 0, -GRAVITY]
    spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, FRICTION_OVER_NORMAL
    ground = spec.geom("ground")
    ground.contype = ground.conaffinity = 1
    for i, (part, surface) in enumerate(zip(layout.mountains, layout.surfaces)):
        _add_height_field(spec, f"mountain{i}/solid", part, surface)
    for i, (x, y, height, crown, _) in enumerate(forest.trees()):
        radius = TRUNK_RADIUS * crown
        half = (TRUNK_HEIGHT * height - radius) / 2  # the upper cap ends where the drawn trunk does
        size, pos = np.round([radius, half, 0], 3), np.round([x, y, half], 3)
        add_geom(spec.worldbody, "capsule", Group.SOLID, True, name=f"trunk{i}", pos=pos, size=size)


def _add_height_field(spec, name, part, surface):
    half, low = surface_half_width(part), surface.min()
    rise = max(surface.max() - low, SUNK)
    size = [half, half, rise, low + DEPTH]
    spec.add_hfield(name=name, nrow=SURFACE_NODES, ncol=SURFACE_NODES, size=size, userdata=((surface - low) / rise).ravel())
    pos = [part["x"], part["y"], low - SUNK]
    add_geom(spec.worldbody, "hfield", Group.SOLID, True, name=name, hfieldname=name, pos=pos)
