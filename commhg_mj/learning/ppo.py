"""PPO over decisions of both roles (paper, section III-C and D): one joint ratio a robot decision, clipped once."""

from copy import deepcopy
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from torch import nn

from ..base.arguments import number, one_of, positive, whole
from .batches import legal_picks, operator_batch, pick_robots, robot_batch
from .critic import Agents
from .distributed import ALONE, ProcessGroup
from .heads import RobotChoices, judge_operators, judge_robots, tensors_of
from .rollout import Experience
from .states import States

# What an update is for: to imitate the choices remembered, to learn their values alone, or to choose better than they did.
Aim = Literal["clone", "value", "improve"]
MOST_WEIGHT = 1e6  # of a part of the loss


@dataclass(frozen=True)
class Hyper:
    """Numbers of the learning algorithm, the same for every learned method."""

    gamma: float = 0.998  # a second
    lam: float = 0.95
    trace: Literal["decision", "second"] = "decision"  # that `lam` is a decay of
    clip: float = 0.2
    epochs: int = 4
    decisions: int = 8192  # of robots, an update
    minibatches: int = 8
    learning_rate: float = 3e-4
    entropy: float = 0.003  # weight of the relative entropy
    value: float = 0.5  # weight of the critic's loss
    max_grad: float = 0.5
    target_kl: float = 0.03  # a minibatch beyond it ends the update

    def __post_init__(self):
        one_of("trace", self.trace, ("decision", "second"))
        checked = {name: whole(name, getattr(self, name), 1) for name in ("epochs", "decisions", "minibatches")}
        checked |= {name: number(name, getattr(self, name), 0, 1) for name in ("gamma", "lam")}
        checked |= {name: number(name, getattr(self, name), 0, MOST_WEIGHT) for name in ("entropy", "value")}
        checked |= {name: positive(name, getattr(self, name)) for name in ("clip", "learning_rate", "max_grad", "target_kl")}
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @classmethod
    def of(cls, n_robots: int, is_refining: bool, **others) -> "Hyper":
        """For a team: it shares one reward, so the more decide, the noisier each one's share of an update is.

        Weights to begin with are refined: in that noise large steps and a pull to entropy would undo them.
        """
        refining = {"learning_rate": 1e-4, "entropy": 0.0} if is_refining else {}
        decisions = min(16_384, max(cls.decisions, 2048 * whole("n_robots", n_robots, 1)))
        return cls(decisions=decisions, **refining, **others)


def check_device(device: str) -> None:
    """Whether networks can learn there.

    Raises:
      ValueError: torch finds no such device.
    """
    one_of("device", device, ("cpu", "cuda"))
    if device == "cuda" and not torch.cuda.is_available():
        raise ValueError("device: torch finds no CUDA device here: use cpu")


class Learner:
    """Optimises a method's actors and critic.

    Args:
      method: on the CPU, where it flies; it gets what was learned after every update.
      group: the processes whose gradients make one step. device: where this one computes its own.
    """

    def __init__(self, method, hyper: Hyper, group: ProcessGroup = ALONE, device: str = "cpu"):
        check_device(device)
        self.flown, self.hyper, self.group, self.device = method, hyper, group, torch.device(device)
        self.method = method if self.device.type == "cpu" else deepcopy(method).to(self.device)
        self.optimizer = torch.optim.Adam(self.method.parameters(), lr=hyper.learning_rate, eps=1e-5)

    def set_rate(self, share: float) -> None:
        """Learn at a share of the plan's rate."""
        for group in self.optimizer.param_groups:
            group["lr"] = self.hyper.learning_rate * max(0.05, share)

    def update(self, data: Experience, rng, aim: Aim = "improve") -> dict:
        """Some epochs over the experience."""
        scale = self.method.scale
        for role, returns in enumerate((data.robot_return, data.operator_return)):
            scale.update(role, self._tensor(returns).float())
        self.group.average(list(scale.buffers()))
        stats = list(self._steps(data, rng, aim))
        if self.method is not self.flown:
            self.flown.load_state_dict(self.method.state_dict())
        return {name: float(np.mean([row[name] for row in stats])) for name in stats[0]}

    def _steps(self, data, rng, aim):
        hyper = self.hyper
        advantages = [self._tensor(_normal(a.sum(axis=1))) for a in (data.robot_advantage, data.operator_advantage)]
        old = [self._tensor(log_prob) for log_prob in (data.robot_log_prob, data.operator_log_prob)]
        # Nobody decides in some states; a minibatch of nobody teaches nothing.
        alive = np.union1d(data.robot_state, data.operator_state)
        minibatches = self.group.least(min(hyper.minibatches, len(alive)))
        for _ in range(hyper.epochs):
            for states in np.array_split(rng.permutation(alive), minibatches):
                stats = self._step(data, np.sort(states), advantages, old, aim)
                yield stats
                if stats["kl"] > hyper.target_kl:
                    return

    def _tensor(self, array):
        return torch.from_numpy(array).to(self.device)

    def _tensors(self, columns):
        """A named tuple of tensors, on the device."""
        return columns._make(column.to(self.device) for column in columns)

    def _step(self, data, states, advantages, old, aim):
        hyper, method = self.hyper, self.method
        robots, operators = _rows_in(data.robot_state, states), _rows_in(data.operator_state, states)
        new = [] if aim == "value" else [self._judge_robots(data, robots, aim), self._judge_operators(data, operators)]
        losses, entropies, kls = [], [], []
        for role, (rows, now) in enumerate(zip((robots, operators), new)):
            free = now.is_free
            if not free.any():
                continue
            if aim == "clone":
                losses.append(-now.log_prob[free].mean())
            else:
                advantage = advantages[role][rows][free]
                log_ratio = now.log_prob[free] - old[role][rows][free]
                ratio = log_ratio.exp()
                clipped = ratio.clamp(1.0 - hyper.clip, 1.0 + hyper.clip)
                losses.append(-torch.min(ratio * advantage, clipped * advantage).mean())
                kls.append((ratio - 1.0 - log_ratio).detach().mean())
            entropies.append(now.entropy[free].mean())
        value_loss = self._value_loss(data, states, robots, operators)
        policy_loss, entropy = _mean(losses), _mean(entropies)
        loss = policy_loss - hyper.entropy * entropy + hyper.value * value_loss
        self.optimizer.zero_grad()
        loss.backward()
        stats = torch.stack([part.detach().cpu() for part in (policy_loss, value_loss, entropy, _mean(kls))])
        self._share_gradients(stats)
        norm = nn.utils.clip_grad_norm_(method.parameters(), hyper.max_grad)
        self.optimizer.step()
        return dict(zip(("policy_loss", "value_loss", "entropy", "kl"), stats.tolist())) | {"grad_norm": norm.item()}

    def _share_gradients(self, stats):
        """The group's mean of gradients and statistics; what one process had no use for, another may have."""
        if self.group.size == 1:
            return
        parameters = list(self.method.parameters())
        for parameter in parameters:
            if parameter.grad is None:
                parameter.grad = torch.zeros_like(parameter)
        self.group.average([*(parameter.grad for parameter in parameters), stats])
        for parameter in parameters:
            if not parameter.grad.any():  # to Adam a gradient of zero is not the same as none
                parameter.grad = None

    def _value_loss(self, data, states, robots, operators):
        method = self.method
        at = (data.robot_state, data.robots.robot, robots), (data.operator_state, data.operators.operator, operators)
        asked = [
            Agents(self._tensor(np.searchsorted(states, state[rows])), self._tensor(agent[rows])) for state, agent, rows in at
        ]
        values = method.critic(States(*(self._tensor(array[states]) for array in data.states)), *asked)
        losses = []
        for role, (returns, rows) in enumerate(((data.robot_return, robots), (data.operator_return, operators))):
            if len(rows):
                target = method.scale.normal(role, self._tensor(returns[rows]).float())
                losses.append(((values[role] - target) ** 2).mean())
        return _mean(losses)

    def _judge_robots(self, data, rows, aim):
        graphs, shift = pick_robots(data.robots, rows)
        # Only the worlds of the minibatch are encoded.
        worlds, index = np.unique(graphs.mission, return_inverse=True)
        batch = self._tensors(robot_batch(graphs._replace(mission=index), data.public.shape[1]))
        public = self._tensor(data.public[worlds].reshape(-1, data.public.shape[2]))
        task, *others = (column[rows] for column in data.robot_choices)
        choices = self._tensors(tensors_of(RobotChoices(np.where(task >= 0, task + shift, task), *others)))
        logits = self.method.robot(batch, public)
        # The teacher never asks: from it nobody learns when to.
        return judge_robots(logits._replace(query=None) if aim == "clone" else logits, batch, choices)

    def _judge_operators(self, data, rows):
        graphs, choices = self._tensors(operator_batch(data.operators, rows)), self._tensor(data.operator_choices[rows])
        return judge_operators(self.method.operator(graphs), legal_picks(graphs), choices)


def _rows_in(state_of, states):
    """Rows whose state is among the sorted `states`."""
    first, last = np.searchsorted(state_of, states), np.searchsorted(state_of, states, side="right")
    return np.concatenate([np.arange(a, b) for a, b in zip(first, last)]) if len(states) else np.zeros(0, np.int64)


def _mean(losses):
    return torch.stack(losses).mean() if losses else torch.zeros(())


def _normal(advantage):
    if not len(advantage):  # nobody of this role
        return np.zeros(0, np.float32)
    return ((advantage - advantage.mean()) / (advantage.std() + 1e-8)).astype(np.float32)
