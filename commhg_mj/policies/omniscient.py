"""Omniscient: a privileged upper reference, not a policy that a team could fly.

It reads the true state, communicates for free (link model "perfect"), assigns tasks optimally every
second and places control where it gains most.
"""

import dataclasses

import numpy as np
from scipy.optimize import linear_sum_assignment

from ..base.arguments import instance
from ..base.elementary_functions import distance
from ..base.kernels import kernel
from ..base.terms import IDLE, NOBODY, REST, Activity, Embodiment, Mode
from ..mission.accessors import routes_of, scratch_of, true_operator, true_robot, true_task
from ..mission.batch import MissionBatch, stay
from ..mission.decide import Decisions
from ..mission.estimate import control_gain, expected_seconds, expected_wait, regret
from ..mission.observe import Observations
from ..mission.records import DONE, is_compatible
from ..mission.service import (
    autonomous_seconds,
    autonomous_success,
    controlled_seconds,
    controlled_success,
)
from ..models.routes import measure_goals
from ..scenarios import Scenario

UGV, CONTROLLED = int(Embodiment.UGV), int(Mode.CONTROLLED)
FAILED, SERVICING = int(Activity.FAILED), int(Activity.SERVICING)
LOYALTY = 1.1  # a robot's present target counts this many times: assignments do not flicker
HOLD = 2.0  # likewise the robot that an operator holds when its task is done: handovers cost time


class Omniscient:
    """Callable policy; reads `batch.state`. Its batch needs `links="perfect"` and `every_second(scenario)`."""

    def __init__(self, batch: MissionBatch):
        instance("batch", batch, MissionBatch)
        self.batch = batch
        self.tasks = np.zeros((len(batch.seeds), batch.scenario.n_robots, batch.scenario.n_tasks))
        self.gains = np.zeros((len(batch.seeds), batch.scenario.n_operators, batch.scenario.n_robots))

    def __call__(self, observations: Observations) -> Decisions:
        decisions = stay(observations)
        missions = self.batch.state.missions
        rate_tasks(missions, self.tasks)
        targets = np.array([_assign(worth) for worth in self.tasks])
        rate_control(missions, targets, self.gains)
        supervised = [_assign(gains) for gains in self.gains]
        for i, robot in enumerate(observations.robots):
            target = targets[robot["mission"], robot["robot"]]
            if robot["can_idle"] and (target == NOBODY or observations.robot_tasks[i, target]["legal"]):
                decisions.task[i] = IDLE if target == NOBODY else target
        for i, operator in enumerate(observations.operators):
            target = supervised[operator["mission"]][operator["operator"]]
            if target == NOBODY:
                decisions.operator[i] = REST
            elif target != operator["robot"] and observations.operator_reports[i, target]["legal"]:
                decisions.operator[i] = target
        return decisions


def every_second(scenario) -> Scenario:
    """The same scenario with a decision and a report of everybody every second."""
    return dataclasses.replace(
        scenario,
        decisions=dataclasses.replace(scenario.decisions, robot_period=1, operator_period=1),
        communication=dataclasses.replace(scenario.communication, telemetry_period=1.0),
    )


def _assign(worth) -> np.ndarray:
    """Optimal assignment of rows to columns of positive worth; NOBODY where a row gets none."""
    choice = np.full(len(worth), NOBODY)
    rows, columns = linear_sum_assignment(worth, maximize=True)
    good = worth[rows, columns] > 0
    choice[rows[good]] = columns[good]
    return choice


@kernel
def rate_tasks(missions, worth):
    """Fill [E, R, T] with the true utility of every open task to every robot; 0 where there is none."""
    for e in range(missions.shape[0]):
        m = missions[e]
        backlog = team_wait(m)
        for r in range(m.n_robots):
            robot = true_robot(m, r)
            worth[e, r, :] = 0.0
            if m.over or robot.activity == FAILED:
                continue
            if robot.activity == SERVICING:
                worth[e, r, robot.task] = 1e3  # a service under way is finished
                continue
            rate_robot(m, robot, backlog, worth[e, r])


@kernel
def team_wait(m):
    """Seconds until the team would come round to a task that it leaves now."""
    robots, tasks = 0, 0
    for r in range(m.n_robots):
        robots += true_robot(m, r).activity != FAILED
    for j in range(m.n_tasks):
        tasks += true_task(m, j).released and true_task(m, j).status != DONE
    return expected_wait(m.rules, tasks, max(1, robots))


@kernel
def rate_robot(m, robot, backlog, worth):
    """Utilities of the open tasks to one robot on its way or idle."""
    scratch = scratch_of(m)
    wanted, lengths = scratch.found[m.n_corners :], scratch.distance[m.n_corners :]
    count = 0
    for j in range(m.n_tasks):
        task = true_task(m, j)
        if task.released and task.status != DONE and is_compatible(robot.embodiment, task.type):
            wanted[count] = j
            lengths[count] = distance(task.x - robot.x, task.y - robot.y)
            count += 1
    if robot.embodiment == UGV:
        measure_goals(routes_of(m), robot.x, robot.y, wanted, count, lengths, scratch)
    speed = m.rules.speed[1 if robot.mode == CONTROLLED else 0, robot.embodiment]
    for k in range(count):
        j = wanted[k]
        task = true_task(m, j)
        worth[j] = regret(m.rules, task, task_seconds(m, robot, task, lengths[k] / speed), m.now, backlog)
        if j == robot.task:
            worth[j] *= LOYALTY


@kernel
def task_seconds(m, robot, task, travel):
    """Expected seconds until a task is done, by the operator who holds the robot now, if one does."""
    rules = m.rules
    if robot.controller != NOBODY:
        operator = true_operator(m, robot.controller)
        success = controlled_success(rules, task.difficulty, operator.fatigue)
        service = controlled_seconds(rules, operator, robot.embodiment, task.difficulty)
    else:
        success, service = autonomous_success(rules, task.difficulty), autonomous_seconds(rules, task.difficulty)
    return expected_seconds(travel, service, success)


@kernel
def rate_control(missions, targets, gains):
    """Fill [E, H, R] with what control by each operator would add to each robot's target [E, R].

    A session goes on until the robot's task is done: a change in between would cost another handover.
    """
    for e in range(missions.shape[0]):
        m = missions[e]
        for h in range(m.n_operators):
            operator = true_operator(m, h)
            for r in range(m.n_robots):
                robot, j = true_robot(m, r), targets[e, r]
                gains[e, h, r] = 0.0
                if m.over or robot.activity == FAILED or j == NOBODY:
                    continue
                task = true_task(m, j)
                gains[e, h, r] = control_gain(
                    m.rules, operator.proficiency[robot.embodiment], operator.fatigue, robot.embodiment,
                    distance(task.x - robot.x, task.y - robot.y), task.progress, task.difficulty, task.value,
                    task.deadline, task.decay, m.now,
                )  # fmt: skip
                if operator.robot == r:
                    gains[e, h, r] = HOLD * max(gains[e, h, r], 1e-9) if operator.exempt else 1e3
