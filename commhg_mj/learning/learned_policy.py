"""A learned method as a policy: `policy(observations) -> decisions`, as every other."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
import torch
from torch import nn

from ..base.arguments import instance, one_of
from ..mission.batch import MissionBatch
from .graphs import GraphBuilder
from .heads import ALL_DRAWN, NONE_DRAWN
from .noise import Draws
from .rollout import Actors, unchanged


class Variant(NamedTuple):
    """Another way to fly trained actors, to see what something is worth."""

    change: Callable = unchanged  # of RobotLogits
    drawn: frozenset = NONE_DRAWN  # heads that draw their choices; the others take the best


VARIANTS = {
    "": Variant(),
    "no-query": Variant(lambda logits: logits._replace(query=None)),  # who follows the schedule never asks by it
    "random-gates": Variant(lambda logits: logits._replace(gate=torch.zeros(len(logits.keep_idle))), frozenset({"broadcast"})),
    "drawn": Variant(drawn=ALL_DRAWN),
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
      variant: of `VARIANTS`; without one, all take their best choices.

    Raises:
      ValueError: the method has no such head.
    """

    def __init__(self, method, batch: MissionBatch, variant=""):
        instance("method", method, nn.Module)
        instance("batch", batch, MissionBatch)
        if not isinstance(variant, str) or variant:
            one_of("variant", variant, list(VARIANTS)[1:])
        if variant == "random-gates" and not method.communicates:
            raise ValueError(f"{method.name}+{variant}: {method.name} speaks by rule, it has no such head")
        self.builder, (change, self.drawn) = GraphBuilder(batch, method.wants), VARIANTS[variant]
        self.actors = Actors(method, self.builder, change, asks=variant != "no-query")
        self.public = self.builder.public(batch.state.tasks)
        self.seeds = np.array(batch.seeds, np.uint64)

    def __call__(self, observations):
        with one_thread():
            return self.actors.decide(observations, self.public, Draws(self.seeds, observations), self.drawn).decisions
