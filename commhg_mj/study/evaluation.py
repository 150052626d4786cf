"""Policies on held-out missions, paired mission by mission."""

import json
from typing import NamedTuple

import numpy as np

from ..base.arguments import missions_of, names
from ..base.files import whole_file
from ..flights.held_out import HELD_OUT
from ..flights.statistics import fair_difference, mean_interval, middle_interval
from ..mission.state import LUCK
from ..policies import find_policy, label_of
from ..replay.communication import FIGURES, fly_and_listen
from ..scenarios import Scenario


class Condition(NamedTuple):
    """What missions are flown in."""

    scenario: Scenario
    links: str
    limitation: str

    def __str__(self):
        return f"{self.scenario.name}, {self.links} links, {self.limitation} limitation"


def evaluate(scenario, policies, n_missions, links, limitation, workers, advance) -> dict:
    """{policy: score and figures of communication of each of the same held-out missions}."""
    policies, seeds = names("policy", policies), range(HELD_OUT, HELD_OUT + missions_of("n_missions", n_missions))
    for policy in policies:
        find_policy(policy)  # refuses a bad one before anything flies
    return {policy: fly_and_listen(scenario, policy, seeds, links, limitation, workers, advance) for policy in policies}


def compare_scores(flights: dict) -> list[dict]:
    """A row a policy: TWCR, and its paired difference to the first policy, plain and with less luck in it."""
    scores = [[score for score, _ in each] for each in flights.values()]
    twcr = np.array([[score.twcr for score in each] for each in scores])
    return [
        {
            "policy": name, "twcr": mean_interval(each), "iqm": middle_interval(each),
            "difference": mean_interval(each - twcr[0]), "fair": mean_interval(fair_difference(own, scores[0])),
        }
        for name, each, own in zip(table_names(flights), twcr, scores)
    ]  # fmt: skip


def table_names(policies) -> list[str]:
    """What tables call policies: their labels, marked; one weights file and its copy elsewhere go by their paths."""
    labels = [label_of(policy) for policy in policies]
    names = [label if labels.count(label) == 1 else policy for label, policy in zip(labels, policies)]
    return [name + " (privileged)" * find_policy(policy).is_privileged for name, policy in zip(names, policies)]


def save_evaluation(path, n_missions: int, results: list[tuple[Condition, dict]]) -> None:
    """Every mission's TWCR, luck and figures of communication under each condition as JSON, null where a mission has none."""
    conditions = [
        {
            "scenario": condition.scenario.name,
            "links": condition.links,
            "limitation": condition.limitation,
            "twcr": {policy: [score.twcr for score, _ in each] for policy, each in flights.items()},
            "luck": {
                policy: {name: [score.luck[name] for score, _ in each] for name in LUCK} for policy, each in flights.items()
            },
            "communication": {
                policy: {name: [None if np.isnan(said[name]) else said[name] for _, said in each] for name in FIGURES}
                for policy, each in flights.items()
            },
        }
        for condition, flights in results
    ]
    with whole_file(path) as draft:
        draft.write_text(json.dumps({"missions": n_missions, "first_seed": HELD_OUT, "conditions": conditions}))
