"""Log-normal shadowing: its moments over many worlds, and what a link may expect of it."""

import dataclasses

import numpy as np
import pytest
from strategies import change

from commhg_mj.models.world import make_world
from commhg_mj.radio.shadowing import draw_waves, field_at, shadowing_loss
from commhg_mj.radio.world_links import WorldLinks
from commhg_mj.scenarios import SCENARIOS

SEEDS = 1500
PLACES = np.array([[x, y] for x in (0.0, 40.0, 900.0) for y in (0.0, 70.0)])  # far apart, in correlation lengths
APART = np.array([0.0, 0.1, 0.5, 1.0, 2.0, 4.0])
BARE = change(SCENARIOS["medium"], forest_share=0.0, mountain_share=0.0)
PLACE, OTHER = np.array([[200.0, 300.0, 1.0]]), np.array([[600.0, 700.0, 60.0]])


@pytest.fixture(scope="module")
def values():
    """[seeds, places, distances] of the field, along a bearing that differs from place to place."""
    bearings = np.arange(len(PLACES))[:, None] + np.array([0, 0.5]) * np.pi
    points = PLACES[:, None] + APART[:, None] * np.stack([np.cos(bearings[:, :1]), np.sin(bearings[:, :1])], -1)
    return np.array([[[field_at(w, x, y) for x, y in row] for row in points] for w in map(draw_waves, range(SEEDS))])


def test_the_field_is_a_unit_gaussian(values):
    """9000 values, those of one world nearly independent: tolerances of four standard errors."""
    sample = values[:, :, 0]
    n = sample.size
    assert np.mean(sample) == pytest.approx(0, abs=4 / np.sqrt(n))
    assert np.var(sample) == pytest.approx(1, abs=4 * np.sqrt(2 / n))
    for bound, share in [(1, 0.6827), (2, 0.9545)]:
        assert np.mean(np.abs(sample) < bound) == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / n))


def test_the_field_decorrelates_exponentially(values):
    found = np.mean(values[:, :, :1] * values, axis=(0, 1))
    np.testing.assert_allclose(found, np.exp(-APART), atol=4 * np.sqrt(2 / (SEEDS * len(PLACES))))


def test_worlds_and_places_far_apart_are_unrelated(values):
    sample = values[:, :, 0]
    relation = np.corrcoef(sample.T) - np.eye(len(PLACES))
    assert np.abs(relation).max() < 4.5 / np.sqrt(SEEDS)
    assert abs(np.corrcoef(sample[:-1, 0], sample[1:, 0])[0, 1]) < 4 / np.sqrt(SEEDS)


def test_a_links_shadowing_has_its_sigma_and_its_length_in_metres():
    """Both ends far apart; then one end moves by the correlation length: half of the variance decorrelates to 1/e."""
    sigma, length, losses = 4.0, 25.0, []
    for seed in range(SEEDS):
        waves = draw_waves(seed)
        losses.append([shadowing_loss(waves, sigma, length, 100.0, 100.0, x, 900.0) for x in (500.0, 525.0)])
    covariance = np.cov(np.array(losses).T)
    spread = 4 * sigma**2 * np.sqrt(2 / SEEDS)
    assert covariance[0, 0] == pytest.approx(sigma**2, abs=spread)
    assert covariance[0, 1] == pytest.approx(sigma**2 * (1 + np.exp(-1)) / 2, abs=spread)


def shadowed(world, a=PLACE, b=OTHER, **fields):
    scenario = change(world.scenario, **fields)
    return WorldLinks(dataclasses.replace(world, scenario=scenario)).between(a, b, 192)[0]


def test_shadowing_is_symmetric_and_a_function_of_the_worlds_seed():
    world, other = make_world(BARE, 1), make_world(BARE, 2)
    there, back = shadowed(world, shadowing=4.0), shadowed(world, OTHER, PLACE, shadowing=4.0)
    assert there["shadowing"] == back["shadowing"] != 0
    again = dataclasses.replace(world)
    assert shadowed(again, shadowing=4.0).tobytes() == there.tobytes()
    assert shadowed(other, shadowing=4.0)["shadowing"] != there["shadowing"]
    assert shadowed(world, shadowing=8.0)["shadowing"] == pytest.approx(2 * there["shadowing"])
    moved = shadowed(world, OTHER + [0, 0, 30], PLACE, shadowing=4.0)
    assert moved["shadowing"] == there["shadowing"], "a field over the map"


def test_shadowing_is_subtracted_from_the_snr_once():
    world = make_world(BARE, 1)
    clear, found = shadowed(world), shadowed(world, shadowing=4.0)
    assert found["snr"] == pytest.approx(clear["snr"] - found["shadowing"])


def test_without_sigma_there_is_none():
    world = make_world(BARE, 1)
    assert world.scenario.radio.shadowing == 0 and shadowed(world)["shadowing"] == 0
    assert shadowed(world, PLACE, PLACE + [250, 0, 0])["passing"] == 1
