"""Helpers of the task interfaces' tests: short missions, open actions, and what tables and actions mean, said in Python."""

import numpy as np
from strategies import change

from commhg_mj.base.terms import IDLE, KEEP, NOBODY, REST
from commhg_mj.mission.batch import stay
from commhg_mj.scenarios import SCENARIOS
from commhg_mj.tasks.choices import PER_ROBOT, Choices
from commhg_mj.tasks.columns import COLUMNS
from commhg_mj.tasks.tables import new_tables

BRIEF = change(SCENARIOS["small"], time_limit=60)
BRITTLE = change(BRIEF, malfunction=0.999, time_limit=120)  # robots fail one after the other
LONELY = change(BRIEF, n_operators=0, n_uav=0, n_ugv=1)  # a team of one robot


class Dice:
    """Random actions of a whole team [choices], among what a flat mask leaves open; `stays` is the share of 0s."""

    def __init__(self, scenario, seed=0, stays=0.5):
        self.choices, self.rng, self.stays = Choices(scenario), np.random.default_rng(seed), stays

    def open(self, mask):
        """Of one mission, or of some [E, numbers]."""
        if mask.ndim == 2:
            return np.stack([self.open(row) for row in mask])
        noise = self.rng.random(mask.shape) * (mask != 0)
        action = np.array([part.argmax() for part in self.choices.split(noise)])
        kept = (self.rng.random(action.shape) < self.stays) & (mask[self.choices.starts] != 0)
        return np.where(kept, 0, action)

    def any(self, missions=()):
        """Whatever the mask says."""
        return self.rng.integers(0, self.choices.sizes, (*missions, len(self.choices.sizes)))


def decisions_of(seen, actions):
    """The decisions that actions [E, choices] mean for the rows of `seen`: what is masked counts as staying."""
    decisions = stay(seen)
    n_robots, n_operators = seen.robot_peers.shape[1], seen.robot_operators.shape[1]
    for i, row in enumerate(seen.robots):
        first = PER_ROBOT * row["robot"]
        task, broadcast, message = actions[row["mission"]][first : first + PER_ROBOT]
        if task == 1 and row["can_idle"]:
            decisions.task[i] = IDLE
        if task >= 2 and seen.robot_tasks[i, task - 2]["legal"]:
            decisions.task[i] = task - 2
        decisions.broadcast[i] = broadcast == 1 and row["can_broadcast"]
        if 1 <= message <= n_operators and seen.robot_operators[i, message - 1]["legal"]:
            decisions.query[i] = message - 1
        decisions.assist[i] = message == n_operators + 1 and row["can_assist"]
    for i, row in enumerate(seen.operators):
        choice = actions[row["mission"]][PER_ROBOT * n_robots + row["operator"]]
        if choice == 1:
            decisions.operator[i] = REST
        if choice >= 2 and seen.operator_reports[i, choice - 2]["legal"]:
            decisions.operator[i] = choice - 2
    assert {KEEP, NOBODY} == {-1}, "what `stay` filled in"
    return decisions


class Ledger:
    """Padded tables, masks and who is due, written row by row from structured observations."""

    def __init__(self, n_missions, scenario):
        self.scenario, self.choices = scenario, Choices(scenario)
        self.tables = new_tables(n_missions, scenario)
        self.n_missions, self.n_actors = n_missions, scenario.n_robots + scenario.n_operators

    def note(self, seen):
        """Write the rows of all who are due; the others' tables stay, and their masks close."""
        self.due = np.zeros((self.n_missions, self.n_actors), bool)
        self.mask = np.zeros((self.n_missions, self.choices.n_numbers), bool)
        self.mask[:, self.choices.starts] = True
        for i, row in enumerate(seen.robots):
            e, r = row["mission"], row["robot"]
            self.due[e, r] = True
            for table in ("robots", "robot_tasks", "robot_peers", "robot_operators"):
                getattr(self.tables, table)[e, r] = _columns(table, getattr(seen, table)[i])
            task, broadcast, message = self.choices.split(self.mask[e])[PER_ROBOT * r : PER_ROBOT * (r + 1)]
            task[:] = [row["can_keep"], row["can_idle"], *seen.robot_tasks[i]["legal"]]
            broadcast[:] = [True, row["can_broadcast"]]
            message[:] = [True, *seen.robot_operators[i]["legal"], row["can_assist"]]
        for i, row in enumerate(seen.operators):
            e, h = row["mission"], row["operator"]
            self.due[e, self.scenario.n_robots + h] = True
            for table in ("operators", "operator_reports"):
                getattr(self.tables, table)[e, h] = _columns(table, getattr(seen, table)[i])
            self.choices.split(self.mask[e])[PER_ROBOT * self.scenario.n_robots + h][:] = [
                row["can_keep"],
                True,
                *seen.operator_reports[i]["legal"],
            ]
        return self


def _columns(table, records):
    """Records [...] as [..., columns]."""
    splits = {"proficiency_uav": ("proficiency", 0), "proficiency_ugv": ("proficiency", 1)}
    columns = [records[splits[c][0]][..., splits[c][1]] if c in splits else records[c] for c in COLUMNS[table]]
    return np.stack([np.asarray(column, np.float32) for column in columns], axis=-1)


def open_everywhere(mask, actions, scenario):
    """Whether each choice of actions [..., choices] is open in masks [..., numbers]: [..., choices] bool."""
    return np.take_along_axis(np.asarray(mask), Choices(scenario).starts + actions, axis=-1) != 0
