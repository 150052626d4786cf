"""First targets of methods that allocate them: robot after robot in the order of their numbers, none twice.

Every robot knows the roster, the tasks and the draw (`noise.Draws`), so that each can work out the picks before its own.
"""

import dataclasses

import numpy as np
from scipy.optimize import linear_sum_assignment

from ..base.terms import IDLE
from ..scenarios import Scenario
from .features import ROBOT, TASK_EDGE
from .graphs import RobotGraphs

TIME, VALUE_RATE = ROBOT.index("time"), TASK_EDGE.index("value_rate")


def without_initializer(scenario: Scenario) -> Scenario:
    """The scenario in which robots choose their first targets themselves (docs/benchmark.md, section 8)."""
    return dataclasses.replace(scenario, decisions=dataclasses.replace(scenario.decisions, first_targets="policy"))


def flown_in(method, scenario: Scenario) -> Scenario:
    """What a method flies in when a scenario is asked for."""
    return without_initializer(scenario) if method.picks_first else scenario


def beginners(graphs: RobotGraphs) -> np.ndarray:
    """[n] rows of robots whose mission begins and who have no first target."""
    return np.flatnonzero((graphs.itself[:, TIME] == 0.0) & ~graphs.keep_idle[:, 0])


def take_turns(graphs: RobotGraphs, score: np.ndarray) -> tuple[RobotGraphs, np.ndarray]:
    """(graphs with what was open to beginners in their turn, their picks: [n] edges, or IDLE where nothing is left).

    Args:
      score: [E] of edges; each robot takes its highest that is open.
    """
    rows, taken = beginners(graphs), set()
    legal, keep_idle, picks = graphs.task_legal.copy(), graphs.keep_idle.copy(), np.full(len(rows), IDLE)
    for i, row in enumerate(rows):
        edges = np.arange(graphs.task_ptr[row], graphs.task_ptr[row + 1])
        legal[edges] &= [(graphs.mission[row], task) not in taken for task in graphs.task[edges]]
        is_open = legal[edges]
        keep_idle[row] = False, not is_open.any()
        if is_open.any():
            picks[i] = edges[np.where(is_open, score[edges], -np.inf).argmax()]
            taken.add((graphs.mission[row], graphs.task[picks[i]]))
    return graphs._replace(task_legal=legal, keep_idle=keep_idle), picks


def assign(graphs: RobotGraphs) -> np.ndarray:
    """[E] scores of edges: 1 for those of an optimal assignment of tasks to beginners, as the initializer's, else 0."""
    score, rows = np.zeros(len(graphs.task)), beginners(graphs)
    for mission in np.unique(graphs.mission[rows]):
        mine = rows[graphs.mission[rows] == mission]
        worth, edge_of = np.zeros((len(mine), graphs.task.max(initial=0) + 1)), {}
        for i, row in enumerate(mine):
            for edge in np.flatnonzero(graphs.task_legal[graphs.task_ptr[row] : graphs.task_ptr[row + 1]]) + graphs.task_ptr[row]:
                worth[i, graphs.task[edge]], edge_of[i, graphs.task[edge]] = graphs.task_edge[edge, VALUE_RATE], edge
        score[[edge_of[pair] for pair in zip(*linear_sum_assignment(worth, maximize=True)) if pair in edge_of]] = 1.0
    return score
