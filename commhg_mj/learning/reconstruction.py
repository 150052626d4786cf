"""What old records may mean now: reconstruction of tasks and robots, as ATA-HRL's auxiliary tasks have it.

Learned from the true state in training alone; in flight records are all that goes in.
"""

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from .features import PAST
from .networks import linear, mlp, pick
from .state_features import STATE_ROBOT, STATE_TASK

LATENT, HIDDEN = 16, 32
KL_WEIGHT = 0.01
TASK_TYPE, TASK_WORK = STATE_TASK.columns("uav_only", "ugv_only", "general"), STATE_TASK.columns("serviced", "progress")
ROBOT_PLACE, ROBOT_DOES = STATE_ROBOT.columns("x", "y"), STATE_ROBOT.columns("travelling", "servicing", "has_task")
ROBOT_FAILED, PAST_PLACE = STATE_ROBOT.index("failed"), PAST.columns("x", "y")


class TaskReconstruction(nn.Module):
    """A conditional variational autoencoder: belief of a task, given what is public of it -> what it is now."""

    WIDTH = 6  # features: three types, serviced, progress, done

    def __init__(self, n_belief: int, n_condition: int):
        super().__init__()
        self.encode = mlp(n_belief + n_condition, 64, 2 * LATENT)
        self.decode = mlp(LATENT + n_condition, 64, self.WIDTH, 0.1)

    def forward(self, belief: Tensor, condition: Tensor) -> Tensor:
        """[E, WIDTH] features, by the posterior's mean: no noise in flight."""
        mean = self.encode(torch.cat([belief, condition], dim=1))[:, :LATENT]
        out = self.decode(torch.cat([mean, condition], dim=1))
        return torch.cat([out[:, :3].softmax(dim=1), out[:, 3:].sigmoid()], dim=1)

    def loss(self, belief: Tensor, condition: Tensor, truth: Tensor, is_open: Tensor, rng) -> Tensor:
        """Cross entropies and the divergence from a standard normal latent.

        Args:
          truth: [E, STATE_TASK.width]. is_open: [E] bool, not done in truth; of what is done nothing else is asked.
        """
        if not len(belief):
            return belief.new_zeros(())
        mean, log_variance = self.encode(torch.cat([belief, condition], dim=1)).chunk(2, dim=1)
        noise = torch.from_numpy(rng.standard_normal(mean.shape, np.float32)).to(mean.device)
        out = self.decode(torch.cat([mean + (0.5 * log_variance).exp() * noise, condition], dim=1))
        binary = functional.binary_cross_entropy_with_logits
        types = functional.cross_entropy(out[:, :3], pick(truth, TASK_TYPE), reduction="none")
        work = binary(out[:, 3:5], pick(truth, TASK_WORK), reduction="none").sum(dim=1)
        done = binary(out[:, 5], 1.0 - is_open.float(), reduction="none")
        divergence = 0.5 * (mean**2 + log_variance.exp() - 1.0 - log_variance).sum(dim=1)
        return (torch.where(is_open, types + work, 0.0) + done + KL_WEIGHT * divergence).mean()


class RobotReconstruction(nn.Module):
    """A recurrent network over a robot's last reports, oldest first -> where it is now and what it does."""

    WIDTH = 5  # features: place, travelling, servicing, has a task

    def __init__(self):
        super().__init__()
        self.recur, self.out = nn.GRU(PAST.width, HIDDEN, batch_first=True), linear(HIDDEN, self.WIDTH, 0.1)

    def raw(self, past: Tensor) -> Tensor:
        """[P, WIDTH] places, then logits, of reports [P, n, PAST.width]."""
        if not len(past):
            return past.new_zeros(0, self.WIDTH)
        out = self.out(self.recur(past)[1][0])
        return torch.cat([pick(past[:, -1], PAST_PLACE) + out[:, :2], out[:, 2:]], dim=1)  # it has moved from where it was last

    def forward(self, past: Tensor) -> Tensor:
        """[P, WIDTH] features."""
        raw = self.raw(past)
        return torch.cat([raw[:, :2], raw[:, 2:].sigmoid()], dim=1)

    def loss(self, past: Tensor, truth: Tensor) -> Tensor:
        """Squared error of places, cross entropy of what is done, of robots that still fly.

        Args:
          truth: [P, STATE_ROBOT.width].
        """
        alive = truth[:, ROBOT_FAILED] == 0
        if not alive.any():
            return truth.new_zeros(())
        raw, truth = self.raw(past[alive]), truth[alive]
        place = ((raw[:, :2] - pick(truth, ROBOT_PLACE)) ** 2).sum(dim=1)
        return (place + functional.binary_cross_entropy_with_logits(
            raw[:, 2:], pick(truth, ROBOT_DOES), reduction="none"
        ).sum(dim=1)).mean()  # fmt: skip
