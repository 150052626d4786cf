"""What a choice would be worth: missions flown on from one true state, once for each alternative, with the same luck for all.

A multiagent rollout (Bertsekas 2020): whoever else decides, and the chooser afterwards, follows the planner. It reads the true
state and is for learning alone; the luck is new, never the mission's own.
"""

from typing import NamedTuple

import numpy as np

from ..base.kernels import kernel
from ..base.terms import KEEP, REST
from ..mission.batch import MissionBatch
from ..mission.decide import apply_decisions, new_masks
from ..mission.observe import new_observations
from ..mission.recorder import Log, new_log
from ..mission.score import twcr
from ..mission.state import State, new_state, wire
from .assignment import reduced_cost
from .planner import WHOLE, Memory, assign_team, choose, new_desk, new_memory, own_part, talk
from .whole_missions import await_due, new_decisions

ROBOT, OPERATOR = 0, 1  # roles
OF_STATE = [f"{name}_at" for name in State._fields if name != "missions"] + [f"log_{name}_at" for name in Log._fields]
REST_SECONDS = 20.0  # that a tried REST lasts: one second of it would change nothing


class Outcomes(NamedTuple):
    """How flights from one state ended, [choices, seeds]."""

    twcr: np.ndarray  # at the end
    reward: np.ndarray  # from the state on
    luck: np.ndarray  # [choices, seeds, len(LUCK)] likewise (mission/service.py: count_luck)


class Tried(NamedTuple):
    """One alternative: an actor's choice, which it holds while it can."""

    role: int
    actor: int
    choice: int  # of a robot: a task or IDLE; of an operator: KEEP, REST or a robot
    begins: int  # s


class Alternatives:
    """Room to fly on from any state of a batch of missions by the planner.

    Args:
      n: missions that fly on from one state, at most.
    """

    def __init__(self, batch: MissionBatch, n: int):
        scenario = batch.scenario
        self.batch = batch
        self.state, self.log = new_state(n, scenario), new_log(n, scenario, False)
        for k in range(n):
            wire(self.state, self.log, k, batch.grounds[0])
        self.addresses = self.state.missions[OF_STATE].copy()
        self.memory, self.desk = new_memory(n, scenario), new_desk(scenario)
        self.seen, self.masks = new_observations(1, scenario), new_masks(1, scenario)
        self.decisions = new_decisions(scenario)

    def judge(self, e: int, memory: Memory, role: int, actor: int, choices, seeds) -> Outcomes:
        """Outcomes of the due actor's alternatives in mission e of the batch.

        Args:
          memory: the planner's, as it was before this second's decisions.
          seeds: one a repetition; they decide packet fates, services and failures from now on.
        """
        n_choices, n_seeds = len(choices), len(seeds)
        n = n_choices * n_seeds
        for mine, theirs in ((self.state, self.batch.state), (self.memory, memory)):
            for copies, original in zip(mine, theirs):
                copies[:n] = original[e]
        missions = self.state.missions[:n]
        missions[OF_STATE] = self.addresses[:n]  # the world's stay the original's
        missions["seed"] = np.tile(np.asarray(seeds, np.uint64), n_choices)
        before, luck = missions["reward"].sum(axis=1), missions["luck"].copy()
        fly_all_on(
            missions, self.batch.rules, self.desk, self.memory, self.seen, self.masks, self.decisions, role, actor,
            np.repeat(np.asarray(choices, np.int64), n_seeds),
        )  # fmt: skip
        tasks = self.state.tasks[:n]
        timely = [twcr(row["value"], row["deadline"], row["decay"], row["done_at"]) for row in tasks]
        shape = n_choices, n_seeds
        reward, luck = missions["reward"].sum(axis=1) - before, missions["luck"] - luck
        return Outcomes(np.reshape(timely, shape), reward.reshape(shape), luck.reshape(*shape, -1))


@kernel
def fly_all_on(missions, rules, desk, memory, seen, masks, decisions, role, actor, choices):
    """Fly each mission on with one choice of the same actor."""
    for k in range(missions.shape[0]):
        own = Memory(memory.told[k : k + 1], memory.taken[k : k + 1], memory.asked[k : k + 1])
        tried = Tried(role, actor, choices[k], missions[k].now)
        fly_on(missions[k : k + 1], rules, desk, own, seen, masks, decisions, tried)


@kernel
def fly_on(one, rules, desk, memory, seen, masks, decisions, tried):
    """Fly one mission to its end by the planner, but for what is tried."""
    is_held = True
    while not one[0].over:
        due, open_to, chosen = await_due(one, seen, masks, decisions)
        choose(rules, WHOLE, desk, memory, due, chosen)
        if is_held:
            is_held = hold(tried, due, chosen, one[0].now == tried.begins)
        talk(WHOLE, memory, due, chosen)
        apply_decisions(one, open_to, chosen)


@kernel
def hold(tried, due, chosen, is_first):
    """Put what is tried in the place of the planner's choice, where its actor is due; whether it goes on being held."""
    if tried.role == ROBOT:
        for i in range(due.robots.shape[0]):
            robot = due.robots[i]
            if robot.robot == tried.actor:
                if is_first:
                    chosen.task[i] = KEEP if tried.choice == robot.task else tried.choice
                elif robot.can_keep and robot.task == tried.choice:
                    chosen.task[i] = KEEP
                else:
                    return False
    else:
        for k in range(due.operators.shape[0]):
            operator = due.operators[k]
            if operator.operator == tried.actor:
                if is_first:
                    chosen.operator[k] = tried.choice
                elif tried.choice == REST and operator.time < tried.begins + REST_SECONDS:
                    chosen.operator[k] = REST
                else:
                    return False
    return True


@kernel
def list_candidates(rules, desk, memory, seen, i, found):
    """Fill in what robot row i may choose, the planner's pick first; returns how many."""
    robot, tasks = seen.robots[i], seen.robot_tasks[i]
    n_open, _ = assign_team(rules[0], WHOLE, desk, memory.taken[robot.mission, robot.robot], seen, i)
    return rank_candidates(desk, robot, tasks, n_open, found)


@kernel
def rank_candidates(desk, robot, tasks, n_open, found):
    """Fill in the robot's part of the assignment on the desk, then its other tasks by what the team would lose; how many."""
    found[0], costs, n, a = own_part(desk), np.zeros(n_open + 1), 1, desk.assignment
    for column in range(n_open):
        j = desk.tasks[column]
        if j == found[0] or not (tasks[j].legal or (j == robot.task and robot.can_keep)):
            continue
        cost, place = reduced_cost(a, 1, column + 1), n
        while place > 1 and costs[place - 1] > cost:
            found[place], costs[place] = found[place - 1], costs[place - 1]
            place -= 1
        found[place], costs[place], n = j, cost, n + 1
    return n
