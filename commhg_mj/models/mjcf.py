"""From a world to its MuJoCo model: geometry for rays, and everything the eye wants to see.

Names: bodies `uav0`, …, `ugv0`, … (mocap; the order of mocap ids is `Scenario.robot_names`), `station`, `mast`,
`operator0`, …, `poi0`, …; parts of an attached asset are `<body>/<part>`, as in `uav0/rotor0`. A rotor is a child
body with a hinge of the same name: set its qpos (rad) to spin it. A POI's geoms `poi0/disc`, `poi0/beam` and
`poi0/marker` carry their colour in `geom_rgba`. Fixed cameras: `overview`, `station`, `map` (from far above).
"""

import zlib
from pathlib import Path

import cv2
import mujoco
import numpy as np

from ..base.arguments import instance, path_of
from ..base.files import whole_file
from ..base.terms import TaskType
from . import meshes, textures
from .obstacle_model import Group, add_canopies, add_geom, add_mesh, add_mountains
from .poses import robot_positions
from .solids import make_solid
from .viewpoints import add_cameras
from .world import World

XML = Path(__file__).parent.parent / "xml"
STREAM = 2  # separates the pictures' random stream from the world's
SHAPES = {TaskType.UAV_ONLY: "diamond", TaskType.UGV_ONLY: "cube", TaskType.GENERAL: "ball"}
TYPE_COLOURS = {  # distinguishable with every kind of colour vision; robots wear the colours of their tasks
    TaskType.UAV_ONLY: (0.16, 0.62, 1.00),
    TaskType.UGV_ONLY: (1.00, 0.58, 0.05),
    TaskType.GENERAL: (0.95, 0.42, 0.80),
}
BEAM_ALPHA = 0.35
FALLS_THROUGH = """A world to look at and to cast rays through: no gravity, no contacts.
A body that is added falls through; `commhg-mj world --collide` writes a world that holds it."""
HOLDS = """A world for bodies of your own: gravity is on; ground, mountains and trunks (geom group 3) hold what is added.
Crowns, the team's robots, the station and the markers do not; `commhg-mj world` without --collide has no contacts."""
PAD_TOP = 0.05  # m at scale 1: the floor of station.xml


def display_scale(side: float) -> float:
    """Span [m] at which robots are drawn: on a 2 km map a real one would be smaller than a pixel."""
    return round(max(1.0, side / 100), 1)


def station_scale(world: World) -> float:
    """Enlargement of the station's buildings on a wide map; its mast keeps its height and towers above them."""
    side, most = world.layout.side, max(1.0, world.scenario.world.mast_height / 7)
    return round(float(np.clip(side / 1000, min(1.0, side / 300), most)), 1)


def build_model(world: World, pictures: bool = True) -> mujoco.MjModel:
    """The compiled `build_spec`."""
    return build_spec(world, pictures).compile()


def build_spec(world: World, pictures: bool = True, collide: bool = False) -> mujoco.MjSpec:
    """The world as an editable MJCF specification.

    Args:
      world: what to build; the same world gives the same specification.
      pictures: False leaves out what only the eye needs and keeps bodies, cameras and the geometry for rays.
      collide: gravity, and ground, mountains and trunks that hold bodies; without, whatever is added falls through.
    """
    instance("world", world, World)
    spec = mujoco.MjSpec.from_file(str(XML / "scene.xml")) if pictures else mujoco.MjSpec()
    spec.modelname = "commhg_mj"
    spec.copy_during_attach = True  # one asset serves many robots
    spec.option.gravity = [0, 0, 0]
    side = world.layout.side
    spec.stat.extent, spec.stat.center, spec.stat.meansize = side / 2, [side / 2, side / 2, 0], side / 500
    _add_ground(spec, world, pictures)
    add_canopies(spec, world.layout)
    _add_robots(spec, world, pictures)
    _add_station(spec, world, pictures)
    _add_pois(spec, world, pictures)
    add_cameras(spec, world.layout, station_scale(world))
    if pictures or collide:
        _add_trees(spec, world, pictures, collide)
    _name_geoms(spec)
    return spec


def _add_ground(spec, world, pictures):
    """The plain and the mountains upon it; both take their colour from the terrain texture."""
    layout = world.layout
    material: dict = {"material": "terrain"} if pictures else {}
    centre, half = [layout.side / 2, layout.side / 2, 0], meshes.TERRAIN_REACH * layout.side / 2
    size = [half, half, half / 8]
    add_geom(spec.worldbody, "plane", Group.GROUND, name="ground", pos=centre, size=size, **material)
    add_mountains(spec, layout, material)


def _name_geoms(spec):
    """Give parts of assets that have no name one, as `uav0/2`."""
    for body in spec.bodies:
        for i, geom in enumerate(body.geoms):
            geom.name = geom.name or f"{body.name}/{i}"


def _load(name, pictures):
    """An asset of the xml folder; None where nobody looks."""
    return mujoco.MjSpec.from_file(str(XML / f"{name}.xml")) if pictures else None


def _add_body(spec, name, pos, asset, scale):
    """The body `base` of an asset under its new name, enlarged by `scale`; an empty body without an asset."""
    if asset is None:
        return spec.worldbody.add_body(name=name, pos=pos)
    spec.attach(asset, prefix=f"{name}/", frame=spec.worldbody.add_frame(pos=pos, scale=scale))
    body = spec.body(f"{name}/base")
    body.name = name
    return body


def _add_robots(spec, world, pictures):
    """Mocap bodies at the starting places, UAVs at flight height."""
    scenario, scale = world.scenario, display_scale(world.layout.side)
    assets = {kind: _load(kind, pictures) for kind in ("uav", "ugv")}
    places = np.round(robot_positions(world, world.layout.starts, np.zeros(scenario.n_robots, bool)), 2)
    for name, place in zip(scenario.robot_names, places):
        _add_body(spec, name, place, assets[name[:3]], scale).mocap = True


def _add_station(spec, world, pictures):
    """The station with its mast, and one figure per operator, drawn as large as their spacing allows."""
    layout, scale = world.layout, station_scale(world)
    _add_body(spec, "station", [*layout.station, 0], _load("station", pictures), scale)
    mast_scale = world.scenario.world.mast_height / 15
    _add_body(spec, "mast", [*layout.station, 0], _load("mast", pictures), mast_scale)
    floor, figure = round(PAD_TOP * scale, 2), _load("operator", pictures)
    if len(layout.operators) > 1:
        scale = round(min(scale, np.linalg.norm(layout.operators[1] - layout.operators[0]) / 2.0), 1)
    for i, place in enumerate(layout.operators):
        _add_body(spec, f"operator{i}", [*place, floor], figure, scale)


def _add_pois(spec, world, pictures):
    """A disc, a beam and a marker of the type's shape and colour at every POI, on the ground or the mountain."""
    size = max(0.5, world.layout.side / 320)
    if pictures:
        add_mesh(spec, "diamond", meshes.diamond_mesh(1.25 * size))
    heights = np.round(world.layout.ground_height(world.pois), 2)
    for i, (poi, height, poi_type) in enumerate(zip(world.pois, heights, world.poi_types)):
        body = spec.worldbody.add_body(name=f"poi{i}", pos=[*poi, height])
        if pictures:
            _add_poi_geoms(body, f"poi{i}", round(size, 2), TaskType(poi_type))


def _add_poi_geoms(body, name, size, poi_type):
    colour = TYPE_COLOURS[poi_type]
    top = 7 * size
    style: dict = {"rgba": [*colour, 1], "material": "poi"}
    disc, beam = [1.3 * size, 0.04 * size, 0], [0.14 * size, top / 2, 0]
    add_geom(body, "cylinder", Group.VISUAL, name=f"{name}/disc", pos=[0, 0, 0.08 * size], size=disc, **style)
    faint = {"rgba": [*colour, BEAM_ALPHA], "material": "beam"}
    add_geom(body, "cylinder", Group.VISUAL, name=f"{name}/beam", pos=[0, 0, top / 2], size=beam, **faint)
    style |= {"name": f"{name}/marker", "pos": [0, 0, top]}
    if SHAPES[poi_type] == "diamond":
        add_geom(body, "mesh", Group.VISUAL, meshname="diamond", **style)
    elif SHAPES[poi_type] == "cube":
        add_geom(body, "box", Group.VISUAL, size=[0.8 * size] * 3, **style)
    else:
        add_geom(body, "sphere", Group.VISUAL, size=[size, 0, 0], **style)


def _add_trees(spec, world, pictures, collide):
    """The trees, and what comes with them for the eye or for bodies."""
    rng = np.random.default_rng([world.seed, STREAM])
    forest = meshes.plan_forest(world.layout, rng)
    if pictures:
        _add_scenery(spec, world.layout, forest, rng)
    if collide:
        make_solid(spec, world.layout, forest)


def _add_scenery(spec, layout, forest, rng):
    """Textures, the far ground, the sky and the trees."""
    sun = spec.light("sun").dir
    _add_texture(spec, "terrain", textures.terrain_image(layout, forest.trees(), sun, rng))
    _add_texture(spec, "horizon", textures.horizon_image(rng))
    _add_texture(spec, "foliage", textures.foliage_image())
    _add_texture(spec, "sky", textures.sky_image(rng), mujoco.mjtTexture.mjTEXTURE_SKYBOX)
    spec.texture("sky").gridsize, spec.texture("sky").gridlayout = [6, 1], "RLUDFB"  # for the written file
    centre = [layout.side / 2, layout.side / 2, 0]
    add_mesh(spec, "horizon", meshes.horizon_mesh(layout.side, rng))
    add_geom(spec.worldbody, "mesh", Group.VISUAL, name="horizon", meshname="horizon", pos=centre, material="horizon")
    _add_forest(spec, forest, rng)


def _add_texture(spec, name, image, kind=mujoco.mjtTexture.mjTEXTURE_2D):
    height, width, channels = image.shape
    spec.add_texture(name=name, type=kind, height=height, width=width, nchannel=channels).data = image.tobytes()


def _add_forest(spec, forest, rng):
    """The clumps as meshes, then a tinted copy at every place, turned by quarters (exact in XML)."""
    shapes = meshes.tree_shapes(rng)
    for i, trees in enumerate(forest.clumps):
        add_mesh(spec, f"trees{i}", meshes.clump_mesh(trees, shapes, rng))
    half = 0.5**0.5
    quats = [[1, 0, 0, 0], [half, 0, 0, half], [0, 0, 0, 1], [half, 0, 0, -half]]
    for i, (index, x, y, turns, tint) in enumerate(forest.places):
        rgba = np.round([0.9 + 0.1 * tint, 0.92 - 0.06 * tint, 0.9 - 0.1 * tint, 1], 2)
        mesh, quat = f"trees{int(index)}", quats[int(turns)]
        style = {"meshname": mesh, "material": "foliage", "rgba": rgba}
        add_geom(spec.worldbody, "mesh", Group.VISUAL, name=f"trees{i}", pos=[x, y, 0], quat=quat, **style)


def write_world(world: World, path, collide: bool = False) -> None:
    """Write the world as XML with its textures in `<stem>_assets/` beside it, for any MuJoCo program.

    Pictures have the checksum of their content in their name and the XML is replaced last, in one step: an
    interrupted call leaves an earlier world intact. The file's own comment says whether it holds bodies.

    Args:
      collide: as for `build_spec`.

    Raises:
      ValueError: `path` does not end in .xml or cannot be written; the message names it.
    """
    path = path_of("path", path)
    if path.suffix != ".xml" or path.is_dir():
        raise ValueError(f"world file {path}: must be a file whose name ends in .xml")
    spec = build_spec(world, collide=collide)
    spec.comment = HOLDS if collide else FALLS_THROUGH
    assets = path.with_name(f"{path.stem}_assets")
    try:
        assets.mkdir(exist_ok=True)
        kept = [_move_to_file(texture, assets) for texture in spec.textures]
        spec.modelfiledir, spec.texturedir = str(path.parent), assets.name
        # MuJoCo 3.17 pads the layout of the sky's faces, and refuses to read the padding.
        with whole_file(path) as draft:
            draft.write_text(spec.to_xml().replace("RLUDFB......", "RLUDFB"))
        for stale in set(assets.glob("*-????????.png")) - set(kept):
            stale.unlink()
    except OSError as error:
        raise ValueError(f"world file {path}: {error.strerror}") from None


def _move_to_file(texture, folder) -> Path:
    """Turn a texture's buffer into a PNG in `folder`, named by its content."""
    image = np.frombuffer(texture.data, np.uint8).reshape(texture.height, texture.width, 3)
    path = folder / f"{texture.name}-{zlib.crc32(texture.data):08x}.png"
    with whole_file(path) as draft:
        draft.write_bytes(cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))[1].tobytes())
    texture.data, texture.file = b"", path.name
    return path
