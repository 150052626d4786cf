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
    fly_missions(
        batch.state.missions, batch.rules, plan, new_desk(scenario), new_memory(1, scenario),
        new_observations(1, scenario), new_masks(1, scenario), new_decisions(scenario),
    )  # fmt: skip


@kernel
def fly_missions(missions, rules, plan, desk, memory, seen, masks, decisions):
    """One mission after the other; `seen`, `masks` and `decisions` have room for everybody in one."""
    for e in range(missions.shape[0]):
        one = missions[e : e + 1]
        while not one[0].over:
            due, open_to, chosen = await_due(one, seen, masks, decisions)
            decide(rules, plan, desk, memory, due, chosen)
            apply_decisions(one, open_to, chosen)


def new_decisions(scenario) -> Decisions:
    """Room for everybody's in one mission."""
    n, k = scenario.n_robots, scenario.n_operators
    return Decisions(
        np.zeros(n, np.int32), np.zeros(n, bool), np.full(n, NOBODY, np.int32), np.zeros(n, bool), np.zeros(k, np.int32)
    )


@kernel
def await_due(one, seen, masks, decisions):
    """Advance one mission until somebody is due; (observations, masks, room for the decisions) of all who are."""
    i, k = advance_and_observe(one, np.zeros(1, np.int64), 1.0, np.zeros((1, 2)), seen, masks)
    due = Observations(
        seen.robots[:i], seen.robot_tasks[:i], seen.robot_peers[:i], seen.robot_operators[:i],
        seen.operators[:k], seen.operator_reports[:k],
    )  # fmt: skip
    open_to = Masks(masks.robots[:i], masks.tasks[:i], masks.queries[:i], masks.operators[:k], masks.supervised[:k])
    chosen = Decisions(
        decisions.task[:i], decisions.broadcast[:i], decisions.query[:i], decisions.assist[:i], decisions.operator[:k]
    )
    return due, open_to, chosen
