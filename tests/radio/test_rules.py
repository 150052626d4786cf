"""A radio's numbers under every calibration profile, link model and limitation level."""

import numpy as np
import pytest
from strategies import change

from commhg_mj.models.world import make_world
from commhg_mj.radio import LINK_MODELS
from commhg_mj.radio.link_models import RAY_MODELS, REFERENCE_SIZE, radio_rules, system_loss
from commhg_mj.radio.world_links import WorldLinks
from commhg_mj.scenarios import LIMITATIONS, PROFILES, SCENARIOS, RadioRules

RANGES = {"nominal": 0.30, "low": 0.22, "high": 0.06}  # of the side: the paper's and ours
IN_TIME = {"nominal": 0.9, "low": 0.8, "high": 0.7}
every_scenario = pytest.mark.parametrize("name", SCENARIOS)
every_limitation = pytest.mark.parametrize("limitation", LIMITATIONS)
every_link_model = pytest.mark.parametrize("links", LINK_MODELS)


def bare(name, **fields):
    """The scenario without obstacles."""
    return change(SCENARIOS[name], forest_share=0.0, mountain_share=0.0, **fields)


def over_plain(name, limitation, metres, **fields):
    """A ray-cast link of so many metres over the open plain."""
    scenario = bare(name, **fields)
    links = WorldLinks(make_world(scenario, 0), "raycast", limitation)
    return links.between(np.array([[0.0, 0.0, 1.0]]), np.array([[metres, 0.0, 1.0]]), REFERENCE_SIZE)[0]


@pytest.mark.parametrize("name, loss", [("small", 12.59), ("medium", 6.57), ("large", 0.55)])
@every_limitation
def test_matched_is_one_radio_at_every_level(name, loss, limitation):
    """A clear link at the nominal range keeps 15 dB over the SNR of one half, 2.82 dB; a level's cap comes on top."""
    scenario = SCENARIOS[name]
    assert system_loss(scenario, limitation) == pytest.approx(loss, abs=0.005)
    assert over_plain(name, limitation, 0.30 * scenario.map_side)["snr"] == pytest.approx(2.82 + 15, abs=0.005)


@every_scenario
@every_limitation
def test_matched_lets_everything_pass_up_to_its_cap(name, limitation):
    cap = RANGES[limitation] * SCENARIOS[name].map_side
    near, far = (over_plain(name, limitation, metres) for metres in (cap, 1.001 * cap))
    assert (near["passing"], far["passing"]) == (1, 0)
    assert near["on_time"] == pytest.approx(IN_TIME[limitation])
    assert near["late"] == pytest.approx((1 - IN_TIME[limitation]) / 2), "half of the rest"


@every_scenario
@every_limitation
def test_edge_delivers_95_per_cent_at_the_range_by_snr_and_has_no_cap(name, limitation):
    scale = RANGES[limitation] * SCENARIOS[name].map_side
    shares = [over_plain(name, limitation, x * scale, profile="edge")["passing"] for x in (0.5, 0.9, 1.0, 1.05, 1.2, 2.0)]
    assert shares == sorted(shares, reverse=True)
    assert shares[2] == pytest.approx(0.95, abs=1e-9) and shares[0] > 0.99999
    assert 0.5 < shares[3] < 0.95 and shares[4] < 0.5, "a waterfall, not a wall"
    assert radio_rules(bare(name, profile="edge"), "raycast", limitation)["range"] == np.inf


@every_scenario
@every_limitation
def test_radio_loses_nothing_in_its_system(name, limitation):
    assert system_loss(bare(name, profile="radio"), limitation) == 0
    found = over_plain(name, limitation, 600, profile="radio")
    assert found["snr"] == pytest.approx(20 - 95.615 + 93.99, abs=0.005) and found["passing"] > 1 - 1e-9


@pytest.mark.parametrize("profile", PROFILES)
def test_more_power_or_less_noise_changes_an_unmodified_radio_alone(profile):
    """The other profiles calibrate it away."""

    def snr(**fields):
        return over_plain("medium", "nominal", 300, profile=profile, **fields)["snr"]

    gain = 6.0 if profile == "radio" else 0.0
    assert snr(transmit_power=26.0) - snr() == pytest.approx(gain)
    assert snr(noise_figure=1.0) - snr() == pytest.approx(gain)
    assert snr(bandwidth=5.0) - snr() == pytest.approx(10 * np.log10(4) if gain else 0)


@every_link_model
@pytest.mark.parametrize("profile", PROFILES)
@every_limitation
def test_ranges_and_shares_in_time(links, profile, limitation):
    rules = radio_rules(bare("medium", profile=profile), links, limitation)
    is_free = links in ("perfect", "known")
    is_open = is_free or (LINK_MODELS[links] in RAY_MODELS and profile != "matched")
    assert rules["range"] == (np.inf if is_open else RANGES[limitation] * 1000)
    assert rules["on_time"] == pytest.approx(1 if is_free else IN_TIME[limitation])
    assert rules["link_model"] == LINK_MODELS[links]


def test_abstract_fit_differs_from_abstract_by_its_decay_lengths():
    scenario = change(SCENARIOS["medium"], fitted_forest_decay=31.0, fitted_mountain_decay=17.0)
    fit, plain = (radio_rules(scenario, links, "low") for links in ("abstract-fit", "abstract"))
    different = {name for name in plain.dtype.names if np.any(fit[name] != plain[name])}
    assert different == {"link_model", "forest_decay", "mountain_decay"}
    assert (fit["forest_decay"], fit["mountain_decay"]) == (31, 17)
    assert (plain["forest_decay"], plain["mountain_decay"]) == (73, 10)


def test_ray_cast_and_shuffled_are_one_radio():
    one, other = (radio_rules(SCENARIOS["large"], links, "high") for links in ("raycast", "raycast-shuffled"))
    assert [name for name in one.dtype.names if np.any(one[name] != other[name])] == ["link_model"]


def test_antennas_stand_where_the_scenario_says():
    scenario = change(SCENARIOS["medium"], uav_height=40.0, uav_antenna=2.0, ugv_antenna=0.5, mast_height=22.0)
    world = make_world(scenario, 1)
    links = WorldLinks(world)
    mountain = world.layout.mountains[0]
    places = np.array([[mountain["x"], mountain["y"]], world.layout.station])
    ground, floor = world.layout.ground_height(places), world.layout.flight_floor(places)
    assert ground[0] > 20
    np.testing.assert_allclose(links.robot_antennas(places, 0)[:, 2], floor + 42)
    np.testing.assert_allclose(links.robot_antennas(places, np.array([1, 1]))[:, 2], ground + 0.5)
    assert links.mast.tolist() == [*world.layout.station, 22]


@pytest.mark.parametrize("name", RadioRules.__dataclass_fields__)
def test_every_number_of_the_radio_counts(name):
    """Each field changes the rules of some link model."""
    base = bare("medium", profile="matched" if name == "margin" else "radio")
    words = {"profile": "edge", "foliage": "weissberger", "diffraction": "bullington"}
    value = words[name] if name in words else 2 * getattr(base.radio, name) + 1
    one, other = (
        {links: radio_rules(scenario, links, "nominal").tobytes() for links in LINK_MODELS}
        for scenario in (base, change(base, **{name: value}))
    )
    assert one != other


@pytest.mark.parametrize("links", ["smoke", "Raycast", "", None, 2])
def test_unknown_link_models_are_refused_by_name(links):
    with pytest.raises(ValueError, match=f"unknown link model {links!r}: use abstract"):
        radio_rules(SCENARIOS["small"], links, "nominal")


@pytest.mark.parametrize("limitation", ["none", "Nominal", "", None, 0])
def test_unknown_limitations_are_refused_by_name(limitation):
    with pytest.raises(ValueError, match=f"unknown limitation {limitation!r}: use nominal, low, high"):
        WorldLinks(make_world(SCENARIOS["small"], 0), "raycast", limitation)
