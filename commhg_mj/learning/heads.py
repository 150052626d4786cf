"""Choices out of logits: sampling, joint likelihood and entropy under masks.

A component with one legal choice, or one that is not the policy's to make, enters neither likelihood nor entropy.
"""

from functools import partial
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from ..base.terms import IDLE, KEEP, NOBODY
from .noise import OPERATOR, ROBOT

ILLEGAL = -1e9  # a masked logit
LEFT_OUT = -60.0  # logit of a legal option that a method does not score: it is never drawn, and nobody learns from it
STEP = 2.0**-10  # choices are made on logits rounded to this: far above float32's errors, far below what matters
FIXED, GATE, ASSIST, QUERY, TASKS = 0, 2, 4, 8, 64  # first components of a robot's noise
ALL_DRAWN = frozenset({"task", "broadcast", "query", "request", "operator"})
NONE_DRAWN = frozenset()


class RobotLogits(NamedTuple):
    """What a robot actor says of N rows with E task edges; all bounded."""

    task: Tensor  # [E]
    keep_idle: Tensor  # [N, 2]
    gate: Tensor | None  # [N] to broadcast; None: communication follows the schedule
    query: Tensor | None  # [N, 1 + H] nobody, then each operator; None: no query head
    assist: Tensor | None  # [N] to request assistance


class RobotChoices(NamedTuple):
    """N robots' choices as numbers."""

    task: np.ndarray  # [N] i8 edge of the row's graph, KEEP or IDLE
    gate: np.ndarray  # [N] bool
    query: np.ndarray  # [N] i8 operator or NOBODY
    assist: np.ndarray  # [N] bool


class Likelihood(NamedTuple):
    """Of the free components of N decisions."""

    log_prob: Tensor  # [N] of all of them together
    entropy: Tensor  # [N] mean over free components, each as a share of log(number of its legal choices)
    is_free: Tensor  # [N] bool: some component was the policy's to choose


def keep_as_chosen(keep_idle: Tensor, score: Tensor, own_edge: Tensor) -> Tensor:
    """[N, 2] logits of KEEP and IDLE: to keep a task is to choose it once more.

    Args:
      keep_idle: [N, 2]. score: [E] of task edges. own_edge: [N] of the held task, -1: none.
    """
    own = torch.where(own_edge >= 0, score[own_edge.clamp(min=0)], 0.0) if len(score) else 0.0
    return torch.stack([keep_idle[:, 0] + own, keep_idle[:, 1]], dim=1)


def hold_as_chosen(keep_rest: Tensor, score: Tensor, held: Tensor) -> Tensor:
    """[K, 2 + R] logits of KEEP, REST and the robots: to keep a robot is to choose it once more.

    Args:
      keep_rest: [K, 2]. score: [K, R]. held: [K] robot of the session, -1: none.
    """
    own = score.gather(1, held.clamp(min=0)[:, None])[:, 0]
    keep = keep_rest[:, 0] + torch.where(held >= 0, own, 0.0)
    return torch.cat([keep[:, None], keep_rest[:, 1:], score], dim=1)


def tensors_of(choices: RobotChoices) -> RobotChoices:
    """The same choices as tensors."""
    return RobotChoices(*(torch.from_numpy(np.ascontiguousarray(column)) for column in choices))


def judge_robots(logits: RobotLogits, graphs, choices) -> Likelihood:
    """The joint likelihood of robots' choices; `graphs` and `choices` hold tensors, `graphs.rows` the edges' rows."""
    return _join([_judge_tasks(logits, graphs, choices.task), *_judge_talk(logits, graphs, choices)])


def judge_apart(logits: RobotLogits, graphs, choices) -> tuple[Likelihood, Likelihood]:
    """The likelihoods of robots' tasks, and of all else that they choose."""
    task, talk = _judge_tasks(logits, graphs, choices.task), _judge_talk(logits, graphs, choices)
    nothing = torch.zeros_like(task[0]), torch.zeros_like(task[0]), torch.zeros_like(task[2])
    return _join([task]), _join(talk or [nothing])


def _judge_talk(logits, graphs, choices):
    """(log-probability, relative entropy, free) of each component but the task."""
    parts = []
    if logits.gate is not None:
        parts.append(_judge_switch(logits.gate, choices.gate, graphs.gate))
    is_quiet = torch.ones_like(graphs.gate)
    if logits.query is not None:
        legal = functional.pad(graphs.query, (1, 0), value=True)
        parts.append(_judge_rows(logits.query, choices.query + 1, legal))
        is_quiet = choices.query == NOBODY
    if logits.assist is not None:
        parts.append(_judge_switch(logits.assist, choices.assist, graphs.assist & is_quiet))
    return parts


def judge_operators(logits: Tensor, legal: Tensor, choices: Tensor) -> Likelihood:
    """The likelihood of operators' choices [K] among logits [K, 2 + R] (KEEP, REST, robots)."""
    return _join([_judge_rows(logits, choices, legal)])


def _join(parts) -> Likelihood:
    log_probs, entropies, free = (torch.stack(column) for column in zip(*parts))
    count = free.sum(dim=0)
    return Likelihood(
        torch.where(free, log_probs, 0.0).sum(dim=0),
        torch.where(free, entropies, 0.0).sum(dim=0) / count.clamp(min=1),
        count > 0,
    )


def _judge_tasks(logits, graphs, chosen):
    """(log-probability, relative entropy, free) [N] over ragged legal edges, KEEP and IDLE."""
    rows, legal = graphs.rows, graphs.task_legal
    fixed = torch.where(graphs.keep_idle, logits.keep_idle.exp(), 0.0).sum(dim=1)
    edges = torch.where(legal, logits.task.exp(), 0.0)
    norm = (fixed + torch.zeros_like(fixed).index_add(0, rows, edges)).log()
    picked = torch.where(
        chosen >= 0, logits.task[chosen.clamp(min=0)] if len(rows) else 0.0,
        torch.where(chosen == KEEP, logits.keep_idle[:, 0], logits.keep_idle[:, 1]),
    )  # fmt: skip
    # Entropy = log Z - mean logit.
    mean = torch.zeros_like(fixed).index_add(0, rows, edges * logits.task)
    mean = mean + torch.where(graphs.keep_idle, logits.keep_idle.exp() * logits.keep_idle, 0.0).sum(dim=1)
    count = graphs.keep_idle.sum(dim=1).index_add(0, rows, legal.long())
    entropy = (norm - mean / norm.exp()) / count.clamp(min=2).log()
    return picked - norm, entropy, count > 1


def _judge_rows(logits, chosen, legal):
    masked = torch.where(legal, logits, ILLEGAL).log_softmax(dim=1)
    count = legal.sum(dim=1)
    entropy = -torch.where(legal, masked.exp() * masked, 0.0).sum(dim=1) / count.clamp(min=2).log()
    return masked.gather(1, chosen[:, None])[:, 0], entropy, count > 1


def _judge_switch(logit, chosen, is_open):
    yes, no = functional.logsigmoid(logit), functional.logsigmoid(-logit)
    entropy = -(yes.exp() * yes + no.exp() * no) / np.log(2.0)
    return torch.where(chosen, yes, no), entropy, is_open


def choose_robots(logits: RobotLogits, graphs, rng, drawn: frozenset = ALL_DRAWN) -> RobotChoices:
    """Robots' choices: the best of each component, or one drawn where its head is among `drawn`.

    Args:
      graphs: `graphs.RobotGraphs` of arrays. rng: numpy Generator, or `draws.Draws` of these robots.
    """
    noise, n = lambda head: _noise(rng, ROBOT, head in drawn), len(graphs.itself)
    each = np.arange(n)
    rows = np.repeat(each, np.diff(graphs.task_ptr))
    chance = noise("task")(each[:, None], FIXED + np.arange(2))
    fixed = np.where(graphs.keep_idle, _coarse(logits.keep_idle) + chance, ILLEGAL)
    edges = np.where(graphs.task_legal, noisy_tasks(logits, graphs, rng, drawn), ILLEGAL)
    best = np.where(fixed[:, 0] >= fixed[:, 1], KEEP, IDLE)
    top = fixed.max(axis=1)
    # The best edge of each row: edges in rising order of score, the last one written wins.
    order = np.argsort(edges, kind="stable")
    edge = np.full(n, NOBODY)
    edge[rows[order]] = order
    wins = (edge >= 0) & (edges[edge] > top) if len(edges) else np.zeros(n, bool)
    task = np.where(wins, edge, best)
    gate, assist = np.zeros(n, bool), np.zeros(n, bool)
    query = np.full(n, NOBODY)
    if logits.gate is not None:
        gate = graphs.gate & _says_yes(logits.gate, noise("broadcast"), each, GATE)
    if logits.query is not None:
        legal = np.concatenate([np.ones((n, 1), bool), graphs.query], axis=1)
        query = _best(logits.query, legal, noise("query"), QUERY) - 1
    if logits.assist is not None:
        assist = graphs.assist & (query == NOBODY) & _says_yes(logits.assist, noise("request"), each, ASSIST)
    return RobotChoices(task, gate, query, assist)


def noisy_tasks(logits: RobotLogits, graphs, rng, drawn: frozenset) -> np.ndarray:
    """[E] scores of task edges whose highest is a draw, or the best."""
    rows = np.repeat(np.arange(len(graphs.itself)), np.diff(graphs.task_ptr))
    return _coarse(logits.task) + _noise(rng, ROBOT, "task" in drawn)(rows, TASKS + graphs.task)


def choose_operators(logits: Tensor, legal: np.ndarray, rng, drawn: frozenset = ALL_DRAWN) -> np.ndarray:
    """Operators' choices [K] among KEEP, REST and robots: drawn, or the best."""
    return _best(logits, legal, _noise(rng, OPERATOR, "operator" in drawn), 0)


def _says_yes(logit, noise, rows, first):
    return _coarse(logit) + noise(rows, first) - noise(rows, first + 1) > 0.0


def _best(logits, legal, noise, first):
    n, width = legal.shape
    return np.where(legal, _coarse(logits) + noise(np.arange(n)[:, None], first + np.arange(width)), ILLEGAL).argmax(axis=1)


def _coarse(logits):
    """Logits in whole STEPs: what is equal but for float32's last bits ties on every processor, and ties have one winner."""
    return np.rint(logits.numpy() / STEP) * STEP


def _noise(rng, role, is_drawn):
    """What gives Gumbel noise for (rows, components) that broadcast."""
    if not is_drawn:
        return lambda rows, components: 0.0
    if isinstance(rng, np.random.Generator):
        return lambda rows, components: rng.gumbel(size=np.broadcast(rows, components).shape)
    return partial(rng, role)
