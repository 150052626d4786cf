"""The ray-cast link on hand-made worlds, where geometry gives the answer, and what holds on every world."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from strategies import change

from commhg_mj.base.terms import Footprint
from commhg_mj.models.layout import PART, SURFACE_NODES
from commhg_mj.models.world import make_world
from commhg_mj.radio import losses as budget
from commhg_mj.radio.raycast import dominant_edge
from commhg_mj.radio.shadowing import draw_waves
from commhg_mj.radio.world_links import WorldLinks
from commhg_mj.scenarios import LIMITATIONS, PROFILES, SCENARIOS

MEDIUM = SCENARIOS["medium"]
WAVELENGTH = 299_792_458 / 2.4e9
SIZE = 192  # B
every_profile = pytest.mark.parametrize("profile", PROFILES)


def site(forests=(), hills=(), scenario=MEDIUM):
    """A world with cylinders of forest (x, y, radius, height) and straight cones (x, y, radius, height) alone."""
    world = make_world(scenario, 0)
    parts = [(Footprint.MOUNTAIN, i, x, y, r, r, 0, h) for i, (x, y, r, h) in enumerate(hills)]
    parts += [(Footprint.FOREST, i, x, y, r, r, 0, h) for i, (x, y, r, h) in enumerate(forests)]
    axis = np.linspace(-1.04, 1.04, SURFACE_NODES)
    cone = np.clip(1 - np.hypot(*np.meshgrid(axis, axis)), 0, None)
    surfaces = np.array([h * cone for *_, h in hills]).reshape(-1, SURFACE_NODES, SURFACE_NODES)
    layout = dataclasses.replace(world.layout, parts=np.array(parts, PART), surfaces=surfaces)
    return dataclasses.replace(world, layout=layout)


def link(world, a, b, links="raycast", size=SIZE):
    """One robot-robot LINK."""
    return WorldLinks(world, links).between(np.array([a], float), np.array([b], float), size)[0]


def delivery(found):
    return found["on_time"] + found["late"]


def random_links(layout, n, seed):
    """Antennas [n, 3] twice: on the ground and in the air, in forests, on flanks, some beyond the map."""
    rng, ends = np.random.default_rng(seed), []
    parts = layout.parts[rng.integers(len(layout.parts), size=n)]
    for _ in range(2):
        xy = np.c_[parts["x"], parts["y"]] + rng.uniform(-2, 2, (n, 2)) * parts["a"][:, None]
        ends.append(np.c_[xy, layout.ground_height(xy) + rng.choice([1.0, 10.0, 15.0, 60.0], n)])
    return ends


CANONICAL = {  # docs/radio.md: forests, hills, ends, delivered share of the abstract and of the ray-cast model
    "two UAVs over 100 m of forest": ([(500, 500, 50, 15)], [], (375, 500, 50), (625, 500, 50), 0.241, 0.950),
    "two UGVs with 100 m of forest between": ([(500, 500, 50, 15)], [], (400, 500, 1), (600, 500, 1), 0.241, 0.097),
    "the same with 30 m": ([(500, 500, 15, 15)], [], (400, 500, 1), (600, 500, 1), 0.630, 0.935),
    "UGV 20 m inside a forest, UAV at 50 m": ([(500, 500, 60, 15)], [], (540, 500, 1), (690, 500, 50), 0.722, 0.950),
    "two UGVs, an 80 m ridge between": ([], [(500, 500, 50, 80)], (375, 500, 1), (625, 500, 1), 0.0, 0.0),
    "two UAVs at 90 m over it": ([], [(500, 500, 50, 80)], (375, 500, 90), (625, 500, 90), 0.0, 0.950),
    "UGV and UAV, a 22 m hill at 100 m": ([], [(500, 500, 20, 22)], (400, 500, 1), (650, 500, 50), 0.017, 0.817),
}
every_case = pytest.mark.parametrize("case", CANONICAL)


def averaged(found, sigma=4.0):
    """Delivered share over normal shadowing, by Gauss-Hermite quadrature over the packet error rate."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(80)
    passing = 1 - budget.packet_error(found["snr"] - sigma * nodes, SIZE)
    return 0.95 * passing @ weights / weights.sum()


@every_case
def test_canonical_links_of_the_abstract_model(case):
    forests, hills, a, b, abstract, _ = CANONICAL[case]
    assert delivery(link(site(forests, hills), a, b, "abstract")) == pytest.approx(abstract, abs=0.002)


@every_case
def test_canonical_links_of_the_ray_cast_model(case):
    """The shares are averages over shadowing of 4 dB; without it all or nothing passes."""
    forests, hills, a, b, _, raycast = CANONICAL[case]
    world = site(forests, hills)
    found = link(world, a, b)
    assert averaged(found) == pytest.approx(raycast, abs=0.008)
    assert delivery(found) == pytest.approx(0.95 if raycast > 0.5 else 0.0, abs=1e-3)
    assert link(world, b, a)["snr"] == pytest.approx(found["snr"], abs=1e-9)


def test_the_page_on_radio_shows_these_links():
    page = (Path(__file__).parents[2] / "docs/radio.md").read_text(encoding="utf-8")
    for case, (*_, abstract, raycast) in CANONICAL.items():
        assert f"| {case} | {abstract:.3f} | {0.95 if raycast > 0.5 else 0:.2f} | {raycast:.3f} |" in page


def test_shadowing_averages_to_what_the_quadrature_says():
    forests, hills, a, b, _, _ = CANONICAL["UGV and UAV, a 22 m hill at 100 m"]
    expected = averaged(link(site(forests, hills), a, b)) / 0.95
    links = WorldLinks(site(forests, hills, change(MEDIUM, shadowing=4.0)))
    ends, passing = (np.array([a], float), np.array([b], float)), []
    for seed in range(1500):
        links.obstacles = links.obstacles._replace(waves=draw_waves(seed))
        passing.append(links.between(*ends, SIZE)[0]["passing"])
    assert np.mean(passing) == pytest.approx(expected, abs=4 * np.std(passing) / np.sqrt(1500))


def test_foliage_counts_metres_in_space_not_in_plan():
    """A ray from the middle of a canopy to a UAV above leaves through the top: similar triangles."""
    found = link(site([(500, 500, 60, 15)]), (500, 500, 1), (600, 500, 50))
    assert found["forest"] == pytest.approx(np.hypot(100, 49) * 14 / 49)
    assert found["foliage"] == pytest.approx(36 * (1 - np.exp(-0.382 * found["forest"] / 36)))
    assert link(site([(500, 500, 60, 15)]), (500, 500, 1), (600, 500, 50), "abstract")["forest"] == 60


def test_radios_inside_one_canopy_have_the_whole_way_in_it():
    found = link(site([(500, 500, 60, 15)]), (480, 500, 1), (520, 500, 14))
    assert found["forest"] == pytest.approx(found["metres"]) == np.hypot(40, 13)


def test_weissbergers_model_takes_the_same_metres():
    found = link(site([(500, 500, 15, 15)], scenario=change(MEDIUM, foliage="weissberger")), (400, 500, 1), (600, 500, 1))
    assert found["foliage"] == pytest.approx(1.33 * 2.4**0.284 * 30**0.588)


def nu_over(h, d1, d2):
    return h * np.sqrt(2 / WAVELENGTH * (1 / d1 + 1 / d2))


def test_one_summit_is_a_knife_edge():
    found = link(site(hills=[(500, 500, 20, 40)]), (400, 500, 1), (650, 500, 5))
    above, way = 40 - (1 + 4 * 100 / 250), np.hypot(250, 4)
    assert found["is_blocked"] == 1 and found["edge_at"] == pytest.approx(0.4)
    assert found["edge_height"] == pytest.approx(above)
    assert found["nu"] == pytest.approx(nu_over(above, 0.4 * way, 0.6 * way))
    assert found["diffraction"] == budget.knife_edge_loss(found["nu"])


def test_an_open_way_near_a_summit_loses_what_fresnels_zone_lacks():
    """An edge 1 m below the ray lies inside the zone that nu > -0.78 marks, one 3 m below does not."""
    found = link(site(hills=[(500, 500, 20, 40)]), (400, 500, 41), (600, 500, 41))
    nu = nu_over(-1, 100, 100)
    assert found["is_blocked"] == 0 and found["nu"] == pytest.approx(nu) and -0.78 < nu < 0
    assert found["diffraction"] == pytest.approx(budget.knife_edge_loss(nu)) and 0 < found["diffraction"] < 6
    assert link(site(hills=[(500, 500, 20, 40)]), (400, 500, 43), (600, 500, 43))["diffraction"] == 0


def test_two_summits_are_bullingtons_edge():
    """Where the steepest lines of sight from both ends meet."""
    (x1, h1), (x2, h2) = (460, 30), (560, 45)
    a, b = (400, 500, 1), (650, 500, 10)
    found = link(site(hills=[(x1, 500, 20, h1), (x2, 500, 20, h2)]), a, b)
    up_a, up_b = (h1 - 1) / (x1 - 400), (h2 - 10) / (650 - x2)
    assert up_a > (h2 - 1) / (x2 - 400) and up_b > (h1 - 10) / (650 - x1), "each end sees the nearer summit"
    x, z = np.linalg.solve([[-up_a, 1], [up_b, 1]], [1 - 400 * up_a, 10 + 650 * up_b])
    above, share, way = z - (1 + 9 * (x - 400) / 250), (x - 400) / 250, np.hypot(250, 9)
    assert found["edge_at"] == pytest.approx(share) and found["edge_height"] == pytest.approx(above)
    assert found["nu"] == pytest.approx(nu_over(above, share * way, (1 - share) * way))
    corrected = site(hills=[(x1, 500, 20, h1), (x2, 500, 20, h2)], scenario=change(MEDIUM, diffraction="bullington"))
    loss = found["diffraction"]
    assert link(corrected, a, b)["diffraction"] == pytest.approx(loss + (1 - np.exp(-loss / 6)) * (10 + 0.02 * 1e-3 * way))


def test_a_receiver_on_a_flank_sees_its_own_side_only():
    """A cone of slope 1; the receiver stands 1 m above it, half way up."""
    world = site(hills=[(500, 500, 40, 40)])
    facing, averted = (480, 500, 21), (520, 500, 21)
    assert link(world, (350, 500, 1), facing)["is_blocked"] == 0
    assert link(world, (350, 500, 1), facing)["diffraction"] == 0
    found = link(world, (350, 500, 1), averted)
    above, way = 40 - (1 + 20 * 150 / 170), np.hypot(170, 20)
    assert found["is_blocked"] == 1
    assert found["nu"] == pytest.approx(nu_over(above, way * 150 / 170, way * 20 / 170))


@pytest.mark.parametrize("diffraction", ["edge", "bullington"])
@pytest.mark.parametrize("above", [0.0, 1e-12, -1e-12, 1e-9, -1e-9, 1e-5, -1e-5])
def test_exact_grazing_of_a_level_way_halves_the_field(above, diffraction):
    """6 dB: no 0/0 where every slope vanishes, no step around it."""
    world = site(hills=[(500, 500, 20, 40)], scenario=change(MEDIUM, diffraction=diffraction))
    for a, b in [((400, 500), (600, 500)), ((600, 500), (400, 500)), ((500, 430), (500, 560))]:
        found = link(world, (*a, 40 - above), (*b, 40 - above))
        loss = 6.03 if diffraction == "edge" else 6.03 + (1 - np.exp(-6.03 / 6)) * 10
        assert found["diffraction"] == pytest.approx(loss, abs=0.02)
        assert found["nu"] == pytest.approx(0, abs=1e-3) and np.isfinite(found["snr"])


@pytest.mark.parametrize("is_blocked", [False, True])
@pytest.mark.parametrize("slopes", [(0.0, 0.0), (1e-5, 0.0), (0.0, 1e-5), (-1e-5, 1e-5), (1e-5, 1e-5)])
def test_where_ray_and_profile_disagree_by_centimetres_the_edge_grazes(is_blocked, slopes):
    """The mesh's rounding: no edge above a ray that passes, none without a horizon, and never 0/0."""
    clearance, at, above = dominant_edge((1e-3, *slopes, 1e-4, 0.3), is_blocked, 200.0)
    assert 0 < at < 1 and np.isfinite(above)
    if is_blocked and min(slopes) > 0:
        assert (at, above) == pytest.approx((0.5, 1e-3)) and clearance > 0
    else:
        assert (clearance, at, above) == (0, 0.3, 0)


@every_profile
def test_co_located_radios_hear_everything(profile):
    world = make_world(change(MEDIUM, profile=profile), 1)
    x, y = world.layout.forests[0][["x", "y"]]
    for apart in (0.0, 1e-9, 1e-6, 1e-3, 0.5):
        for direction in ([1, 0, 0], [0, 0, 1], [0.6, 0, 0.8]):
            found = link(world, (x, y, 1), np.array([x, y, 1]) + apart * np.array(direction))
            assert found["passing"] == 1 and found["metres"] == pytest.approx(apart, abs=1e-12)


NATURAL = [("small", 0), ("medium", 1), ("large", 2)]
OPTIONS = [
    dict(),
    dict(profile="edge"),
    dict(profile="radio"),
    dict(foliage="weissberger", diffraction="bullington"),
    dict(shadowing=4.0),
]
every_option = pytest.mark.parametrize("options", OPTIONS, ids=lambda options: ",".join(map(str, options.values())) or "default")


@every_option
@pytest.mark.parametrize("name, seed", NATURAL)
def test_links_are_symmetric_and_complete(name, seed, options):
    scenario = change(SCENARIOS[name], **options)
    world = make_world(scenario, seed)
    links = WorldLinks(world)
    a, b = random_links(world.layout, 400, seed)
    there, back = links.between(a, b, SIZE), links.between(b, a, SIZE)
    for field in set(there.dtype.names) - {"edge_at", "mountain"}:
        assert not np.isnan(there[field]).any()
        np.testing.assert_allclose(there[field], back[field], rtol=1e-6, atol=1e-6, err_msg=field)
    has_edge = there["nu"] > -1
    np.testing.assert_allclose(there["edge_at"][has_edge], 1 - back["edge_at"][has_edge], atol=1e-6)
    assert np.isnan(there["mountain"]).all(), "planar models alone know it"
    assert np.isfinite(there["snr"]).all() and not np.isposinf(there["nu"]).any()
    assert np.all((there["passing"] >= 0) & (there["passing"] <= 1)) and np.all(there["late"] >= 0)
    assert there["is_blocked"].sum() > 10 and np.sum(there["forest"] > 0) > 50 and has_edge.sum() > 10


@every_option
@pytest.mark.parametrize("limitation", LIMITATIONS)
def test_a_link_is_its_budget(options, limitation):
    """SNR from transmit power down to the noise, by adding up; packets pass by it, or all of them where nothing is lost."""
    scenario = change(MEDIUM, **options)
    world = make_world(scenario, 1)
    links = WorldLinks(world, "raycast", limitation)
    a, b = random_links(world.layout, 300, 7)
    found = links.to_station(a, 64)
    mast = [*world.layout.station, 15.0]
    metres = np.linalg.norm(a - mast, axis=1)
    np.testing.assert_allclose(found["metres"], metres)
    received = 20 - 20 * np.log10(4 * np.pi * metres / WAVELENGTH)
    excess = found["foliage"] + found["diffraction"] + found["shadowing"]
    level = LIMITATIONS.index(limitation)
    system = {"matched": 6.57, "edge": edge_loss(1000 * (0.30, 0.22, 0.06)[level]), "radio": 0.0}[scenario.radio.profile]
    np.testing.assert_allclose(found["snr"], received - excess - system + 93.99, atol=0.01)
    passing = 1 - budget.packet_error(found["snr"], 64)
    if scenario.radio.profile == "matched":
        passing[excess == 0] = 1
        assert np.any(excess == 0) == (scenario.radio.shadowing == 0)
    np.testing.assert_allclose(found["passing"], passing, atol=1e-12)
    share = (0.9, 0.8, 0.7)[level]
    np.testing.assert_allclose(found["on_time"], share * passing)
    np.testing.assert_allclose(found["late"], (1 - share) / 2 * passing, err_msg="no attempt of its own")
    assert np.any(passing < 0.5) and (np.any(passing > 0.5) or (options, limitation) == (dict(profile="edge"), "high"))


def edge_loss(metres):
    """System loss [dB] of the profile edge: from the SNR of 95 % of packets, found by scanning."""
    snr = np.linspace(0, 10, 10_001)
    needed = snr[np.argmax(budget.packet_error(snr, SIZE) <= 0.05)]
    return 20 - 20 * np.log10(4 * np.pi * metres / WAVELENGTH) + 93.99 - needed


def test_higher_canopies_and_denser_leaves_never_help():
    world = make_world(MEDIUM, 1)
    a, b = random_links(world.layout, 500, 3)
    shares = []
    for growth in (0.5, 1.0, 1.2, 2.0, 4.0):
        parts = world.layout.parts.copy()
        parts["height"][parts["kind"] == Footprint.FOREST] *= growth
        grown = dataclasses.replace(world, layout=dataclasses.replace(world.layout, parts=parts))
        shares.append(WorldLinks(grown).between(a, b, SIZE)["passing"])
    for rate in (0.0, 0.05, 0.2, 0.382, 1.0):
        shares.append(WorldLinks(make_world(change(MEDIUM, foliage_rate=rate), 1)).between(a, b, SIZE)["passing"])
    steps = np.diff(np.array(shares).reshape(2, 5, -1), axis=1)
    assert np.all(steps <= 1e-12) and np.all(steps[:, -2:].min(axis=(1, 2)) < -0.5)


def test_higher_mountains_never_help():
    base, losses = make_world(MEDIUM, 1), []
    a, b = random_links(base.layout, 800, 4)
    for growth in (0.3, 0.6, 0.8, 1.0):  # never above the antennas at the ends
        grown = dataclasses.replace(base, layout=dataclasses.replace(base.layout, surfaces=base.layout.surfaces * growth))
        losses.append(WorldLinks(grown).between(a, b, SIZE)["diffraction"])
    assert np.all(np.diff(losses, axis=0) >= -1e-9)
    assert np.sum(losses[-1] > losses[0] + 1) > 20


def test_ends_beyond_the_map_see_what_stands_on_it():
    world = site([(500, 500, 50, 15)], [(300, 500, 20, 22)])
    found = link(world, (-400, 500, 1), (1400, 500, 1))
    assert found["forest"] == pytest.approx(100) and found["is_blocked"] == 1
    assert found["passing"] == 0, "out of range"
    assert link(world, (-400, 900, 1), (1400, 900, 1))["snr"] == pytest.approx(link(world, (0, 0, 9), (1800, 0, 9))["snr"])


def test_station_links_have_no_range():
    world = site()
    links = WorldLinks(world)
    far = np.array([[0.0, 1000.0, 1.0]])
    assert links.to_station(far, SIZE)["passing"] == 1 and links.between(far, links.mast[None], SIZE)["passing"] == 0
