"""The noise of learned policies: as Gumbel as NumPy's, and everybody's own."""

from types import SimpleNamespace

import numpy as np
from scipy.stats import kstest

from commhg_mj.learning.noise import EVENT, OPERATOR, ROBOT, Draws, gumbel
from commhg_mj.mission.randomness import Event
from commhg_mj.policies import random

SEEDS = np.array([5, 9], np.uint64)


def draws(missions, times, actors):
    due = {"mission": np.array(missions), "time": np.array(times, float), "robot": np.array(actors), "operator": np.array(actors)}
    return Draws(SEEDS, SimpleNamespace(robots=due, operators=due))


def test_noise_is_gumbel_and_its_indices_are_independent():
    noise = gumbel(np.uint64(3), EVENT, np.arange(40)[:, None, None], np.arange(40)[:, None], np.arange(40))
    assert kstest(noise.ravel(), "gumbel_r").pvalue > 0.01 and np.unique(noise).size == noise.size
    for axis in range(3):
        one, other = np.moveaxis(noise, axis, 0)[:-1].ravel(), np.moveaxis(noise, axis, 0)[1:].ravel()
        assert abs(np.corrcoef(one, other)[0, 1]) < 4 / np.sqrt(one.size)


def test_noise_is_an_actors_own_whoever_else_is_due():
    components, three = np.arange(6), np.arange(3)[:, None]
    all_of_them = draws([0, 0, 1], [7, 7, 9], [2, 3, 2])
    for role in (ROBOT, OPERATOR):
        together = all_of_them(role, three, components)
        for row, who in enumerate([(0, 7, 2), (0, 7, 3), (1, 9, 2)]):
            alone = draws(*([part] for part in who))(role, np.zeros((1, 1), int), components)
            assert np.array_equal(alone[0], together[row])
        assert np.unique(together).size == together.size
    assert not np.intersect1d(all_of_them(ROBOT, three, components), all_of_them(OPERATOR, three, components)).size


def test_events_are_nobody_elses():
    mine = {EVENT + ROBOT, EVENT + OPERATOR}
    assert len(mine) == 2 and random.POLICY not in mine and min(mine) > max(Event) + 16
