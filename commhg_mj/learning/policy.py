"""A learned method as a policy: `policy(observations) -> decisions`, as every other."""

import numpy as np

from ..mission.batch import MissionBatch
from .draws import Draws
from .graphs import GraphBuilder
from .rollout import Pilot


class LearnedPolicy:
    """Decides by a method's actors for one batch of missions, each as if it flew alone; the critic is not used.

    Args:
      is_greedy: take the best choice instead of drawing one.
    """

    def __init__(self, method, batch: MissionBatch, is_greedy=False):
        self.builder = GraphBuilder(batch)
        self.pilot, self.is_greedy = Pilot(method, self.builder), is_greedy
        self.public = self.builder.public(batch.state.tasks)
        self.seeds = np.array(batch.seeds, np.uint64)

    def __call__(self, observations):
        return self.pilot.decide(observations, self.public, Draws(self.seeds, observations), self.is_greedy).decisions
