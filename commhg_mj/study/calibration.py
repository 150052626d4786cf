"""The calibration rules of the mission's defaults (docs/calibration.md), measured and judged."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..base.arguments import missions_of
from ..flights.fly import fly
from ..flights.held_out import CALIBRATION
from ..flights.statistics import Interval, fair_difference, mean_interval
from ..radio import DEFAULT_LINKS
from ..scenarios import SCENARIOS

MEASURE = "greedy+no-query"  # what the rules say of Greedy is about it when it asks nobody
TEAM = 5  # robots: what a smaller team is told matters less, since it meets all the time; three lines ask nothing of it


class Flight(NamedTuple):
    """What is flown for one figure."""

    policy: str
    limitation: str = "nominal"
    has_operators: bool = True
    links: str = ""  # by default those that the rules are judged under


FLIGHTS = {
    "random": Flight("random"),
    MEASURE: Flight(MEASURE),
    f"{MEASURE}, low": Flight(MEASURE, "low"),
    f"{MEASURE}, high": Flight(MEASURE, "high"),
    f"{MEASURE}, no operators": Flight(MEASURE, has_operators=False),
    "greedy": Flight("greedy"),
    "greedy, high": Flight("greedy", "high"),
    "cbba": Flight("cbba"),
    "planner": Flight("planner"),
    "planner, high": Flight("planner", "high"),
    "planner, perfect links": Flight("planner", links="perfect"),
    "planner+no-broadcast": Flight("planner+no-broadcast"),
    "planner+no-query": Flight("planner+no-query"),
    "planner+no-query, high": Flight("planner+no-query", "high"),
    "planner+always-asks": Flight("planner+always-asks"),
    "omniscient": Flight("omniscient"),
    "omniscient, no operators": Flight("omniscient", has_operators=False),
}
CLOCKED, AT_RANDOM = "planner broadcasts by the clock", "planner broadcasts at random"
ASKS_AT_RANDOM = "planner asks at random, high"
CORRECTIONS = 2  # of a gate's rate: buckets run dry, so that twice the chance is not twice the bytes
LINKS = (DEFAULT_LINKS, "abstract")  # the rules hold under the first; what changes without geometry is printed beside it


def n_broadcast(scores) -> float:
    """Bytes that broadcasts of a mean mission take."""
    return float(np.mean([score.messages["broadcast"]["bytes"] for score in scores]))


def n_queries(scores) -> float:
    """Queries of a mean mission."""
    return float(np.mean([score.messages["query"]["attempted"] for score in scores]))


class Gate(NamedTuple):
    """Another gate in place of the planner's, about as often open as its own."""

    planner: str  # whose rate it gets
    policy: Callable[[float], str]  # out of how often it opens, in its own unit
    first: float  # where its rate is measured
    count: Callable[[list], float]

    def fly(self, scores: dict[str, list], scores_of: Callable) -> list:
        """Its scores, beside those of `scores[planner]`."""
        limitation, wanted, often = FLIGHTS[self.planner].limitation, self.count(scores[self.planner]), self.first
        for _ in range(CORRECTIONS):
            often *= wanted / max(1.0, self.count(scores_of(Flight(self.policy(often), limitation))))
        return scores_of(Flight(self.policy(often), limitation))


GATES = {  # a broadcast a minute is one every 60 s
    CLOCKED: Gate("planner", lambda often: f"planner+broadcasts-every-{max(1.0, 60.0 / max(often, 1e-9)):.1f}", 2.0, n_broadcast),
    AT_RANDOM: Gate("planner", lambda chance: f"planner+broadcasts-at-random-{min(1.0, chance):.3f}", 0.3, n_broadcast),
    ASKS_AT_RANDOM: Gate("planner, high", lambda chance: f"planner+asks-at-random-{min(1.0, chance):.3f}", 0.1, n_queries),
}
N_FLIGHTS = len(FLIGHTS) + (CORRECTIONS + 1) * len(GATES)


class Rule(NamedTuple):
    text: str
    measured: Interval
    holds: bool
    is_asked: bool = True

    @property
    def verdict(self) -> str:
        return "not asked" if not self.is_asked else "holds" if self.holds else "BROKEN"


class Calibration(NamedTuple):
    """One scenario's figures under one link model, and what they say."""

    scenario: str
    links: str
    twcr: dict[str, Interval]
    rules: list[Rule]


def calibrate(
    name: str, n_missions=200, workers=1, links=DEFAULT_LINKS, advance: Callable[[float], None] = lambda missions: None
) -> Calibration:
    """Fly the references of one scenario and hold its defaults against the rules, by `fair_difference`s."""
    scenario, seeds = SCENARIOS.find(name), range(CALIBRATION, CALIBRATION + missions_of("n_missions", n_missions))

    def scores_of(flight: Flight) -> list:
        flown_in = scenario if flight.has_operators else dataclasses.replace(scenario, n_operators=0)
        return fly(flown_in, flight.policy, seeds, flight.links or links, flight.limitation, workers=workers, advance=advance)

    scores = {label: scores_of(flight) for label, flight in FLIGHTS.items()}
    scores |= {label: gate.fly(scores, scores_of) for label, gate in GATES.items()}
    intervals = {label: mean_interval([score.twcr for score in each]) for label, each in scores.items()}
    return Calibration(name, links, intervals, judge(scores, scenario.n_robots >= TEAM))


def judge(scores: dict[str, list], is_team: bool) -> list[Rule]:
    """What each rule says of these flights; three ask nothing of who is no team (`TEAM`)."""

    def gain(one: str, other: str) -> np.ndarray:
        return fair_difference(scores[one], scores[other])

    def at_least(text: str, difference: np.ndarray, least: float, is_asked=True) -> Rule:
        measured = mean_interval(difference)
        return Rule(text, measured, measured.mean >= least, is_asked)

    level = mean_interval([score.twcr for score in scores[MEASURE]])
    always = mean_interval(gain("planner+always-asks", "planner+no-query"))
    hearing = gain("planner", "planner+no-broadcast")
    asking, asking_high = gain("planner", "planner+no-query"), gain("planner, high", "planner+no-query, high")
    return [
        Rule(f"the mean TWCR of {MEASURE} lies in 0.45-0.70", level, 0.45 <= level.mean <= 0.70),
        at_least("the omniscient reference is at least 0.15 above it", gain("omniscient", MEASURE), 0.15),
        at_least("without operators the reference loses at least 0.05", gain("omniscient", "omniscient, no operators"), 0.05),
        at_least(f"from nominal to high limitation {MEASURE} loses at least 0.03", gain(MEASURE, f"{MEASURE}, high"), 0.03),
        at_least("the planner gains at least 0.08 by what robots tell each other", hearing, 0.08, is_team),
        at_least("it gains at least 0.02 more by perfect links", gain("planner, perfect links", "planner"), 0.02),
        at_least("broadcasts on change gain at least 0.01 over as many bytes by the clock", gain("planner", CLOCKED), 0.01),
        Rule("to ask at every opportunity loses", always, always.mean < 0.0),
        at_least("to ask by the planner's rule gains at least 0.01 at high limitation", asking_high, 0.01, is_team),
        at_least("that is more than at nominal", asking_high - asking, 0.0, is_team),
        at_least("a random gate for as many bytes gains 0.01 less than the planner's", gain("planner", AT_RANDOM), 0.01),
        at_least("as many queries at random gain 0.01 less, high", gain("planner, high", ASKS_AT_RANDOM), 0.01),
    ]
