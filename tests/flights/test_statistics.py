"""Paired differences with less luck in them."""

from types import SimpleNamespace

import numpy as np
import pytest

from commhg_mj.flights.fly import fly
from commhg_mj.flights.statistics import ENOUGH, fair_difference, mean_interval
from commhg_mj.scenarios import SCENARIOS


def flown(twcr, luck):
    return [SimpleNamespace(twcr=value, luck=dict(enumerate(row))) for value, row in zip(twcr, luck)]


def test_what_luck_explains_is_gone_and_the_mean_stays():
    rng = np.random.default_rng(0)
    luck = rng.normal(size=(2, 200, 3))
    noise = 0.01 * rng.normal(size=200)
    one, other = flown(0.7 + noise + luck[0] @ [0.1, -0.2, 0.0], luck[0]), flown(0.5 + luck[1] @ [0.1, -0.2, 0.0], luck[1])
    plain = np.array([a.twcr - b.twcr for a, b in zip(one, other)])
    fair = fair_difference(one, other)
    assert np.std(fair) < 1.05 * np.std(noise) < 0.1 * np.std(plain)
    shift = (luck[0] - luck[1]).mean(axis=0) @ [0.1, -0.2, 0.0]
    assert fair.mean() == pytest.approx(plain.mean() - shift, abs=1e-3), "their luck was not the same"


@pytest.mark.parametrize("n", [1, 2, ENOUGH - 1])
def test_few_missions_cannot_tell_luck(n):
    rng = np.random.default_rng(0)
    one, other = (flown(rng.random(n), rng.random((n, 4))) for _ in range(2))
    assert fair_difference(one, other).tolist() == [a.twcr - b.twcr for a, b in zip(one, other)]


def test_the_same_missions_flown_alike_differ_by_nothing():
    one = flown(np.linspace(0, 1, 40), np.random.default_rng(0).random((40, 4)))
    assert np.abs(fair_difference(one, one)).max() < 1e-12


def test_of_real_missions_luck_explains_a_good_part():
    one, other = (fly(SCENARIOS["small"], policy, range(60)) for policy in ("planner", "greedy"))
    fair, plain = fair_difference(one, other), np.array([a.twcr - b.twcr for a, b in zip(one, other)])
    assert np.var(fair) < 0.75 * np.var(plain)
    assert mean_interval(fair).low < plain.mean() < mean_interval(fair).high
