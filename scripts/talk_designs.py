"""Which moments to ask and to broadcast in pay: factorial designs on whole missions by the planner (docs/planner.md).

python scripts/talk_designs.py --scenario medium --limitation high --missions 250 --designs 16

Moments are sorted into kinds. In every mission of a design a random 30 % of the kinds are flipped: there a robot asks (none asks
otherwise), or there it broadcasts where the planner is silent, and is silent where the planner broadcasts. Printed is what each
kind adds to the TWCR of a mission, in thousandths: the least-squares effects of all designs, paired with the same missions
without flips, their standard errors, and how often a mission has such moments.
"""

import argparse

import numpy as np

from commhg_mj.base.kernels import kernel
from commhg_mj.base.terms import KEEP, NOBODY, Activity
from commhg_mj.flights.held_out import CALIBRATION
from commhg_mj.mission.batch import MissionBatch
from commhg_mj.mission.decide import apply_decisions, new_masks
from commhg_mj.mission.observe import new_observations
from commhg_mj.policies.planner import WHOLE, choose, new_desk, new_memory, own_plan, talk
from commhg_mj.policies.schedule import longest_unheard
from commhg_mj.policies.whole_missions import await_due, new_decisions

SERVICING = int(Activity.SERVICING)
WAYS = 15.0, 25.0, 50.0, 90.0  # s to the task
SINCE = 5.0, 20.0, 40.0, 60.0  # s since a broadcast
OLD, RICH = 60.0, 320.0  # s of evidence; bytes of the broadcast bucket
FLIPPED = 0.3  # share of kinds
ASKING = ["standing", "without a task", "in service"] + [
    f"{task} task, {way}, {news}"
    for task in ("kept", "new")
    for way in ("< 15 s", "< 25 s", "< 50 s", "< 90 s", "farther")
    for news in ("fresh evidence", "no evidence", "old evidence")
]
SPEAKING = [
    f"{plan}, {since} since the last, {tokens}"
    for plan in ("new plan", "same plan in service", "same plan elsewhere")
    for since in ("< 5 s", "< 20 s", "< 40 s", "< 60 s", "longer")
    for tokens in ("half the bucket", "less")
]


@kernel
def bin_of(value, edges):
    """How many edges a value has reached."""
    n = 0
    for edge in edges:
        n += value >= edge
    return n


@kernel
def kind_of_asking(seen, decisions, i):
    """Row of ASKING of robot row i."""
    robot, choice = seen.robots[i], decisions.task[i]
    j = own_plan(robot, choice)
    if robot.stand_left > 0.0:
        return 0
    if j < 0:
        return 1
    if robot.activity == SERVICING and choice == KEEP:
        return 2
    task = seen.robot_tasks[i, j]
    news = 1 if task.age < 0.0 else 2 if task.age > OLD else 0
    return 3 + (5 * (choice >= 0) + bin_of(task.distance / robot.speed, WAYS)) * 3 + news


@kernel
def kind_of_speaking(robot, plan, told):
    """Row of SPEAKING."""
    what = 0 if plan != told else 1 if robot.activity == SERVICING else 2
    return (5 * what + bin_of(robot.since_broadcast, SINCE)) * 2 + (robot.broadcast_tokens < RICH)


@kernel
def fly(missions, rules, plan, room, memory, of_asking, flips, counts):
    """Missions by the planner, each with its flips [E, kinds] of moments to ask or to speak in."""
    desk, seen, masks, decisions = room
    for e in range(missions.shape[0]):
        one = missions[e : e + 1]
        while not one[0].over:
            due, open_to, chosen = await_due(one, seen, masks, decisions)
            choose(rules, plan, desk, memory, due, chosen)
            told = memory.told[0].copy()
            talk(plan, memory, due, chosen)
            for i in range(due.robots.shape[0]):
                robot = due.robots[i]
                r, task, before = robot.robot, own_plan(robot, chosen.task[i]), told[robot.robot]
                if of_asking:
                    who, kind = longest_unheard(due.robot_operators[i]), kind_of_asking(due, chosen, i)
                    counts[kind] += who != NOBODY
                    chosen.query[i] = who if flips[e, kind] else NOBODY
                    chosen.assist[i] = chosen.assist[i] and chosen.query[i] == NOBODY
                elif robot.can_broadcast:
                    kind = kind_of_speaking(robot, task, before)
                    counts[kind] += 1
                    chosen.broadcast[i] = chosen.broadcast[i] != flips[e, kind]
                    memory.told[0, r] = task if chosen.broadcast[i] else before
            apply_decisions(one, open_to, chosen)


def effects(batch, of_asking: bool, n_designs: int, rng):
    """(effects, their standard errors, moments a mission) of all kinds."""
    scenario, n = batch.scenario, len(batch.seeds)
    room = new_desk(scenario), new_observations(1, scenario), new_masks(1, scenario), new_decisions(scenario)
    n_kinds, plan = len(ASKING if of_asking else SPEAKING), WHOLE._replace(asks=not of_asking)

    def flown(flips):
        counts = np.zeros(n_kinds)
        batch.reset()
        fly(batch.state.missions, batch.rules, plan, room, new_memory(1, scenario), of_asking, flips, counts)
        return np.array([score.twcr for score in batch.scores()]), counts / n

    before, _ = flown(np.zeros((n, n_kinds), bool))
    flips = [rng.random((n, n_kinds)) < FLIPPED for _ in range(n_designs)]
    ends, counts = zip(*(flown(flip) for flip in flips))
    x, y = np.concatenate(flips).astype(float), np.concatenate([end - before for end in ends])
    inner = np.linalg.inv(x.T @ x + 1e-9 * np.eye(n_kinds))
    effect = inner @ (x.T @ y)
    return effect, np.sqrt(np.mean((y - x @ effect) ** 2) * np.diag(inner)), np.mean(counts, axis=0)


def main(given):
    seeds = range(CALIBRATION, CALIBRATION + given.missions)
    batch = MissionBatch(given.scenario, seeds, given.links, given.limitation)
    for title, kinds in (("asks", ASKING), ("broadcasts where the planner does not, or the reverse", SPEAKING)):
        effect, error, count = effects(batch, kinds is ASKING, given.designs, np.random.default_rng(0))
        print(f"| a robot {title} | adds, thousandths | a mission |\n|---|---|---|")
        for k in np.argsort(-effect):
            print(f"| {kinds[k]} | {1e3 * effect[k]:.1f} ± {1e3 * error[k]:.1f} | {count[k]:.1f} |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", default="medium")
    parser.add_argument("--limitation", default="high")
    parser.add_argument("--links", default="raycast")
    parser.add_argument("--missions", type=int, default=250)
    parser.add_argument("--designs", type=int, default=16)
    main(parser.parse_args())
