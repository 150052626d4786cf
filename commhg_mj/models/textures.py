"""Procedural textures: the terrain with its light baked in, foliage, the far ground and the sky.

Images are [height, width, 3] uint8 RGB. Maps of the terrain have their first row in the south, so that rows
follow y; `terrain_image` turns the finished picture over. Light never changes, so it costs nothing at render time.
"""

import cv2
import numpy as np

from .layout import Layout, surface_half_width
from .meshes import CONIFER, TERRAIN_REACH, terrain_uv

TERRAIN_SIZE = 2048  # texels
SKY_SIZE = 320  # texels of one face of the cube
MEADOW, PASTURE, DRY_GRASS = (104, 128, 66), (128, 146, 80), (158, 152, 96)
FOREST_FLOOR, SCREE, DIRT, GRAVEL = (62, 78, 44), (132, 124, 106), (166, 142, 104), (150, 144, 130)
ROCK, DARK_ROCK, SNOW = (128, 118, 108), (92, 84, 80), (238, 242, 248)
OUTSIDE = (112, 132, 72)  # the plain far from the map
HAZE = (205, 220, 234)  # where ground and sky meet
AMBIENT = 0.45  # light in full shadow, of the light on open flat ground


def smooth(low, high, x):
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
    for part in layout.mountains:
        _paint_mountain(image, heights, part, layout.side, sun, rng)
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
        heights[rows, columns] = np.maximum(heights[rows, columns], patch)
    return heights


def _window(part, side, size):
    """Rows and columns of a mountain's surface grid in a terrain map; the outermost cells count half more."""
    half = surface_half_width(part) * 33 / 32
    centre = np.array([part["x"], part["y"]])
    low = np.rint(terrain_uv(centre - half, side) * size).astype(int)
    high = np.maximum(np.rint(terrain_uv(centre + half, side) * size).astype(int), low + 1)
    return slice(low[1], high[1]), slice(low[0], high[0])


def _draw_ground(layout, size, rng):
    """Colours of the plain [size, size, 3]: grass, forest floor, scree, gravel, fading to one colour at the edge."""
    axis = (((np.arange(size, dtype=np.float32) + 0.5) / size - 0.5) * TERRAIN_REACH + 0.5) * layout.side
    x, y = np.meshgrid(axis, axis)
    broad, detail = noise((size, size), 7, 5, rng), noise((size, size), 28, 4, rng)
    image = np.empty((size, size, 3), np.float32)
    image[:] = MEADOW
    _mix(image, PASTURE, smooth(0.42, 0.62, broad))
    _mix(image, DRY_GRASS, smooth(0.55, 0.72, detail) * smooth(0.40, 0.60, 1 - broad))
    _mix(image, SCREE, 0.8 * smooth(1.22, 1.0, _nearness(x, y, layout.mountains) + 0.7 * (detail - 0.5)))
    _mix(image, FOREST_FLOOR, 0.9 * smooth(1.15, 0.9, _nearness(x, y, layout.forests) + 0.6 * (detail - 0.5)))
    away = np.hypot(x - layout.station[0], y - layout.station[1]) / (20 + 0.02 * layout.side)
    _mix(image, GRAVEL, 0.9 * smooth(1.3, 0.9, away + 0.6 * (detail - 0.5)))
    beyond = np.maximum(np.abs(x / layout.side - 0.5), np.abs(y / layout.side - 0.5)) - 0.5
    _mix(image, OUTSIDE, smooth(0.0, 0.95 * (TERRAIN_REACH - 1) / 2, beyond))
    return np.clip(image, 0, 255).astype(np.uint8)


def _nearness(x, y, parts):
    """Distance from the middle of the nearest ellipse of `parts`, in its own radii: 1 on its edge."""
    nearest = np.full(x.shape, 9.0, np.float32)
    for part in parts:
        cos, sin = np.cos(part["angle"]), np.sin(part["angle"])
        dx, dy = x - np.float32(part["x"]), y - np.float32(part["y"])
        u, v = (cos * dx + sin * dy) / part["a"], (cos * dy - sin * dx) / part["b"]
        nearest = np.minimum(nearest, np.hypot(u, v).astype(np.float32))
    return nearest


def _paint_mountain(image, heights, part, side, sun, rng):
    """Rock, screes and snow with slope-dependent light over one mountain, in place; its foot stays as it was."""
    rows, columns = _window(part, side, TERRAIN_SIZE // 2)
    patch = heights[rows, columns]
    shape = (2 * patch.shape[0], 2 * patch.shape[1])
    relief = cv2.resize(patch, shape[::-1], interpolation=cv2.INTER_CUBIC) / np.float32(part["height"])
    detail = noise(shape, 12, 5, rng) - 0.5
    rough = relief + 0.16 * detail * smooth(0.02, 0.25, relief)
    texel = TERRAIN_REACH * side / TERRAIN_SIZE
    slope_y, slope_x = np.gradient(cv2.GaussianBlur(rough, (0, 0), 0.8) * (part["height"] / texel))
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
    grain = noise((512, 512), 128, 2, rng)
    grain = cv2.resize(np.tile(np.rint(24 * grain + 188).astype(np.uint8), (2, 2)), (size, size))
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
    bearing = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    x, y, height, crown, band = trees.T
    tip = np.where(band == CONIFER, 1.0, 0.62)[:, None] * height[:, None] * np.linalg.norm(beam)
    round_crown = crown[:, None] * (1 + 0.3 * (np.cos(bearing) > 0.5)) * np.cos(bearing) + tip
    kite = np.where(np.cos(bearing) > 0.9, tip, crown[:, None] * np.cos(bearing).clip(-1, 0) + 0.2 * tip)
    along = np.where(band[:, None] == CONIFER, kite, round_crown)
    across = crown[:, None] * np.sin(bearing) * np.where(band[:, None] == CONIFER, np.cos(bearing) < 0.9, 1.0)
    outline = along[..., None] * ahead + across[..., None] * [-ahead[1], ahead[0]] + np.stack([x, y], -1)[:, None]
    texels = np.rint(terrain_uv(outline, side) * TERRAIN_SIZE * 16).astype(np.int32)
    for polygon in texels:
        cv2.fillConvexPoly(mask, polygon, 255, shift=4)
    return mask


def foliage_image() -> np.ndarray:
    """Three vertical bands (bark, conifers, broadleaves) of varied hue, from shade below to light above."""
    bands = [[(74, 56, 40), (98, 76, 56)], [(38, 84, 48), (74, 112, 52)], [(70, 112, 40), (132, 146, 58)]]
    hues = np.concatenate([np.linspace(first, last, 32) for first, last in bands])
    light = np.linspace(0.45, 1.35, 32)[:, None, None]
    return np.clip(hues * light, 0, 255).astype(np.uint8)[::-1].copy()


def horizon_image() -> np.ndarray:
    """From the outside colour (v = 0) to haze (v = 1)."""
    share = np.linspace(1, 0, 256)[:, None, None]
    return np.rint(np.array(OUTSIDE) + (np.array(HAZE) - OUTSIDE) * share).astype(np.uint8).repeat(4, axis=1)


def sky_image(rng: np.random.Generator) -> np.ndarray:
    """Cube faces one below the other (right, left, up, down, back, front): clouds over haze and distant hills."""
    axis = (np.arange(SKY_SIZE, dtype=np.float32) + 0.5) / SKY_SIZE * 2 - 1
    s, t = np.meshgrid(axis, axis)
    one = np.ones_like(s)
    faces = [(one, -t, -s), (-one, -t, s), (s, one, t), (s, -one, -t), (s, -t, one), (-s, -t, -one)]
    direction = np.concatenate([np.stack(face, axis=-1) for face in faces])
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    return _sky_colour(*np.moveaxis(direction, -1, 0), rng)


def _sky_colour(x, up, z, rng):
    """Colours for unit directions (x, up, z)."""
    image = np.empty((*x.shape, 3), np.float32)
    image[:] = HAZE
    _mix(image, (88, 142, 208), smooth(0.0, 0.65, up))
    flat = np.maximum(up, 0.03) + 0.10
    clouds = noise((512, 512), 12, 6, rng)
    u, v = x / flat * 40 + 256, z / flat * 40 + 256
    cover = cv2.remap(clouds, u.astype(np.float32), v.astype(np.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    _mix(image, (252, 252, 254), 0.85 * smooth(0.50, 0.66, cover) * smooth(0.03, 0.22, up))
    return np.clip(image, 0, 255).astype(np.uint8)
