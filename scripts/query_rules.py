"""Which fixed rule for queries is best for Greedy (docs/learning.md, "The fixed schedule").

python scripts/query_rules.py --missions 300 --scenario small medium

Every rule asks the operator whose report is oldest, who was never heard of first; rules differ in when a robot asks.
Printed is what a rule adds to the TWCR of greedy+no-query on the missions of calibration, paired and with less luck, in 95 %
intervals.
"""

import argparse

import numpy as np

from commhg_mj import policies
from commhg_mj.base.kernels import kernel
from commhg_mj.base.terms import Activity
from commhg_mj.flights.fly import fly
from commhg_mj.flights.held_out import CALIBRATION
from commhg_mj.flights.statistics import fair_difference, mean_interval
from commhg_mj.policies.greedy import Greedy
from commhg_mj.policies.planner import ask_at_work, new_memory
from commhg_mj.policies.schedule import longest_unheard
from commhg_mj.scenarios import SCENARIOS

SERVICING = int(Activity.SERVICING)
WHEN = (
    "at every decision", "outside service", "with a new task, farther than", "unless a report is fresher than",
    "at work, as the planner does, and with a new task, farther than",
)  # fmt: skip
RULES = [(0, 0), (1, 0), *((2, seconds) for seconds in (0, 15, 25, 40)), *((3, seconds) for seconds in (20, 45, 90)), (4, 15)]


@kernel
def ask(observations, decisions, when, seconds):
    """Queries by a rule, in place of the schedule's; a robot that requests assistance does not ask."""
    for i in range(observations.robots.shape[0]):
        robot, rows, task = observations.robots[i], observations.robot_operators[i], decisions.task[i]
        freshest = np.inf
        for h in range(rows.shape[0]):
            freshest = min(freshest, rows[h].age if rows[h].age >= 0.0 else np.inf)
        wants = (
            when == 0
            or when == 1 and robot.activity != SERVICING
            or when in (2, 4) and task >= 0 and observations.robot_tasks[i, task].distance > seconds * robot.speed
            or when == 3 and freshest >= seconds
        )
        if wants and not decisions.assist[i]:
            decisions.query[i] = longest_unheard(rows)


def asking(when: int, seconds: float):
    """Greedy that asks by a rule."""

    class Asking(Greedy):
        def __init__(self, batch):
            super().__init__(batch, asks=False)
            self.asked = new_memory(len(batch.seeds), batch.scenario).asked

        def __call__(self, observations):
            decisions = super().__call__(observations)
            ask(observations, decisions, when, float(seconds))
            if when == 4:
                ask_at_work(self.asked, observations, decisions)
            return decisions

    return Asking


def main(names, n_missions, links):
    seeds = range(CALIBRATION, CALIBRATION + n_missions)
    print("| scenario | limitation | a robot asks | | minus greedy+no-query |")
    print("|---|---|---|---|---|")
    for name in names:
        for limitation in ("nominal", "high"):
            scores_of = lambda policy: fly(SCENARIOS[name], policy, seeds, links, limitation)  # noqa: B023
            without = scores_of("greedy+no-query")
            for when, seconds in RULES:
                policies.POLICIES["asking"] = policies.PolicyInfo(asking(when, seconds))
                gain = mean_interval(fair_difference(scores_of("asking"), without))
                print(f"| {name} | {limitation} | {WHEN[when]} | {seconds} s | {gain} |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", nargs="+", default=list(SCENARIOS))
    parser.add_argument("--missions", type=int, default=100)
    parser.add_argument("--links", default="raycast")
    given = parser.parse_args()
    main(given.scenario, given.missions, given.links)
