"""Procedural triangle meshes: mountains, trees in clumps, the far ground and the diamond of a POI."""

from dataclasses import dataclass

import numpy as np

from .layout import SURFACE_NODES, Layout, surface_half_width

TERRAIN_REACH = 1.3  # sides: the textured ground is this wide, so that it can fade out around the map
HORIZON_REACH = 14.0  # sides from the map's centre to the rim of the far ground, where haze hides it
HAZE_DISTANCE = 3.5  # sides: along this way haze swallows 63 % of the far ground's colour

TREE_AREA = 44.0  # m² of forest per tree, more where MOST_TREES would be exceeded
MOST_TREES = 6500
FEWEST_TREES = 40  # per forest, however small it is
LARGE_CLUMP, SMALL_CLUMP = 14, 3  # trees; small clumps fill the rim that large ones leave
TRUNK_RADIUS, TRUNK_HEIGHT = 0.10, 0.45  # of a tree's crown radius, of its height
BARK, CONIFER, BROADLEAF = range(3)  # bands of the foliage texture


@dataclass(frozen=True)
class Mesh:
    """Triangles with one texture coordinate a vertex."""

    vertices: np.ndarray  # [n, 3] m
    faces: np.ndarray  # [m, 3] vertex indices, counter-clockwise from outside
    uv: np.ndarray  # [n, 2]


@dataclass(frozen=True)
class Forest:
    """Clumps of trees, drawn many times: few meshes, few draw calls, thousands of single trees."""

    clumps: list  # of [k, 5] arrays: a tree's x, y, height, crown radius (m) and band (CONIFER or BROADLEAF)
    places: np.ndarray  # [n, 5]: clump index, x, y (m), quarter turns, tint in [-1, 1]

    def trees(self) -> np.ndarray:
        """All trees [n, 5] at their places on the map, columns as in `clumps`."""
        placed = [np.zeros((0, 5))]
        for index, x, y, turns, _ in self.places:
            trees = self.clumps[int(index)].copy()
            cos, sin = [(1, 0), (0, 1), (-1, 0), (0, -1)][int(turns)]
            trees[:, :2] = trees[:, :2] @ [[cos, sin], [-sin, cos]] + [x, y]
            placed.append(trees)
        return np.concatenate(placed)


def terrain_uv(xy, side) -> np.ndarray:
    """Where map points xy [..., 2] lie in the terrain texture, (0, 0) south-west to (1, 1) north-east."""
    return (np.asarray(xy) / side - 0.5) / TERRAIN_REACH + 0.5


def mountain_mesh(part, surface, side) -> Mesh:
    """A mountain around its own centre: the triangles of `Layout.ground_height`, open below, nothing at height 0."""
    half = surface_half_width(part)
    axis = np.round(np.linspace(-half, half, SURFACE_NODES), 3)
    x, y = np.meshgrid(axis, axis)
    vertices = np.stack([x, y, surface], axis=-1).reshape(-1, 3)
    node = np.arange(SURFACE_NODES**2).reshape(SURFACE_NODES, SURFACE_NODES)
    low, right, high, up = node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]
    faces = np.stack([np.stack([low, right, high], -1), np.stack([low, high, up], -1)]).reshape(-1, 3)
    faces = faces[surface.ravel()[faces].max(axis=1) > 0]
    used, faces = np.unique(faces, return_inverse=True)
    vertices = vertices[used]
    uv = terrain_uv(vertices[:, :2] + [part["x"], part["y"]], side)
    return Mesh(vertices, faces.reshape(-1, 3), uv)


def horizon_mesh(side, rng: np.random.Generator) -> Mesh:
    """The ground from the terrain's square edge to a far circle, with hills; v is the share of haze in its colour."""
    bearing = np.linspace(0, 2 * np.pi, 161)
    direction = np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
    near = TERRAIN_REACH / 2 / np.abs(direction).max(axis=1)
    steps = np.linspace(0, 1, 17)[:, None]
    reach = near ** (1 - steps) * HORIZON_REACH**steps
    haze = 1 - np.exp((near - reach) / HAZE_DISTANCE)
    haze = np.clip(haze / haze[-1], 0.01, 0.99)
    waves = np.arange(3, 19, 2)[:, None, None]
    ridges = np.sum(np.cos(waves * bearing + rng.uniform(0, 2 * np.pi, (8, 17, 1))) / waves**0.5, axis=0)
    # Hills rise with the distance, on every other ring; the last ring is level, so that it meets the sky.
    hills = 0.04 * np.abs(ridges) * np.clip(reach - 2.0, 0, None) * (np.arange(17) % 2)[:, None]
    xyz = np.concatenate([reach[..., None] * direction, hills[..., None]], axis=-1)
    vertices = np.round(xyz * side, 1).reshape(-1, 3)
    node = np.arange(len(vertices)).reshape(reach.shape)
    inner, inner_next, outer, outer_next = node[:-1, :-1], node[:-1, 1:], node[1:, :-1], node[1:, 1:]
    faces = [np.stack([inner, outer, outer_next], -1), np.stack([inner, outer_next, inner_next], -1)]
    around = np.broadcast_to(bearing / (2 * np.pi), reach.shape)
    return Mesh(vertices, np.stack(faces).reshape(-1, 3), np.stack([around, haze], -1).reshape(-1, 2))


def diamond_mesh(radius) -> Mesh:
    """An upright octahedron, taller than wide."""
    vertices = radius * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1.5], [0, 0, -1.5]])
    sides = [(i, (i + 1) % 4) for i in range(4)]
    faces = np.array([(a, b, 4) for a, b in sides] + [(b, a, 5) for a, b in sides])
    return Mesh(np.round(vertices, 3), faces, np.zeros((6, 2)))


def plan_forest(layout: Layout, rng: np.random.Generator) -> Forest:
    """Plant every forest: large clumps wherever they fit into its discs, small ones along the rim."""
    discs = layout.forests
    area = np.pi * np.sum(discs["a"] ** 2)
    clumps, places = [], [np.zeros((0, 5))]
    for group in np.unique(discs["group"]):
        parts = discs[discs["group"] == group]
        tree_area = max(TREE_AREA, area / MOST_TREES)
        tree_area = min(tree_area, np.pi * np.sum(parts["a"] ** 2) / FEWEST_TREES)
        conifers = rng.choice([0.92, 0.5, 0.1])
        taken = np.zeros((0, 3))
        for size, variants in ((LARGE_CLUMP, 3), (SMALL_CLUMP, 2)):
            radius = np.sqrt(size * tree_area / np.pi)
            spots = _spots(parts, radius, taken, rng)
            taken = np.column_stack([spots, np.full(len(spots), radius)])
            choice = len(clumps) + rng.integers(variants, size=len(spots))
            turns, tint = rng.integers(4, size=len(spots)), rng.uniform(-1, 1, len(spots))
            places.append(np.column_stack([choice, spots, turns, tint]))
            clumps += [_draw_clump(size, radius, parts["height"][0], conifers, rng) for _ in range(variants)]
    return Forest(clumps, np.concatenate(places))


def _spots(parts, radius, taken, rng):
    """Places [n, 2] on a jittered hexagonal grid: inside a disc of `parts`, clear of the circles `taken` [m, 3]."""
    reach = parts["a"] - radius
    low = np.min([parts["x"] - reach, parts["y"] - reach], axis=1)
    high = np.max([parts["x"] + reach, parts["y"] + reach], axis=1)
    step = 1.75 * radius
    columns, rows = np.maximum(np.ceil((high - low) / (step, 0.87 * step)), 1).astype(int) + 1
    column, row = np.meshgrid(np.arange(columns), np.arange(rows))
    grid = np.stack([low[0] + step * (column + 0.5 * (row % 2)), low[1] + 0.87 * step * row], axis=-1).reshape(-1, 2)
    grid = np.round(grid + rng.uniform(-0.12, 0.12, grid.shape) * radius, 2)
    centres = np.stack([parts["x"], parts["y"]], axis=-1)
    inside = np.any(_distances(grid, centres) < reach, axis=1)
    clear = np.all(_distances(grid, taken[:, :2]) > taken[:, 2] + 0.5 * radius, axis=1)
    return grid[inside & clear]


def _distances(points, others):
    return np.linalg.norm(points[:, None] - others, axis=-1)


def _draw_clump(size, radius, canopy, conifers, rng):
    """Trees [size, 5] evenly spread over a disc (a sunflower spiral), none higher than the canopy."""
    index = np.arange(size)
    spacing = radius * np.sqrt(np.pi / size)
    distance = (radius - 0.35 * spacing) * np.sqrt((index + 0.5) / size)
    bearing = 2.4 * index + rng.uniform(0, 2 * np.pi)
    xy = np.stack([distance * np.cos(bearing), distance * np.sin(bearing)], axis=-1)
    xy += rng.uniform(-0.12, 0.12, xy.shape) * spacing
    height = canopy * rng.uniform(0.68, 1.0, size)
    band = np.where(rng.random(size) < conifers, CONIFER, BROADLEAF)
    slender = np.where(band == CONIFER, 0.44, 0.56)
    crown = np.minimum(slender * spacing, 0.32 * height) * rng.uniform(0.85, 1.15, size)
    return np.column_stack([xy, height, crown, band])


def tree_shapes(rng: np.random.Generator) -> dict:
    """A few unit trees per band, for `clump_mesh`."""
    return {band: [_draw_tree(band, rng) for _ in range(8)] for band in (CONIFER, BROADLEAF)}


def clump_mesh(trees, shapes: dict, rng: np.random.Generator) -> Mesh:
    """One mesh of a clump's trees [k, 5] (`Forest.clumps`), each some shape of its band."""
    vertices, faces, uv, count = [], [], [], 0
    for (x, y, height, crown, band), index in zip(trees, rng.integers(8, size=len(trees))):
        shape = shapes[int(band)][index]
        vertices.append(shape.vertices * [crown, crown, height] + [x, y, 0])
        faces.append(shape.faces + count)
        uv.append(shape.uv)
        count += len(shape.vertices)
    return Mesh(np.round(np.concatenate(vertices), 3), np.concatenate(faces), np.concatenate(uv))


def _draw_tree(band, rng) -> Mesh:
    """A tree of unit height and unit crown radius; v runs from shade (0) to light (1)."""
    crown, crown_faces, light = _draw_conifer(rng) if band == CONIFER else _draw_broadleaf(rng)
    trunk, trunk_faces = _prism(TRUNK_RADIUS, TRUNK_HEIGHT)
    hue = np.repeat([(band + rng.uniform(0.2, 0.8)) / 3, (BARK + 0.5) / 3], [len(crown), len(trunk)])
    uv = np.column_stack([hue, np.concatenate([light, np.linspace(0.2, 0.8, len(trunk))])])
    faces = np.concatenate([crown_faces, trunk_faces + len(crown)])
    return Mesh(np.concatenate([crown, trunk]), faces, np.round(uv, 4))


def _draw_conifer(rng, segments=6):
    """Three stacked cones; each rim is light and the cone vanishes into the shade of the next."""
    vertices, faces, light = [], [], []
    for tier, (bottom, top, radius) in enumerate([(0.14, 0.55, 1.0), (0.38, 0.78, 0.76), (0.62, 1.0, 0.50)]):
        bearing = 2 * np.pi * (np.arange(segments) + 0.5 * tier + rng.random()) / segments
        ring = radius * rng.uniform(0.88, 1.12, segments)
        first = len(vertices)
        vertices += list(np.stack([ring * np.cos(bearing), ring * np.sin(bearing), np.full(segments, bottom)], axis=-1))
        vertices.append(np.array([0, 0, top]))
        light += [0.45 + 0.2 * tier] * segments + [0.15 + 0.2 * tier if tier < 2 else 1.0]
        faces += [(first + i, first + (i + 1) % segments, first + segments) for i in range(segments)]
    return np.array(vertices), np.array(faces), np.array(light)


GOLDEN = (1 + 5**0.5) / 2
ICOSAHEDRON = np.array(
    [[-1, GOLDEN, 0], [1, GOLDEN, 0], [-1, -GOLDEN, 0], [1, -GOLDEN, 0], [0, -1, GOLDEN], [0, 1, GOLDEN],
     [0, -1, -GOLDEN], [0, 1, -GOLDEN], [GOLDEN, 0, -1], [GOLDEN, 0, 1], [-GOLDEN, 0, -1], [-GOLDEN, 0, 1]]
) / np.hypot(1, GOLDEN)  # fmt: skip
ICOSAHEDRON_FACES = np.array(
    [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6],
     [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7],
     [9, 8, 1]]
)  # fmt: skip


def _draw_broadleaf(rng):
    """A lumpy crown on a trunk."""
    lumps = ICOSAHEDRON * rng.uniform(0.86, 1.10, (12, 1))
    vertices = lumps * [1, 1, 0.36] + [0, 0, 0.62]
    return vertices, ICOSAHEDRON_FACES, np.clip(0.5 + 0.55 * lumps[:, 2], 0, 1)


def _prism(radius, height):
    """A three-sided trunk without ends."""
    bearing = 2 * np.pi * np.arange(3) / 3
    ring = np.stack([radius * np.cos(bearing), radius * np.sin(bearing), np.zeros(3)], axis=-1)
    faces = [face for i in range(3) for face in ((i, (i + 1) % 3, 3 + (i + 1) % 3), (i, 3 + (i + 1) % 3, 3 + i))]
    return np.concatenate([ring, ring + [0, 0, height]]), np.array(faces)
