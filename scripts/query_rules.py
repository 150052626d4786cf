"""Which fixed rule for queries is best for Greedy (docs/learning.md, "The fixed schedule").

python scripts/query_rules.py --missions 300 --scenario small medium

Every rule asks the operator whose report is oldest, who was never heard of first. Rules differ in the clock (no operator's
report is fresher than so many seconds) and in when a robot asks at all. Printed is what a rule adds to the TWCR of
greedy+no-query on the missions of calibration, paired, with 95 % intervals.
"""

import argparse

import numpy as np

from commhg_mj import policies
from commhg_mj.base.kernels import kernel
from commhg_mj.base.terms import NOBODY, Activity
from commhg_mj.flights.fly import fly
from commhg_mj.flights.held_out import CALIBRATION
from commhg_mj.flights.statistics import mean_interval
from commhg_mj.policies.greedy import Greedy
from commhg_mj.policies.schedule import HARD, longest_unheard
from commhg_mj.scenarios import SCENARIOS

SERVICING, FAR = int(Activity.SERVICING), 25.0  # s to the task
WHEN = ("at every decision", "with a new task", "outside service", "on a far task, outside service", "on a hard task")
RULES = [(0, clock) for clock in (0, 20, 45, 90)] + [(2, clock) for clock in (0, 20, 45)] + [(3, 0), (1, 0), (4, 0)]


@kernel
def ask(observations, decisions, when, clock):
    """Queries by a rule, in place of the schedule's; a robot that requests assistance does not ask."""
    for i in range(observations.robots.shape[0]):
        robot, rows, task = observations.robots[i], observations.robot_operators[i], decisions.task[i]
        freshest = np.inf
        for h in range(rows.shape[0]):
            freshest = min(freshest, rows[h].age if rows[h].age >= 0.0 else np.inf)
        aim = task if task >= 0 else robot.task
        wants = (
            when == 0
            or when == 1 and task >= 0
            or when == 2 and robot.activity != SERVICING
            or when == 3 and robot.activity != SERVICING and aim != NOBODY
            and observations.robot_tasks[i, aim].distance / robot.speed >= FAR
            or when == 4 and aim != NOBODY and observations.robot_tasks[i, aim].difficulty > HARD
        )  # fmt: skip
        if wants and freshest >= clock and not decisions.assist[i]:
            decisions.query[i] = longest_unheard(rows)


def asking(when: int, clock: float):
    """Greedy that asks by a rule."""

    class Asking(Greedy):
        def __call__(self, observations):
            decisions = super().__call__(observations)
            ask(observations, decisions, when, float(clock))
            return decisions

    return lambda batch: Asking(batch, asks=False)


def main(names, n_missions, links):
    seeds = range(CALIBRATION, CALIBRATION + n_missions)
    print("| scenario | limitation | a robot asks | unless a report is fresher than | minus greedy+no-query |")
    print("|---|---|---|---|---|")
    for name in names:
        for limitation in ("nominal", "high"):
            score = lambda policy: np.array([s.twcr for s in fly(SCENARIOS[name], policy, seeds, links, limitation)])  # noqa: B023
            without = score("greedy+no-query")
            for when, clock in RULES:
                policies.POLICIES["asking"] = policies.PolicyInfo(asking(when, clock))
                gain = mean_interval(score("asking") - without)
                print(f"| {name} | {limitation} | {WHEN[when]} | {clock} s | {gain} |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", nargs="+", default=list(SCENARIOS))
    parser.add_argument("--missions", type=int, default=100)
    parser.add_argument("--links", default="raycast")
    given = parser.parse_args()
    main(given.scenario, given.missions, given.links)
