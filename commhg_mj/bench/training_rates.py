"""Speeds of training end to end: simulate, infer and learn; and how much of a core's arithmetic that is."""

import resource
import tempfile
import time
from typing import NamedTuple

import torch
from torch.utils.flop_counter import FlopCounterMode

from ..learning.ppo import Hyper
from ..learning.train import Plan, Training
from .speeds import Speed

SIDE, PRODUCTS = 1024, 8  # of the matrices whose product is what a core can do at most


class TrainingRate(NamedTuple):
    """What training one method costs."""

    decisions: float  # of robots, per CPU-second
    flop: float  # floating-point operations of matrix products a decision, all epochs of PPO


def commhg_rates(scenario) -> list[Speed]:
    """Robot decisions per CPU-second of CommHG, their operations, the share of the core's peak; and the most memory so far."""
    speeds = rows_of(f"{scenario.name}: training", training_rate(scenario, "commhg"))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return [*speeds, Speed("most memory until then", memory, "GiB")]


def rows_of(what: str, rate: TrainingRate) -> list[Speed]:
    """A rate in words."""
    return [
        Speed(what, rate.decisions, "decisions/CPU-s"),
        Speed(f"{what}, matrix products", rate.flop / 1e6, "MFLOP/decision"),
        Speed(f"{what}, share of the core's peak", 100 * rate.decisions * rate.flop / peak(), "%"),
    ]


def training_rate(scenario, method: str, updates=3) -> TrainingRate:
    """The rate of some updates of PPO, after one that warms memory and kernels up."""
    with tempfile.TemporaryDirectory() as folder:
        training = Training(Plan(method, scenario, first_updates=0, hyper=Hyper.of(scenario.n_robots, False)), folder)
        with FlopCounterMode(display=False) as counter:
            training.update()
        flop = counter.get_total_flops() / training.decisions
        decisions, seconds = training.decisions, training.cpu_seconds
        for _ in range(updates):
            training.update()
    return TrainingRate((training.decisions - decisions) / (training.cpu_seconds - seconds), flop)


def peak() -> float:
    """Floating-point operations per CPU-second of the best of some large products of matrices, f4, on one thread."""
    torch.set_num_threads(1)
    a, best = torch.rand(SIDE, SIDE), 0.0
    for _ in range(PRODUCTS):
        start = time.process_time()
        a @ a
        best = max(best, 2.0 * SIDE**3 / (time.process_time() - start))
    return best
