"""One link explained: the table's numbers, the positions it stands on, and the cross-section."""

import cv2
import numpy as np
import pytest
from strategies import change

from commhg_mj.base.charts import save_figure
from commhg_mj.cli.tables.one_link import link_table
from commhg_mj.flights.fly import fly_to_end
from commhg_mj.mission.trace import load_trace, make_traces, save_trace
from commhg_mj.models.world import make_world
from commhg_mj.planning.endpoints import Endpoint, parse_endpoint
from commhg_mj.planning.link_pairs import links_of
from commhg_mj.planning.section import positions_at, section_figure, view_link
from commhg_mj.radio.world_links import WorldLinks
from commhg_mj.scenarios import SCENARIOS, with_profile

SCENARIO = change(SCENARIOS["small"], n_tasks=8, time_limit=60, forest_share=0.3, n_forests=8, uav_height=12.0)
SEED = 3


@pytest.fixture(scope="module")
def trace():
    return make_traces(fly_to_end("greedy", SCENARIO, [SEED], record=True), "greedy")[0]


def table_of(link):
    """{row: (abstract, ray cast)}."""
    names, planar, rays = ([*column.cells] for column in link_table(link).columns)
    return dict(zip(names, zip(planar, rays)))


def number(cell):
    return float(cell.split()[0])


def look(start, end, robots=None, scenario=SCENARIO, seed=SEED, limitation="nominal"):
    places = [parse_endpoint(text, scenario, "from") for text in (start, end)]
    return view_link(make_world(scenario, seed), places, robots, limitation)


def over_mountain(seed=SEED, scenario=SCENARIO):
    """(start, end) of a way over the middle of a mountain, 60 m past its footprint on either side."""
    part = make_world(scenario, seed).layout.mountains[0]
    reach = part["a"] + 20
    west, east = np.clip([part["x"] - reach, part["x"] + reach], 0, scenario.map_side)
    return f"{west},{part['y']}", f"{east},{part['y']}"


def test_flown_positions_are_the_traces(trace):
    for second in (0, 1, 17, 33.4, 33.6, trace.ticks):
        np.testing.assert_array_equal(positions_at(SCENARIO, SEED, second), trace.robot_xy[round(second)])


@pytest.mark.parametrize("second", [-1, 60.5, 1e9, float("nan"), float("inf")])
def test_no_second_outside_the_mission(second):
    with pytest.raises(ValueError, match=r"--at .* lies outside the mission"):
        positions_at(SCENARIO, SEED, second)


@pytest.mark.parametrize(
    "ends", [("uav0", "ugv1"), ("ugv0", "ugv1"), ("uav1", "station"), ("station", "ugv0"), ("uav0", "250,90,3")]
)
def test_trace_and_flight_explain_the_same(trace, tmp_path, ends):
    save_trace(trace, tmp_path / "t.npz")
    saved = load_trace(tmp_path / "t.npz")
    one, other = (table_of(look(*ends, robots)) for robots in (saved.robot_xy[45], positions_at(SCENARIO, SEED, 45)))
    assert one == other and set(one) >= {"delivered in time", "lost", "line of sight"}


def test_the_table_says_what_pairs_say(trace):
    rows, said = links_of(trace), set()
    for row in rows[(rows["time"] % 15 == 0)]:
        names = [*SCENARIO.robot_names, "station"]
        table = table_of(look(names[row["a"]], names[row["b"]], trace.robot_xy[row["time"]]))
        for column, name in ((0, "planar_delivered"), (1, "ray_delivered")):
            delivered = number(table["delivered in time"][column]) + number(table["delivered late"][column])
            assert delivered == pytest.approx(row[name], abs=2e-4)
            assert delivered + number(table["lost"][column]) == pytest.approx(1, abs=2e-4)
        assert number(table["metres in forest"][0]) == pytest.approx(row["planar_forest"], abs=0.06)
        assert number(table["metres in mountains"][0]) == pytest.approx(row["planar_mountain"], abs=0.06)
        assert number(table["metres in forest"][1]) == pytest.approx(row["ray_forest"], abs=0.06)
        clear = row["planar_forest"] == 0 and row["planar_mountain"] == 0
        assert table["line of sight"][0] == ("yes" if clear else "over footprints")
        sight = "a mountain stands in the ray" if row["ray_blocked"] else "in canopies" if row["ray_forest"] else "yes"
        assert table["line of sight"][1] == sight
        said.add(sight)
    assert len(said) > 1


def test_the_budget_adds_up():
    """Transmit power less all losses and the noise is the SNR; the packet's error decides what passes."""
    table = table_of(look("100,250,1", "230,260,1"))
    losses = sum(number(cells[1]) for name, cells in table.items() if name.endswith("loss (dB)") or name.startswith("shadow"))
    assert number(table["SNR (dB)"][1]) == pytest.approx(20 - losses - (-174 + 10 * np.log10(20e6) + 7), abs=0.05)
    assert number(table["system loss (dB)"][1]) == pytest.approx(12.59, abs=0.01)
    way = np.hypot(130, 10)
    assert number(table["way (m)"][0]) == pytest.approx(way, abs=0.06)
    assert number(table["free-space loss (dB)"][1]) == pytest.approx(20 * np.log10(4 * np.pi * way * 2.4e9 / 299792458), abs=0.05)


@pytest.mark.parametrize("profile, ranges", [("matched", ("150", "150")), ("edge", ("150", "none")), ("radio", ("150", "none"))])
def test_ranges_and_profiles(profile, ranges):
    scenario = with_profile(SCENARIO, profile)
    assert table_of(look("100,20", "120,20", scenario=scenario))["range (m)"] == ranges
    assert table_of(look("100,20", "station", scenario=scenario))["range (m)"] == ("none", "none")


def test_messages_and_their_sizes():
    for ends, said in ((("1,1", "9,9"), "broadcast of 160 B"), (("1,1", "station"), "telemetry of 40 B")):
        assert link_table(look(*ends)).title.endswith(said)
    forth, back = (table_of(look(*ends)) for ends in (("1,1", "station"), ("station", "1,1")))
    assert forth == back


def test_a_mountain_in_the_way():
    start, end = over_mountain()
    link = look(start, end)
    table, world = table_of(link), make_world(SCENARIO, SEED)
    assert table["line of sight"] == ("over footprints", "a mountain stands in the ray")
    part = world.layout.mountains[0]
    ways = [float(end.split(",")[0]) - float(start.split(",")[0]), float(table["metres in mountains"][0])]
    assert part["b"] * 1.5 < ways[1] < ways[0]
    assert number(table["diffraction loss (dB)"][1]) > 10 and number(table["delivered in time"][1]) < 0.05
    height, side = float(table["dominant edge"][1].split()[0]), table["dominant edge"][1]
    assert "above the ray" in side and 1 < height < world.layout.surfaces.max()
    assert any(artist.get_label().startswith("dominant edge") for artist in section_figure(link).axes[0].lines)


def test_the_same_place_is_refused():
    for text in ("station", "uav0", "3,4"):
        with pytest.raises(ValueError, match=f"--from and --to are the same place, {text}"):
            look(text, text, positions_at(SCENARIO, SEED, 0))


@pytest.mark.parametrize("ends", [("10,10", "10.0,10"), ("10,10", "10,10,1"), ("10,10", "10,10.0000001")])
def test_one_place_under_two_names_stands_in_no_mountain(ends):
    try:
        table = table_of(look(*ends))
    except ValueError as error:
        assert "same place" in str(error)
    else:
        assert table["line of sight"][1] == "yes" and "nan" not in str(table)


@pytest.mark.parametrize("ends", [("uav0", "ugv1"), ("ugv0", "station"), ("10,10,1", "490,480,90")])
def test_the_cross_section_is_a_picture(tmp_path, trace, ends):
    link = look(*ends, trace.robot_xy[50])
    save_figure(section_figure(link), tmp_path / "s.png")
    picture = cv2.imread(str(tmp_path / "s.png"))
    assert picture.shape[0] > 200 and picture.shape[1] > 600 and picture.std() > 10
    assert [path.name for path in tmp_path.iterdir()] == ["s.png"]


def test_the_cross_section_shows_ground_ray_and_zone():
    start, end = over_mountain()
    link, world = look(start, end), make_world(SCENARIO, SEED)
    axes = section_figure(link).axes[0]
    fills = {fill.get_label(): fill.get_paths()[0].vertices for fill in axes.collections if fill.get_paths()}
    xs = np.linspace(float(start.split(",")[0]), float(end.split(",")[0]), 2001)
    ground = world.layout.ground_height(np.c_[xs, np.full(len(xs), float(start.split(",")[1]))])
    assert fills["ground"][:, 1].max() == pytest.approx(ground.max(), abs=0.5) and ground.max() > 5
    way = xs[-1] - xs[0]
    zone = fills["first Fresnel zone"]
    middle = zone[np.abs(zone[:, 0] - way / 2) < way / 500, 1]
    assert np.ptp(middle) == pytest.approx(2 * np.sqrt(299792458 / 2.4e9 * way) / 2, rel=0.01), "2 r, r = sqrt(lambda d) / 2"
    ray = next(line for line in axes.lines if line.get_label() == "ray")
    np.testing.assert_allclose(ray.get_xdata()[[0, -1]], [0, way], atol=1e-6)
    np.testing.assert_allclose(ray.get_ydata()[[0, -1]], link.antennas[:, 2])
    said = axes.get_title(loc="left")
    for model in ("abstract", "raycast"):
        found = WorldLinks(world, model).between(link.antennas[:1], link.antennas[1:], 160)[0]
        assert f"{found['on_time'] + found['late']:.3f}" in said


def test_the_canopy_is_as_high_as_its_forest():
    part = make_world(SCENARIO, SEED).layout.forests[-1]
    x, y, reach = part["x"], part["y"], part["a"] + 15
    link = look(f"{max(0, x - reach)},{y},1", f"{min(500, x + reach)},{y},1")
    fills = {fill.get_label(): fill for fill in section_figure(link).axes[0].collections}
    heights = np.concatenate([path.vertices[:, 1] for path in fills["canopy"].get_paths()])
    assert heights.max() >= part["height"] - 1e-6 and heights.max() <= 20
    assert number(table_of(link)["metres in forest"][1]) > 0.9 * min(reach, part["a"])


def test_a_place_is_more_than_a_name():
    assert Endpoint("uav0", robot=0) == parse_endpoint("uav0", SCENARIO, "to") != parse_endpoint("uav1", SCENARIO, "to")
