"""Speeds of training count decisions and operations; how fast this machine is belongs to no test."""

import pytest
import torch

from commhg_mj.bench import training_rates as bench
from commhg_mj.bench.training_rates import TrainingRate, rows_of, training_rate
from commhg_mj.learning.train import Training
from commhg_mj.scenarios import from_dict

TINY = from_dict({"base": "small", "name": "tiny", "n_tasks": 4, "time_limit": 40})


def test_a_rate_is_decisions_over_seconds_after_the_first_update(monkeypatch):
    """Updates of 10 decisions and 4 s each, but for the first; two products of 2 x 3 by 3 x 5 in it."""
    done = []

    def update(training):
        done.append(training)
        training.decisions, training.cpu_seconds = 10 * len(done), 100.0 + 4.0 * len(done)
        for _ in range(2):
            torch.rand(2, 3) @ torch.rand(3, 5)

    monkeypatch.setattr(Training, "update", update)
    rate = training_rate(TINY, "mappo", updates=5)
    assert len(done) == 6
    assert rate == TrainingRate(10 / 4, 2 * 2 * 2 * 3 * 5 / 10)


def test_rows_say_what_share_of_the_core_works(monkeypatch):
    monkeypatch.setattr(bench, "peak", lambda: 1e9)
    assert rows_of("tiny: training", TrainingRate(200.0, 2e6)) == [
        ("tiny: training", 200.0, "decisions/CPU-s"),
        ("tiny: training, matrix products", 2.0, "MFLOP/decision"),
        ("tiny: training, share of the core's peak", pytest.approx(40.0), "%"),
    ]


def test_the_peak_is_the_best_product(monkeypatch):
    seconds = iter([0.0, 4.0, 10.0, 11.0] + [20.0, 30.0] * bench.PRODUCTS)
    monkeypatch.setattr(bench.time, "process_time", lambda: next(seconds))
    assert bench.peak() == 2.0 * bench.SIDE**3
