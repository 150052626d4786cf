"""Whole missions by the planner inside one kernel: the same bits as step by step, with no Python in between."""

import numpy as np

from ..base.arguments import instance
from ..base.kernels import kernel
from ..base.terms import NOBODY
from ..mission.batch import MissionBatch, advance_and_observe
from ..mission.decide import Decisions, Masks, apply_decisions, new_masks
from ..mission.observe import Observations, new_observations
from .planner import WHOLE, Plan, decide, new_desk, new_memory


def fly_whole(batch: MissionBatch, plan: Plan = WHOLE) -> None:
    """Fly every mission of the batch from its start to its end by the planner; `batch.scores()` has how they went."""
    instance("batch", batch, MissionBatch)
    instance("plan", plan, Plan)
    batch.reset()
    scenario = batch.scenario
    n, k = scenario.n_robots, scenario.n_operators
    decisions = Decisions(
        np.zeros(n, np.int32), np.zeros(n, bool), np.full(n, NOBODY, np.int32), np.zeros(n, bool), np.zeros(k, np.int32)
    )
    fly_missions(
        batch.state.missions, batch.rules, plan, new_desk(scenario), new_memory(1, scenario),
        new_observations(1, scenario), new_masks(1, scenario), decisions,
    )  # fmt: skip


@kernel
def fly_missions(missions, rules, plan, desk, memory, seen, masks, decisions):
    """One mission after the other; `seen`, `masks` and `decisions` have room for everybody in one."""
    at_once, earned = np.zeros(1, np.int64), np.zeros((1, 2))
    for e in range(missions.shape[0]):
        one = missions[e : e + 1]
        while not one[0].over:
            i, k = advance_and_observe(one, at_once, 1.0, earned, seen, masks)
            due = first_rows(seen, i, k)
            chosen = Decisions(
                decisions.task[:i], decisions.broadcast[:i], decisions.query[:i], decisions.assist[:i], decisions.operator[:k]
            )
            decide(rules, plan, desk, memory, due, chosen)
            apply_decisions(one, first_masks(masks, i, k), chosen)


@kernel
def first_rows(seen, i, k):
    """Observations of the i robots and k operators that are due."""
    return Observations(
        seen.robots[:i], seen.robot_tasks[:i], seen.robot_peers[:i], seen.robot_operators[:i],
        seen.operators[:k], seen.operator_reports[:k],
    )  # fmt: skip


@kernel
def first_masks(masks, i, k):
    """Their masks."""
    return Masks(masks.robots[:i], masks.tasks[:i], masks.queries[:i], masks.operators[:k], masks.supervised[:k])
