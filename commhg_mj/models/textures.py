"""Procedural textures: the terrain with its light baked in, foliage, the far ground and the sky.

Images are [height, width, 3] uint8 RGB. Maps of the terrain have their first row in the south, so that rows
follow y; `terrain_image` turns the finished picture over. Light never changes, so it costs nothing at render time.
"""

import math

import cv2
import numpy as np

from .layout import SURFACE_NODES, Layout, surface_half_width
from .meshes import CONIFER, TERRAIN_REACH, terrain_uv

TERRAIN_SIZE = 2048  # texels
SKY_SIZE = 256  # texels of one face of the cube
MEADOW, PASTURE, DRY_GRASS = (104, 128, 66), (128, 146, 80), (158, 152, 96)
FOREST_FLOOR, SCREE, DIRT, GRAVEL = (62, 78, 44), (132, 124, 106), (166, 142, 104), (150, 144, 130)
ROCK, DARK_ROCK, SNOW = (128, 118, 108), (92, 84, 80), (238, 242, 248)
OUTSIDE = (118, 137, 76)  # the plain far from the map
HAZE = (205, 220, 234)  # where ground and sky meet
AMBIENT = 0.45  # light in full shadow, of the light on open flat ground


def smooth(low, high, x) -> np.ndarray:
    """0 below `low`, 1 above `high`, smooth between."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def _mix(image, colour, share):
    """Blend `colour` into `image` [h, w, 3] (float32, in place) by `share` [h, w]."""
    image += (np.asarray(colour, np.float32) - image) * share[..., None].astype(np.float32)


def noise(shape, cells, octaves, rng) -> np.ndarray:
    """Smooth noise [h, w] float32 around 0.5: octaves of random grids from `cells` a side, enlarged and added."""
    height, width = shape
    total, weight = np.zeros(shape, np.float32), 0.0
    for octave in range(octaves):
        grid = rng.random((cells * 2**octave + 1,) * 2, dtype=np.float32)
        total += 0.5**octave * cv2.resize(grid, (width, height), interpolation=cv2.INTER_CUBIC)
        weight += 0.5**octave
    return total / weight


def terrain_image(layout: Layout, trees, sun, rng: np.random.Generator) -> np.ndarray:
    """The ground seen from above, with the shadows of mountains and trees [n, 5] under sunbeams along `sun` [3]."""
    heights = height_map(layout, TERRAIN_SIZE // 2)
    image = cv2.resize(_draw_ground(layout, TERRAIN_SIZE // 4, rng), (TERRAIN_SIZE,) * 2)
    mountains = layout.mountains
    for group in np.unique(mountains["group"]):
        _paint_mountains(image, heights, mountains[mountains["group"] == group], layout.side, sun, rng)
    light = _light(layout, heights, trees, sun, rng)
    image = cv2.multiply(image, cv2.merge([light] * 3), scale=1 / 200)
    return np.ascontiguousarray(image[::-1])


def height_map(layout: Layout, size) -> np.ndarray:
    """Ground heights [m] on the terrain's square, [size, size] float32."""
    heights = np.zeros((size, size), np.float32)
    for part, surface in zip(layout.mountains, layout.surfaces):
        rows, columns = _window(part, layout.side, size)
        shape = (columns.stop - columns.start, rows.stop - rows.start)
        patch = cv2.resize(surface.astype(np.float32), shape, interpolation=cv2.INTER_CUBIC)
        on_map = _clip(rows, size), _clip(columns, size)
        patch = patch[tuple(slice(on.start - all.start, on.stop - all.start) for on, all in zip(on_map, (rows, columns)))]
        heights[on_map] = np.maximum(heights[on_map], patch)
    if len(np.unique(layout.mountains["group"])) < len(layout.mountains):
        # Where one surface of a relief ends, the next one is a few decimetres lower: light would show that as a line.
        heights = cv2.GaussianBlur(heights, (0, 0), 2)
    return heights


def _clip(window, size):
    """A slice of rows or columns as far as it lies on a terrain map."""
    start = min(max(window.start, 0), size)
    return slice(start, min(max(window.stop, start), size))


def _window(part, side, size):
    """Rows and columns of a mountain's surface grid in a terrain map, and beyond; the outermost cells count half more."""
    half = surface_half_width(part) * SURFACE_NODES / (SURFACE_NODES - 1)
    centre = np.array([part["x"], part["y"]])
    low = np.rint(terrain_uv(centre - half, side) * size).astype(int)
    high = np.maximum(np.rint(terrain_uv(centre + half, side) * size).astype(int), low + 1)
    return slice(low[1], high[1]), slice(low[0], high[0])


def _draw_ground(layout, size, rng):
    """Colours of the plain [size, size, 3]: grass, forest floor, scree, tracks, fading to one colour at the edge."""
    texel = TERRAIN_REACH * layout.side / size
    broad, detail = noise((size, size), 7, 5, rng), noise((size, size), 28, 4, rng)
    wobble = detail - 0.5
    image = np.empty((size, size, 3), np.float32)
    image[:] = MEADOW
    _mix(image, PASTURE, smooth(0.42, 0.62, broad))
    _mix(image, DRY_GRASS, 0.9 * smooth(0.54, 0.74, detail) * smooth(0.40, 0.60, 1 - broad))
    _mix(image, DIRT, 0.85 * _draw_tracks(layout, size, rng) * smooth(0.25, 0.5, detail))
    for parts, colour, width in ((layout.mountains, SCREE, 0.016), (layout.forests, FOREST_FLOOR, 0.008)):
        away = _distance(parts, layout.side, size) * texel / (width * layout.side)
        _mix(image, colour, 0.85 * smooth(1.2, 0.0, away + 2 * wobble))
    axis = (np.arange(size, dtype=np.float32) + 0.5) * texel - layout.side * (TERRAIN_REACH - 1) / 2
    x, y = np.meshgrid(axis, axis)
    away = np.hypot(x - layout.station[0], y - layout.station[1]) / (18 + 0.009 * layout.side)
    _mix(image, GRAVEL, 0.9 * smooth(1.3, 0.9, away + 0.6 * wobble))
    beyond = np.maximum(np.abs(x / layout.side - 0.5), np.abs(y / layout.side - 0.5)) - 0.5
    _mix(image, OUTSIDE, smooth(0.0, 0.95 * (TERRAIN_REACH - 1) / 2, beyond + 0.1 * wobble))
    return np.clip(image, 0, 255).astype(np.uint8)


def _texels(xy, side, size):
    """Map points [..., 2] as fixed-point texel coordinates for OpenCV's drawing with shift=4."""
    return np.rint((terrain_uv(xy, side) * size - 0.5) * 16).astype(np.int32)


def _distance(parts, side, size):
    """Distance [size, size] in texels from the nearest ellipse of `parts`, 0 inside."""
    free = np.full((size, size), 255, np.uint8)
    for part in parts:
        centre = _texels(np.array([part["x"], part["y"]]), side, size)
        axes = np.rint(np.array([part["a"], part["b"]]) / (TERRAIN_REACH * side) * size * 16).astype(int)
        cv2.ellipse(free, centre, axes, np.degrees(part["angle"]), 0, 360, 0, -1, shift=4)
    return cv2.distanceTransform(free, cv2.DIST_L2, 3) if len(parts) else np.full((size, size), 1e4, np.float32)


def _draw_tracks(layout, size, rng):
    """Dirt tracks [size, size] in 0..1: from the station to the north and across, around the mountains."""
    side = layout.side
    west, east = rng.uniform(0.3, 0.7, 2) * side
    ends = [(layout.station, (rng.uniform(0.2, 0.8) * side, 1.1 * side)), ((-0.1 * side, west), (1.1 * side, east))]
    mask = np.zeros((size, size), np.uint8)
    for start, end in ends:
        along = np.linspace(0, 1, 80)[:, None]
        bends = sum(np.sin(k * np.pi * along) * rng.uniform(-1, 1, 2) / k for k in range(1, 5))
        track = (1 - along) * start + along * end + 0.06 * side * bends
        for part in layout.mountains:
            away = track - [part["x"], part["y"]]
            distance = np.linalg.norm(away, axis=1, keepdims=True) + 1e-6
            track += away / distance * np.clip(1.3 * part["a"] - distance, 0, None)
        track[2:-2] = sum(track[i : len(track) - 4 + i] for i in range(5)) / 5
        cv2.polylines(mask, [_texels(track, side, size)], False, 255, 1, cv2.LINE_AA, shift=4)
    return cv2.GaussianBlur(mask, (3, 3), 0).astype(np.float32) / 150


def _paint_mountains(image, heights, parts, side, sun, rng):
    """Rock and snow with slope-dependent light over one relief, in place; its foot keeps the plain's colour.

    Roughness between the nodes of the surface is painted only: light reacts to it as if it were there.
    """
    windows = zip(*(_window(part, side, TERRAIN_SIZE // 2) for part in parts))
    rows, columns = (
        _clip(slice(min(each.start for each in some), max(each.stop for each in some)), TERRAIN_SIZE // 2) for some in windows
    )
    top = parts["height"].max()
    patch = heights[rows, columns]
    shape = (2 * patch.shape[0], 2 * patch.shape[1])
    relief = cv2.resize(patch, shape[::-1], interpolation=cv2.INTER_CUBIC) / np.float32(top)
    detail = noise(shape, 12 * math.isqrt(len(parts)), 5, rng) - 0.5
    rough = relief + 0.16 * detail * smooth(0.02, 0.25, relief)
    texel = TERRAIN_REACH * side / TERRAIN_SIZE
    slope_y, slope_x = np.gradient(cv2.GaussianBlur(rough, (0, 0), 0.8) * (top / texel))
    slope = np.hypot(slope_x, slope_y)
    facing = (slope_x * sun[0] + slope_y * sun[1] - sun[2]) / np.sqrt(1 + slope**2) / -sun[2]
    window = image[2 * rows.start : 2 * rows.stop, 2 * columns.start : 2 * columns.stop]
    colour = window.astype(np.float32)
    rock = smooth(0.06, 0.26, relief + 0.5 * detail)
    _mix(colour, ROCK, rock)
    _mix(colour, DARK_ROCK, rock * smooth(0.7, 1.5, slope + 1.5 * detail))
    _mix(colour, SNOW, smooth(0.56, 0.68, relief + 0.35 * detail) * smooth(2.2, 1.2, slope))
    colour *= (AMBIENT + (1 - AMBIENT) * np.clip(facing, 0, 1.6))[..., None]
    window[:] = np.clip(colour, 0, 255)


def _light(layout, heights, trees, sun, rng):
    """Brightness [TERRAIN_SIZE, TERRAIN_SIZE] uint8, 200 for open ground: shadows, and grain like blades of grass."""
    size = TERRAIN_SIZE
    shadow = cv2.resize(mountain_shadow(heights, TERRAIN_REACH * layout.side / len(heights), sun), (size, size))
    tree_shadow = cv2.GaussianBlur(_draw_tree_shadows(trees, layout.side, sun), (0, 0), 0.9)
    grain = np.tile(noise((512, 512), 128, 2, rng) - 0.5, (4, 4))
    from_edge = np.minimum(np.arange(size), np.arange(size)[::-1]) / (0.08 * size)
    fade = np.clip(from_edge, 0, 1).astype(np.float32)
    grain = cv2.convertScaleAbs(grain * np.minimum(fade, fade[:, None]), alpha=48, beta=200)
    lit = 255 - cv2.max(shadow, cv2.multiply(tree_shadow, 0.8))
    lit = cv2.convertScaleAbs(lit, alpha=(1 - AMBIENT), beta=255 * AMBIENT)
    return cv2.multiply(grain, lit, scale=1 / 255)


def mountain_shadow(heights, texel, sun) -> np.ndarray:
    """Depth of shadow [n, n] uint8 that a height map [n, n] with `texel` metres a step casts upon itself.

    The map is turned until sunbeams run along its rows; there a point is in shadow when any earlier point,
    lowered along the beam, is higher.
    """
    size = len(heights)
    bearing = np.degrees(np.arctan2(sun[1], sun[0]))
    turn = cv2.getRotationMatrix2D((size / 2, size / 2), bearing, 0.7)
    along = cv2.warpAffine(heights, turn, (size, size))
    drop = np.arange(size, dtype=np.float32) * np.float32(-sun[2] / np.hypot(sun[0], sun[1]) * texel / 0.7)
    beam = along + drop
    depth = np.maximum.accumulate(beam, axis=1) - beam
    shadow = np.clip(depth * (100 / texel), 0, 255).astype(np.uint8)
    return cv2.warpAffine(shadow, turn, (size, size), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)


def _draw_tree_shadows(trees, side, sun):
    """Shadow outlines of trees [n, 5] on flat ground, [TERRAIN_SIZE, TERRAIN_SIZE] uint8."""
    mask = np.zeros((TERRAIN_SIZE, TERRAIN_SIZE), np.uint8)
    beam = np.asarray(sun[:2]) / -sun[2]  # a point at height h throws its shadow h * beam away
    ahead = beam / np.linalg.norm(beam)
    length = trees[:, 2:3] * np.linalg.norm(beam)
    crown, conifer = trees[:, 3:4], trees[:, 4:] == CONIFER
    bearing = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    # A broadleaf throws the circle of its crown; a conifer the circle of its lowest branches, drawn out to its tip.
    along = crown * np.cos(bearing) + np.where(conifer, 0.2, 0.62) * length
    along = np.where(conifer & (bearing == 0), length, along)
    outline = along[..., None] * ahead + (crown * np.sin(bearing))[..., None] * [-ahead[1], ahead[0]]
    for polygon in _texels(outline + trees[:, None, :2], side, TERRAIN_SIZE):
        cv2.fillConvexPoly(mask, polygon, 255, shift=4)
    return mask


def foliage_image() -> np.ndarray:
    """Three vertical bands (bark, conifers, broadleaves) of varied hue, from shade below to light above."""
    bands = [[(74, 56, 40), (98, 76, 56)], [(44, 90, 60), (66, 108, 62)], [(68, 112, 52), (100, 134, 64)]]
    hues = np.concatenate([np.linspace(first, last, 32) for first, last in bands])
    light = np.linspace(0.5, 1.3, 32)[:, None, None]
    return np.clip(hues * light, 0, 255).astype(np.uint8)[::-1].copy()


def horizon_image(rng: np.random.Generator) -> np.ndarray:
    """The far ground: u runs around the compass; v from the outside colour (0) through blue distance to haze (1)."""
    share = np.linspace(1, 0, 256)
    stops = np.array([OUTSIDE, (138, 160, 122), (166, 190, 192), HAZE])
    gradient = np.stack([np.interp(share, [0, 0.35, 0.75, 1], channel) for channel in stops.T], axis=-1)
    half = noise((256, 512), 24, 5, rng)
    around = np.concatenate([half, half[:, ::-1]], axis=1)
    image = np.repeat(gradient[:, None].astype(np.float32), around.shape[1], axis=1)
    clear = (smooth(0.01, 0.1, share) * smooth(1, 0.4, share))[:, None]  # fields fade towards the map and into haze
    _mix(image, (164, 160, 104), 0.5 * clear * smooth(0.46, 0.34, around))
    _mix(image, (66, 96, 62), 0.7 * clear * smooth(0.54, 0.62, around))
    return np.clip(image, 0, 255).astype(np.uint8)


def sky_image(rng: np.random.Generator) -> np.ndarray:
    """Cube faces one below the other (right, left, up, down, front, back): blue above haze, and clouds."""
    axis = (np.arange(SKY_SIZE, dtype=np.float32) + 0.5) / SKY_SIZE * 2 - 1
    s, t = np.meshgrid(axis, axis)
    one = np.ones_like(s)
    faces = [(one, -t, -s), (-one, -t, s), (s, one, t), (s, -one, -t), (s, -t, one), (-s, -t, -one)]
    direction = np.concatenate([np.stack(face, axis=-1) for face in faces])
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    x, up, z = np.moveaxis(direction, -1, 0)
    return _sky_colour(x, up, z, rng)


def _sky_colour(x, up, z, rng):
    """Colours for unit directions (x, up, z)."""
    image = np.empty((*x.shape, 3), np.float32)
    image[:] = HAZE
    _mix(image, (88, 142, 208), smooth(0.0, 0.65, up))
    flat = np.maximum(up, 0.03) + 0.10
    clouds = noise((512, 512), 12, 6, rng)
    u, v = (40 * x / flat + 256).astype(np.float32), (40 * z / flat + 256).astype(np.float32)
    cover = cv2.remap(clouds, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    _mix(image, (252, 252, 254), 0.85 * smooth(0.50, 0.66, cover) * smooth(0.03, 0.22, up))
    return np.clip(image, 0, 255).astype(np.uint8)
