"""Learning from points: what each alternative was worth beside the others by regression, everything else by imitation."""

from collections.abc import Iterator

import numpy as np
import torch
from torch import Tensor

from ..base.terms import KEEP
from .batches import legal_picks, operator_batch, pick_batch, shifted
from .heads import RobotChoices, RobotLogits, judge_apart, judge_operators, tensors_of
from .points import Points, Trials
from .ppo import OUT_OF_REACH
from .weights import OF_CRITIC

UNIT = 0.06  # mean tasks that a logit stands for
EPOCHS, MINIBATCH, RATE, LAST_RATE = 6, 512, 2e-3, 0.05  # the rate falls to that share of it
DECAY = 0.01  # of weights
JUDGED, IMITATED = 10.0, 0.3  # weights of the losses: of what luck leaves of a judgement, little is worth learning
TRUST = 0.4, 3.0  # see PlanReader; what operators' alternatives are worth is hardly learned


class Fit:
    """Learning from points.

    Args:
      method: learns.
    """

    def __init__(self, method, points: Points, rng):
        self.method, self.points, self.rng = method, points, rng
        self.optimizer = torch.optim.AdamW(actors_of(method), lr=RATE, weight_decay=DECAY)
        self.targets = [without_luck(tried) / UNIT for tried in (points.tried, points.tried_picks)]
        self.spread = [max(1e-6, float(np.nansum(target**2)) / max(1, np.sum(~np.isnan(target)))) for target in self.targets]

    def run(self) -> Iterator[dict]:
        """Losses of each epoch, the last of which leaves the method fitted."""
        n, k = len(self.points.tried.choice), len(self.points.tried_picks.choice)
        n_steps = max(1, n // MINIBATCH)
        for epoch in range(EPOCHS):
            robots, operators = self.rng.permutation(n), self.rng.permutation(k)
            parts = zip(np.array_split(robots, n_steps), np.array_split(operators, n_steps))
            losses = []
            for step, rows in enumerate(parts):
                share = 1.0 - (epoch + step / n_steps) / EPOCHS
                for group in self.optimizer.param_groups:
                    group["lr"] = RATE * max(LAST_RATE, share)
                losses.append(self._step(*map(np.sort, rows)))
            if epoch == EPOCHS - 1 and self.method.plan is not None:
                self.method.plan.trust[:] = torch.tensor(TRUST)
                self.method.plan.bounds.fill_(1.0)
            yield dict(zip(("task_loss", "pick_loss", "imitation"), np.mean(losses, axis=0).tolist()))

    def _step(self, robots, operators):
        judged, imitated = zip(self._robots(robots), self._operators(operators))
        loss = JUDGED * sum(judged) + IMITATED * sum(imitated)
        self.optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(actors_of(self.method), 1.0)
        self.optimizer.step()
        return [*(part.item() for part in judged), sum(imitated).item()]

    def _robots(self, rows):
        """(loss of alternatives' scores, of what is imitated) of some robots' decisions."""
        points = self.points
        batch, public, shift = pick_batch(points.robots, points.public, rows)
        logits = self.method.robot_logits(batch, public)
        task, *others = (column[rows] for column in points.taught)
        choices = tensors_of(RobotChoices(shifted(task, shift), *others))
        scores = scores_of(logits, torch.from_numpy(shifted(points.tried.choice[rows], shift[:, None])))
        judged = regression(scores, torch.from_numpy(self.targets[0][rows])) / self.spread[0]
        task, talk = judge_apart(logits, batch, choices)
        is_imitated = torch.from_numpy(~points.tried.are_there[rows])
        is_imitated &= task.log_prob > OUT_OF_REACH
        return judged, -(torch.where(is_imitated, task.log_prob, 0.0) + talk.log_prob).mean()

    def _operators(self, rows):
        points = self.points
        batch = operator_batch(points.operators, rows)
        logits, picks = self.method.operator_logits(batch), torch.from_numpy(points.tried_picks.choice[rows])
        judged = regression(logits.gather(1, picks.clamp(min=0)), torch.from_numpy(self.targets[1][rows])) / self.spread[1]
        likelihood = judge_operators(logits, legal_picks(batch), torch.from_numpy(points.taught_picks[rows]))
        return judged, -(likelihood.log_prob * torch.from_numpy(~points.tried_picks.are_there[rows])).mean()


def actors_of(method) -> list:
    """The parameters that decide; not the critic's."""
    return [parameter for name, parameter in method.named_parameters() if not name.startswith(OF_CRITIC)]


def without_luck(tried: Trials) -> np.ndarray:
    """[n, C] f4 worths less their row's mean, and less what their flights' luck explains of the rest; nan where there is none.

    Luck has a mean of 0 whatever is chosen, so that the worths stay unbiased; a third of their variance is left.
    """
    is_there = ~np.isnan(tried.worth)
    worth, luck = centred(tried.worth, is_there), centred(tried.luck, is_there)
    explained, *_ = np.linalg.lstsq(luck[is_there], worth[is_there])
    return worth - luck @ explained


def centred(values: np.ndarray, is_there: np.ndarray) -> np.ndarray:
    """[n, C, ..] values less their row's mean over those [n, C] that are there; the others mean nothing."""
    is_there = is_there.reshape(*is_there.shape, *[1] * (values.ndim - 2))
    count = np.maximum(1, is_there.sum(axis=1, keepdims=True))
    return values - np.where(is_there, values, 0.0).sum(axis=1, keepdims=True) / count


def scores_of(logits: RobotLogits, edges: Tensor) -> Tensor:
    """[N, C] logits of edges, KEEP and IDLE [N, C]."""
    fixed = torch.where(edges == KEEP, logits.keep_idle[:, :1], logits.keep_idle[:, 1:])
    return torch.where(edges >= 0, logits.task[edges.clamp(min=0)], fixed)


def regression(scores: Tensor, targets: Tensor) -> Tensor:
    """Mean square of what centred scores [N, C] are off centred targets, where there are any and the method can choose."""
    is_there = ~targets.isnan() & (scores > OUT_OF_REACH)
    off = torch.where(is_there, scores - targets.nan_to_num(), 0.0)
    off = off - off.sum(dim=1, keepdim=True) / is_there.sum(dim=1, keepdim=True).clamp(min=1)
    return (off**2 * is_there).sum() / is_there.sum().clamp(min=1)
