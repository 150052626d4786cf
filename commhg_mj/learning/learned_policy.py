"""A learned method as a policy: `policy(observations) -> decisions`, as every other."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch
from torch import nn

from ..base.arguments import flag, instance, one_of
from ..mission.batch import MissionBatch
from .graphs import GraphBuilder
from .noise import Draws
from .rollout import Actors, unchanged

# What an evaluation takes away from trained actors, to see what it was worth; who follows the schedule asks by it, or never.
VARIANTS = {
    "no-query": lambda logits: logits._replace(query=None),
    "random-gates": lambda logits: logits._replace(gate=torch.zeros(len(logits.keep_idle))),
}


@contextmanager
def one_thread() -> Iterator[None]:
    """torch computes in one thread: processes fly side by side, and the networks are small. Its user's choice comes back."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


class LearnedPolicy:
    """Decides by a method's actors for one batch of missions, each as if it flew alone; the critic is not used.

    Args:
      is_greedy: take the best choice instead of drawing one.
      variant: of `VARIANTS`, or none.

    Raises:
      ValueError: the method has no such head.
    """

    def __init__(self, method, batch: MissionBatch, is_greedy=False, variant=""):
        instance("method", method, nn.Module)
        instance("batch", batch, MissionBatch)
        if not isinstance(variant, str) or variant:
            one_of("variant", variant, list(VARIANTS))
        if variant == "random-gates" and not method.communicates:
            raise ValueError(f"{method.name}+{variant}: {method.name} follows the fixed schedule, it has no such head")
        self.builder, self.is_greedy = GraphBuilder(batch, method.wants), flag("is_greedy", is_greedy)
        self.actors = Actors(method, self.builder, VARIANTS.get(variant, unchanged), asks=variant != "no-query")
        self.public = self.builder.public(batch.state.tasks)
        self.seeds = np.array(batch.seeds, np.uint64)

    def __call__(self, observations):
        with one_thread():
            return self.actors.decide(observations, self.public, Draws(self.seeds, observations), self.is_greedy).decisions
