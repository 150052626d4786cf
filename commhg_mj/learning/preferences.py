"""What a learned policy's heads prefer of one robot's choices, as probabilities."""

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from ..mission.observe import Observations
from .learned_policy import LearnedPolicy, one_thread


class Preferences(NamedTuple):
    """Probabilities of one robot's choices, 0 where masked; None where the method has no such head.

    `task`, `keep` and `idle` sum to 1, and so does `query`.
    """

    task: np.ndarray  # [T]
    keep: float
    idle: float
    gate: float | None  # to broadcast
    query: np.ndarray | None  # [1 + H] nobody, then each operator
    assist: float | None  # to request assistance if nobody is asked


@one_thread()
@torch.no_grad()
def robot_preferences(policy: LearnedPolicy, seen: Observations) -> Preferences:
    """Preferences of the one robot whose row `seen` holds, of the policy's first mission."""
    graphs = policy.builder.robots(seen)
    _, logits = policy.actors.score(graphs, policy.public)
    legal = torch.from_numpy(np.concatenate([graphs.task_legal, graphs.keep_idle[0]]))
    *edges, keep, idle = _shares(torch.cat([logits.task, logits.keep_idle[0]]), legal)
    task = np.zeros(policy.public.shape[1])
    task[graphs.task] = edges
    query = None
    if logits.query is not None:
        query = _shares(logits.query[0], torch.from_numpy(np.append(True, graphs.query[0])))
    return Preferences(
        task, float(keep), float(idle), _chance(logits.gate, graphs.gate), query, _chance(logits.assist, graphs.assist)
    )


def _shares(logits: Tensor, legal: Tensor) -> np.ndarray:
    return torch.where(legal, logits.double(), -torch.inf).softmax(dim=0).numpy()


def _chance(logit: Tensor | None, is_open: np.ndarray) -> float | None:
    return None if logit is None else float(torch.sigmoid(logit[0])) * bool(is_open[0])
