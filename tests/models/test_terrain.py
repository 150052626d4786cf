"""The ground inside kernels, and the profile under a link, against dense sampling of the layout's ground."""

import numpy as np
import pytest
from strategies import change

from commhg_mj.base.terms import Footprint
from commhg_mj.models.layout import PART, Layout
from commhg_mj.models.poses import robot_positions
from commhg_mj.models.raymodel import RayModel
from commhg_mj.models.terrain import NOTHING, SURFACE_NODES, add_profile, floor_at, ground_at
from commhg_mj.models.world import make_world
from commhg_mj.radio.losses import fresnel_parameter, knife_edge_loss, wavelength
from commhg_mj.scenarios import SCENARIOS
from commhg_mj.scenarios.heightmap import to_text

WORLDS = [("small", 0), ("medium", 1), ("large", 2)]
every_world = pytest.mark.parametrize("name, seed", WORLDS, ids=lambda value: str(value))


def rugged():
    """A layout with one mountain of random heights on a grid of exactly 2 m, its first node at (68, 68)."""
    part = np.zeros(1, PART)
    part[0] = (Footprint.MOUNTAIN, 0, 100, 100, 30.77, 30.77, 0, 40)
    axis = np.arange(SURFACE_NODES) - 16.0
    inside = np.hypot(*np.meshgrid(axis, axis)) < 15
    surface = np.where(inside, np.random.default_rng(0).uniform(0.1, 40, inside.shape), 0.0)
    return Layout(200.0, part, surface[None], np.zeros(2), np.zeros((0, 2)), np.zeros((1, 2)), 0.4)


def mountains_of(layout):
    return RayModel(layout).arrays.mountains


def horizon(mountains, a, b):
    """(highest, slope from a, slope from b, clearance, share of the way of the latter) over all mountains."""
    each = [add_profile(mountain, tuple(a), tuple(b), NOTHING) for mountain in mountains]
    return *np.max(each, axis=0)[:4], max(each, key=lambda own: own[3])[4]


def profile(layout, a, b, t):
    """Height [m] of the ground above the ray at shares t of the way, nan on the plain; distances from a and b."""
    ground = layout.ground_height(a[:2] + t[:, None] * (b - a)[:2])
    length = np.linalg.norm(b - a)
    return np.where(ground > 0, ground - a[2] - t * (b - a)[2], np.nan), t * length, (1 - t) * length


def sampled_horizon(layout, a, b, n=20_001):
    """The horizon over densely sampled points; -inf over the plain alone."""
    above, d1, d2 = profile(layout, a, b, np.linspace(0, 1, n)[1:-1])
    if np.isnan(above).all():
        return np.full(4, -np.inf)
    return np.array([np.nanmax(x) for x in (above, above / d1, above / d2, above * np.sqrt(1 / d1 + 1 / d2))])


def random_links(layout, n, seed):
    """[n, 2, 3]: links around mountains with ends on plain, flank and summit, some beyond the map, low and high."""
    rng = np.random.default_rng(seed)
    parts = layout.mountains[rng.integers(len(layout.mountains), size=n)]
    xy = np.c_[parts["x"], parts["y"]][:, None] + rng.uniform(-1.8, 1.8, (n, 2, 2)) * parts["a"][:, None, None]
    height = rng.choice([0.5, 1.0, 15.0, 60.0], (n, 2)) * rng.uniform(0.5, 1.5, (n, 2))
    return np.concatenate([xy, (layout.ground_height(xy) + height)[..., None]], axis=-1)


def check_horizon(layout, mountains, a, b):
    """Compare with samples; returns whether the ground stands above the ray."""
    *exact, at = horizon(mountains, a, b)
    sampled = sampled_horizon(layout, a, b)
    if sampled[0] > 0:  # edges stand out of their samples by a step's rise at most
        step = np.linalg.norm(b - a) / 20_000
        assert np.all(exact >= sampled - 1e-9)
        np.testing.assert_allclose(exact, sampled, rtol=0.01, atol=5 * step)
    else:  # below the ray samples come nearer near the ends, but never where a loss depends on it
        losses = [knife_edge_loss(fresnel_parameter(value, wavelength(2.4))) for value in (exact[3], sampled[3])]
        assert losses[0] == pytest.approx(losses[1], abs=0.1)
    if np.isfinite(exact[3]):
        above, d1, d2 = profile(layout, a, b, np.array([at]))
        assert exact[3] == pytest.approx((above * np.sqrt(1 / d1 + 1 / d2))[0], abs=1e-6), "it is where it says"
    return sampled[0] > 0


@every_world
def test_ground_is_the_layouts(name, seed):
    layout = make_world(SCENARIOS[name], seed).layout
    mountains, side = mountains_of(layout), layout.side
    near = random_links(layout, 400, 0)[..., :2].reshape(-1, 2)
    points = np.concatenate([near, np.random.default_rng(1).uniform(-0.2 * side, 1.2 * side, (400, 2))])
    heights = [ground_at(mountains, x, y) for x, y in points]
    np.testing.assert_allclose(heights, layout.ground_height(points), atol=1e-9)
    assert np.mean(np.array(heights) > 0) > 0.1


def test_ground_is_the_surface_at_its_nodes_and_linear_on_its_edges():
    layout = rugged()
    mountains, surface = mountains_of(layout), layout.surfaces[0]
    for row in range(0, SURFACE_NODES - 1, 3):
        for column in range(0, SURFACE_NODES - 1, 3):
            x, y, here = 68 + 2 * column, 68 + 2 * row, surface[row, column]
            assert ground_at(mountains, x, y) == here
            for east, north in [(1, 0), (0, 1), (1, 1)]:
                there = surface[row + north, column + east]
                halfway = ground_at(mountains, x + east, y + north)
                assert halfway == pytest.approx((here + there) / 2, abs=1e-9)


@pytest.mark.parametrize("name, seed", WORLDS)
def test_the_profile_agrees_with_dense_sampling(name, seed):
    layout = make_world(SCENARIOS[name], seed).layout
    mountains = mountains_of(layout)
    blocked = [check_horizon(layout, mountains, a, b) for a, b in random_links(layout, 80, seed)]
    assert 15 < sum(blocked) < 65


def test_the_profile_agrees_with_dense_sampling_of_a_rugged_mountain():
    layout = rugged()
    mountains = mountains_of(layout)
    assert sum(check_horizon(layout, mountains, a, b) for a, b in random_links(layout, 80, 3)) > 20


@pytest.mark.parametrize("turned", [False, True], ids=["there", "back"])
@pytest.mark.parametrize(
    "a, b, is_blocked",
    [
        ((60, 100), (140, 100), True),  # along a row of nodes
        ((100, 60), (100, 140), True),  # along a column
        ((50, 50), (150, 150), True),  # along a diagonal
        ((70, 74), (128, 132), True),  # along another
        ((50, 150), (150, 50), True),  # across, through nodes
        ((60, 101), (140, 101), True),  # between rows
        ((90, 100), (110, 100), True),  # from node to node
        ((100.5, 100), (100, 101.5), True),  # across one edge
        ((100, 100), (100.5, 101.5), False),  # within a cell
        ((68, 60), (68, 140), False),  # on the border of the surface
        ((60, 68), (140, 68), False),
        ((60, 132), (140, 132), False),
    ],
)
def test_links_along_the_surfaces_own_lines(a, b, is_blocked, turned):
    layout = rugged()
    mountains = mountains_of(layout)
    ends = [np.array([*xy, layout.ground_height(np.array(xy)) + height]) for xy, height in ((a, 1.0), (b, 4.0))]
    assert check_horizon(layout, mountains, *ends[:: -1 if turned else 1]) == is_blocked


def test_upright_links_and_links_over_the_plain_have_no_horizon():
    layout = rugged()
    mountain = mountains_of(layout)[0]
    assert add_profile(mountain, (100.0, 100.0, 50.0), (100.0, 100.0, 90.0), NOTHING) == NOTHING
    assert add_profile(mountain, (0.0, 0.0, 1.0), (199.0, 0.0, 1.0), NOTHING) == NOTHING
    assert add_profile(mountain, (0.0, 68.5, 1.0), (199.0, 68.5, 1.0), NOTHING) == NOTHING, "surface at height 0"


def test_the_profile_adds_to_what_the_horizon_already_holds():
    layout = rugged()
    mountain, a, b = mountains_of(layout)[0], (60.0, 103.0, 1.0), (150.0, 96.0, 1.0)
    alone = add_profile(mountain, a, b, NOTHING)
    assert add_profile(mountain, a, b, (1e3, 1e3, 1e3, 1e3, 0.25)) == (1e3, 1e3, 1e3, 1e3, 0.25)
    assert add_profile(mountain, a, b, (1e3, -1e3, 1e3, -1e3, 0.25)) == (1e3, alone[1], 1e3, *alone[3:])


def test_the_reach_of_a_mountain_covers_its_surface():
    for name, seed in WORLDS:
        layout = make_world(SCENARIOS[name], seed).layout
        for mountain in mountains_of(layout):
            axis = np.linspace(-1, 1, SURFACE_NODES) * mountain["half"]
            away = np.hypot(*np.meshgrid(axis, axis))
            cell = axis[1] - axis[0]
            assert away[mountain["height"] > 0].max() + np.sqrt(2) * cell <= mountain["reach"] + 1e-9
            assert mountain["top"] == mountain["height"].max() > 0


def ranges():
    """A heightmap of ridges with cliffs, beyond the map's edge, too."""
    x, y = np.meshgrid(np.linspace(0, 1, 128), np.linspace(0, 1, 128))
    waves = np.sin(9 * x + 4 * y) * np.cos(7 * y - 3 * x)
    return to_text(np.where((waves > 0.3) & (np.hypot(x - 0.5, y - 0.1) > 0.25), waves, 0.0))


FLIGHTS = [
    *(change(SCENARIOS[name], uav_slope=slope) for name in SCENARIOS for slope in (0.4, 0.1)),
    change(SCENARIOS["medium"], heightmap=ranges(), mountain_height=(60.0, 150.0)),
    change(SCENARIOS["small"], mountain_share=0.2, n_mountains=12),
]


@pytest.mark.parametrize("scenario", FLIGHTS, ids=lambda scenario: f"{scenario.name}-{scenario.world.uav_slope}")
def test_uavs_climb_no_faster_than_the_slope_at_their_speed_and_fly_no_lower_than_their_height(scenario):
    rng, side, slope = np.random.default_rng(0), scenario.map_side, scenario.world.uav_slope
    speed, steepest = scenario.robots.controlled_speed[0], 0.0
    for seed in range(3):
        world = make_world(scenario, seed)
        for start, bearing in zip(rng.uniform(-0.1 * side, 1.1 * side, (60, 2)), rng.uniform(0, 2 * np.pi, 60)):
            seconds = np.arange(0.0, 0.7 * side / speed, 0.1)
            way = start + seconds[:, None] * speed * np.array([np.cos(bearing), np.sin(bearing)])
            height = world.layout.flight_floor(way)
            climb = np.abs(np.diff(height)) / np.diff(seconds)
            assert climb.max() <= slope * speed + 1e-9
            assert np.all(height >= world.layout.ground_height(way) - 1e-9)
            steepest = max(steepest, climb.max())
    assert steepest > 0.9 * slope * speed, "they use it"


def test_the_floor_is_the_lowest_that_falls_no_faster():
    layout = rugged()
    (mountain,) = layout.terrain
    column, row = np.meshgrid(np.arange(SURFACE_NODES), np.arange(SURFACE_NODES))
    away = np.abs(column[..., None, None] - column) + np.abs(row[..., None, None] - row)
    lowest = np.max(layout.surfaces[0] - 0.4 / np.sqrt(2) * 2.0 * away, axis=(2, 3))
    np.testing.assert_allclose(mountain["floor"], lowest, atol=0.01)  # its cells are 2 m, to the centimetre of its half width
    beyond = layout.flight_floor([[100.0, 132.0], [100.0, 142.0], [142.0, 142.0], [0.0, 0.0]])
    edge, fall = mountain["floor"][-1], 0.4 / np.sqrt(2)
    expected = [edge[16], max(edge[16] - 10 * fall, 0), max(edge[-1] - 20 * fall, 0), 0]
    np.testing.assert_allclose(beyond, expected, atol=0.05)


@pytest.mark.parametrize("fields", [{}, {"heightmap": ranges()}], ids=["drawn", "heightmap"])
def test_a_floor_that_may_be_as_steep_as_can_be_is_the_ground(fields):
    layout = make_world(change(SCENARIOS["medium"], uav_slope=1e6, **fields), 1).layout
    points = np.random.default_rng(0).uniform(0, 1000, (2000, 2))
    np.testing.assert_allclose(layout.flight_floor(points), layout.ground_height(points), atol=1e-9)


@every_world
def test_kernels_layout_and_bodies_agree_on_the_floor_to_the_bit(name, seed):
    world = make_world(SCENARIOS[name], seed)
    n, side, mountains = world.scenario.n_robots, world.layout.side, mountains_of(world.layout)
    for points in np.random.default_rng(2).uniform(-0.2 * side, 1.2 * side, (40, n, 2)):
        floor = world.layout.flight_floor(points)
        assert floor.tolist() == [floor_at(mountains, x, y) for x, y in points]
        uavs = robot_positions(world, points, np.zeros(n, bool))[: world.scenario.n_uav]
        assert uavs[:, 2].tolist() == (floor + world.scenario.world.uav_height)[: len(uavs)].tolist()
    assert world.layout.flight_floor(points[0]) == floor[0] and world.layout.flight_floor(points[0]).shape == ()
