"""Coverage: cells are links, the map lies the right way round, and what is refused."""

import dataclasses

import numpy as np
import pytest
from matplotlib.patches import Ellipse
from strategies import change

from commhg_mj.models.world import World, make_world
from commhg_mj.planning.coverage import CELLS, cover, coverage_figure
from commhg_mj.planning.endpoints import Endpoint, parse_endpoint
from commhg_mj.radio.world_links import WorldLinks
from commhg_mj.scenarios import SCENARIOS

SCENARIO = change(SCENARIOS["small"], n_tasks=2)
SIDE = 500.0
TELEMETRY = SCENARIO.communication.telemetry_bytes


@pytest.fixture(scope="module")
def world():
    return make_world(SCENARIO, 1)


@pytest.fixture(scope="module")
def from_middle(world):
    return cover(world, parse_endpoint("250,250,8", SCENARIO, "from"), 1.5)


@pytest.fixture(scope="module")
def from_station(world):
    return cover(world, Endpoint("station"), 4.0, "low", ("abstract", "raycast", "abstract-fit"))


def centre(row, column):
    """x and y of a cell's centre, row 0 in the south."""
    return np.array([(column + 0.5) * SIDE / CELLS, (row + 0.5) * SIDE / CELLS])


def cells(n=60):
    return np.random.default_rng(0).integers(0, CELLS, (n, 2))


def antenna(world, xy, height):
    return np.array([[*xy, float(world.layout.ground_height(xy)) + height]])


def test_cells_are_links_between_points(world, from_middle):
    source = antenna(world, np.array([250.0, 250.0]), 8.0)
    near = np.array([[125 + i, 125 + j] for i in range(-60, 61, 12) for j in range(-60, 61, 12)])
    for model in ("abstract", "raycast"):
        links, seen = WorldLinks(world, model), set()
        for row, column in np.concatenate([cells(), near]):
            found = links.between(antenna(world, centre(row, column), 1.5), source, 160)[0]
            cell = from_middle.delivered[model][row, column]
            assert cell == pytest.approx(found["on_time"] + found["late"], abs=1e-9), (model, row, column)
            seen.add(round(float(cell), 3))
        assert len(seen) > 3


def test_cells_are_links_to_the_station(world, from_station):
    links, seen = WorldLinks(world, "raycast", "low"), set()
    for row, column in cells(150):
        found = links.to_station(antenna(world, centre(row, column), 4.0), TELEMETRY)[0]
        assert from_station.delivered["raycast"][row, column] == pytest.approx(found["on_time"] + found["late"], abs=1e-9)
        seen.add(round(float(found["on_time"]), 3))
    assert len(seen) > 3


@pytest.mark.parametrize("level, delivered", [("nominal", 0.95), ("low", 0.9), ("high", 0.85)])
def test_an_abstract_station_is_heard_everywhere_alike(world, level, delivered):
    coverage = cover(world, Endpoint("station"), 1.5, level, ("abstract",))
    np.testing.assert_allclose(coverage.delivered["abstract"], delivered)
    assert list(coverage.delivered) == ["abstract"]


def test_it_is_a_probability(from_middle, from_station):
    for coverage, models in ((from_middle, 2), (from_station, 3)):
        assert len(coverage.delivered) == models
        for delivered in coverage.delivered.values():
            assert delivered.shape == (CELLS, CELLS) and delivered.min() >= 0 and delivered.max() <= 1
            assert 0 < delivered.mean() < 1


@pytest.mark.parametrize("x, y", [(100.0, 60.0), (480.0, 250.0), (20.0, 470.0)])
def test_row_0_is_south_and_column_0_is_west(x, y):
    """Without obstacles the map is the disc of the range around the source."""
    bare = make_world(change(SCENARIO, n_forests=0, n_mountains=0), 1)
    delivered = cover(bare, parse_endpoint(f"{x},{y}", SCENARIO, "from"), 1.5).delivered
    rows, columns = np.mgrid[:CELLS, :CELLS]
    within = np.hypot((columns + 0.5) * 2 - x, (rows + 0.5) * 2 - y) <= 150
    for values in delivered.values():
        np.testing.assert_allclose(values, 0.95 * within, atol=1e-12)


@pytest.mark.parametrize("south", [True, False])
def test_an_obstacle_darkens_its_own_half(world, south):
    """A forest south (north) of a source in the middle."""
    forest = world.layout.forests[:1].copy()
    forest["x"], forest["y"], forest["a"], forest["b"], forest["height"] = 250.0, 190.0 if south else 310.0, 40.0, 40.0, 20.0
    layout = dataclasses.replace(world.layout, parts=forest, surfaces=world.layout.surfaces[:0])
    one = World(world.scenario, world.seed, layout, world.pois, world.poi_types, world.routes)
    for values in cover(one, parse_endpoint("250,250,1", SCENARIO, "from"), 1.0).delivered.values():
        halves = values[: CELLS // 2], values[CELLS // 2 :]
        dark, light = halves if south else halves[::-1]
        assert light.max() == pytest.approx(0.95) and set(np.round(np.unique(light), 9)) == {0, 0.95}
        assert dark.mean() < 0.9 * light.mean()


def test_robots_are_no_source(world):
    with pytest.raises(ValueError, match="--from must be station, X,Y or X,Y,Z, is 'ugv1'"):
        cover(world, parse_endpoint("ugv1", SCENARIO, "from"), 1.5)


@pytest.mark.parametrize("height", [-0.1, float("nan"), float("inf"), 1e6])
def test_impossible_heights(world, height):
    with pytest.raises(ValueError, match="--height"):
        cover(world, Endpoint("station"), height)


def test_the_figure_shows_both_and_their_difference(world, from_middle):
    figure = coverage_figure(from_middle)
    maps = [ax for ax in figure.axes if ax.images]
    planar, rays, difference = (np.asarray(ax.images[0].get_array()) for ax in maps)
    np.testing.assert_array_equal(planar, from_middle.delivered["abstract"])
    np.testing.assert_array_equal(rays, from_middle.delivered["raycast"])
    np.testing.assert_allclose(difference, rays - planar)
    layout = world.layout
    for ax in maps:
        image = ax.images[0]
        assert image.origin == "lower" and list(image.get_extent()) == [0, SIDE, 0, SIDE], "row 0 lies in the south"
        outlines = [patch for patch in ax.patches if isinstance(patch, Ellipse)]
        assert sorted(patch.center for patch in outlines) == sorted(zip(layout.parts["x"], layout.parts["y"]))
        marks = [tuple(line.get_xydata()[0]) for line in ax.lines]
        assert tuple(layout.station) in marks and (250, 250) in marks
    titles = [ax.get_title(loc="left") for ax in maps]
    assert f"{planar.mean():.3f}" in titles[0] and f"{rays.mean():.3f}" in titles[1]
    assert f"{(rays - planar).mean():+.3f}" in titles[2]
