"""The calibration rules of the mission's defaults (docs/calibration.md), measured and judged."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..base.arguments import missions_of
from ..flights.fly import fly
from ..flights.held_out import CALIBRATION
from ..flights.statistics import Interval, mean_interval
from ..radio import DEFAULT_LINKS
from ..scenarios import SCENARIOS

MEASURE = "greedy+no-query"  # what the rules say of Greedy is about it when it asks nobody
FLIGHTS = {  # label: policy, limitation, with operators
    "random": ("random", "nominal", True),
    MEASURE: (MEASURE, "nominal", True),
    f"{MEASURE}, low": (MEASURE, "low", True),
    f"{MEASURE}, high": (MEASURE, "high", True),
    f"{MEASURE}, no operators": (MEASURE, "nominal", False),
    "greedy": ("greedy", "nominal", True),
    "greedy, high": ("greedy", "high", True),
    "cbba": ("cbba", "nominal", True),
    "planner": ("planner", "nominal", True),
    "planner, high": ("planner", "high", True),
    "omniscient": ("omniscient", "nominal", True),
    "omniscient, no operators": ("omniscient", "nominal", False),
}


LINKS = (DEFAULT_LINKS, "abstract")  # the rules hold under the first; what changes without geometry is printed beside it


class Rule(NamedTuple):
    text: str
    measured: Interval
    holds: bool


class Calibration(NamedTuple):
    """One scenario's figures under one link model, and what they say."""

    scenario: str
    links: str
    twcr: dict[str, Interval]
    rules: list[Rule]


def calibrate(
    name: str, n_missions=200, workers=1, links=DEFAULT_LINKS, advance: Callable[[float], None] = lambda missions: None
) -> Calibration:
    """Fly the references of one scenario and hold its defaults against the rules; differences are paired."""
    scenario, seeds = SCENARIOS.find(name), range(CALIBRATION, CALIBRATION + missions_of("n_missions", n_missions))
    alone = dataclasses.replace(scenario, n_operators=0)
    twcr = {}
    for label, (policy, limitation, has_operators) in FLIGHTS.items():
        variant = scenario if has_operators else alone
        scores = fly(variant, policy, seeds, links, limitation, workers=workers, advance=advance)
        twcr[label] = np.array([score.twcr for score in scores])
    greedy, reference = twcr[MEASURE], twcr["omniscient"]
    gap = mean_interval(reference - greedy)
    supervision = mean_interval(reference - twcr["omniscient, no operators"])
    limitation = mean_interval(greedy - twcr[f"{MEASURE}, high"])
    level = mean_interval(greedy)
    rules = [
        Rule(f"the mean TWCR of {MEASURE} lies in 0.45-0.70", level, 0.45 <= level.mean <= 0.70),
        Rule("the omniscient reference is at least 0.15 above it", gap, gap.mean >= 0.15),
        Rule("without operators the reference loses at least 0.05", supervision, supervision.mean >= 0.05),
        Rule(f"from nominal to high limitation {MEASURE} loses at least 0.03", limitation, limitation.mean >= 0.03),
    ]
    return Calibration(name, links, {label: mean_interval(values) for label, values in twcr.items()}, rules)
