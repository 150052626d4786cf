"""Random: a uniform choice among everything that the masks leave open."""

import numpy as np

from ..base.arguments import instance
from ..base.kernels import kernel
from ..base.terms import IDLE, KEEP, NOBODY, REST
from ..mission.batch import MissionBatch, stay
from ..mission.decide import Decisions
from ..mission.observe import Observations
from ..mission.randomness import uniform

POLICY = 64  # random events of policies; indices: actor, component of its decision
TASK, SPEAK, ASK, ASSIST = 0, 1, 2, 3


class Random:
    """Callable policy; its draws depend on the missions' seeds and the time alone."""

    def __init__(self, batch: MissionBatch):
        instance("batch", batch, MissionBatch)
        self.seeds = np.array(batch.seeds, np.uint64)

    def __call__(self, observations: Observations) -> Decisions:
        decisions = stay(observations)
        draw_robots(self.seeds, observations, decisions)
        draw_operators(self.seeds, observations, decisions)
        return decisions


@kernel
def pick(draw, legal, first, second):
    """The choice that `draw` in [0, 1) selects among two optional extras (NOBODY: none) and legal rows."""
    count = (first != 0) + (second != 0)
    for j in range(legal.shape[0]):
        count += legal[j] != 0
    k = int(draw * count)
    for extra in (first, second):
        if extra != 0:
            if k == 0:
                return extra
            k -= 1
    for j in range(legal.shape[0]):
        if legal[j] != 0:
            if k == 0:
                return j
            k -= 1
    return 0


@kernel
def draw_robots(seeds, observations, decisions):
    """Uniform over tasks with KEEP and IDLE, over the gate, over operators with none, over assistance."""
    for i in range(observations.robots.shape[0]):
        robot = observations.robots[i]
        seed, now, r = seeds[robot.mission], int(robot.time), robot.robot
        keep, idle = KEEP if robot.can_keep else 0, IDLE if robot.can_idle else 0
        draw = uniform(seed, POLICY, now, r, TASK)
        decisions.task[i] = pick(draw, observations.robot_tasks[i].legal, keep, idle)
        decisions.broadcast[i] = robot.can_broadcast and uniform(seed, POLICY, now, r, SPEAK) < 0.5
        draw = uniform(seed, POLICY, now, r, ASK)
        decisions.query[i] = pick(draw, observations.robot_operators[i].legal, NOBODY, 0)
        asks = decisions.query[i] == NOBODY and robot.can_assist
        decisions.assist[i] = asks and uniform(seed, POLICY, now, r, ASSIST) < 0.5


@kernel
def draw_operators(seeds, observations, decisions):
    """Uniform over robots with KEEP and REST."""
    n_robots = observations.operator_reports.shape[1]
    for i in range(observations.operators.shape[0]):
        operator = observations.operators[i]
        draw = uniform(seeds[operator.mission], POLICY, int(operator.time), n_robots + operator.operator, TASK)
        keep = KEEP if operator.can_keep else 0
        decisions.operator[i] = pick(draw, observations.operator_reports[i].legal, keep, REST)
