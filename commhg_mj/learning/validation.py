"""How well a method in training flies missions that it never trains on, beside Greedy on the same ones."""

from functools import cached_property

import numpy as np

from ..mission.batch import MissionBatch
from ..policies import POLICIES
from .first_targets import flown_in
from .learned_policy import LearnedPolicy

FIRST, N_MISSIONS = 50_000, 20  # seeds; neither training nor evaluation flies them


class Validation:
    """Fixed missions of one scenario under the training's conditions; nothing of the training depends on them."""

    def __init__(self, scenario, links, limitation):
        self.scenario, self.conditions = scenario, (range(FIRST, FIRST + N_MISSIONS), links, limitation)

    @cached_property
    def greedy(self) -> float:
        """Greedy's mean TWCR."""
        return self._fly(self.scenario, POLICIES["greedy"].make)

    def score(self, method) -> float:
        """The method's mean TWCR."""
        return self._fly(flown_in(method, self.scenario), lambda batch: LearnedPolicy(method, batch))

    def _fly(self, scenario, make):
        batch = MissionBatch(scenario, *self.conditions)
        policy, seen = make(batch), batch.observations
        while not batch.over.all():
            seen = batch.step(policy(seen))
        return float(np.mean([score.twcr for score in batch.scores()]))
