"""PPO over decisions of both roles (paper, section III-C and D): one joint ratio a robot decision, clipped once."""

from copy import deepcopy
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import torch
from torch import nn

from ..base.arguments import number, one_of, positive, whole
from .batches import legal_picks, operator_batch, pick_batch, shifted
from .critic import Agents, Local, judge_values
from .distributed import ALONE, ProcessGroup
from .heads import LEFT_OUT, Likelihood, RobotChoices, judge_operators, judge_robots, tensors_of
from .rollout import Experience
from .states import States

# What an update is for: to imitate the choices remembered, to learn their values alone, or to choose better than they did.
Aim = Literal["clone", "value", "improve"]
MOST_WEIGHT = 1e6  # of a part of the loss
OUT_OF_REACH = 0.75 * LEFT_OUT  # log-probability below which a teacher's choice is one that the method cannot make


class Role(NamedTuple):
    """What all decisions of one role have earned."""

    advantage: torch.Tensor  # [N] normalised
    log_prob: torch.Tensor  # [N] of the choices as they were made
    returns: torch.Tensor  # [N, 2]
    n_free: float  # decisions with a choice in a mean minibatch
    n: float  # decisions in a mean minibatch


class Minibatch(NamedTuple):
    """What is known of all decisions that were made in some states, as tensors."""

    rows: tuple[np.ndarray, np.ndarray]  # of the experience: robots', operators'
    local: Local
    choices: RobotChoices
    picks: torch.Tensor  # [K] operators' choices
    states: States
    robot_agents: Agents
    operator_agents: Agents


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
    clone_rate: float = 1e-3  # while imitating: labels are no noisy advantages, and larger steps learn more of them
    entropy: float = 0.003  # weight of the relative entropy
    value: float = 0.5  # weight of the critic's loss
    max_grad: float = 0.5
    target_kl: float = 0.03  # a minibatch beyond it ends the update

    def __post_init__(self):
        one_of("trace", self.trace, ("decision", "second"))
        checked = {name: whole(name, getattr(self, name), 1) for name in ("epochs", "decisions", "minibatches")}
        checked |= {name: number(name, getattr(self, name), 0, 1) for name in ("gamma", "lam")}
        checked |= {name: number(name, getattr(self, name), 0, MOST_WEIGHT) for name in ("entropy", "value")}
        rates = "clip", "learning_rate", "clone_rate", "max_grad", "target_kl"
        checked |= {name: positive(name, getattr(self, name)) for name in rates}
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

    def set_rate(self, share: float, aim: Aim = "improve") -> None:
        """Learn at a share of the plan's rate; imitate at its own."""
        rate = self.hyper.clone_rate if aim == "clone" else self.hyper.learning_rate * max(0.05, share)
        for group in self.optimizer.param_groups:
            group["lr"] = rate

    def update(self, data: Experience, rng, aim: Aim = "improve") -> dict:
        """Some epochs over the experience."""
        scale = self.method.scale
        for role, returns in enumerate(data.returns):
            scale.update(role, self._tensor(returns).float())
        self.group.average(list(scale.buffers()))
        stats = list(self._steps(data, rng, aim))
        if self.method is not self.flown:
            self.flown.load_state_dict(self.method.state_dict())
        return {name: float(np.mean([row[name] for row in stats])) for name in stats[0]}

    def _steps(self, data, rng, aim):
        hyper = self.hyper
        # Nobody decides in some states; a minibatch of nobody teaches nothing.
        alive = np.union1d(data.robot_state, data.operator_state)
        minibatches = self.group.least(min(hyper.minibatches, len(alive)))
        roles = [self._role(*of, minibatches) for of in zip(data.advantages, data.free, data.log_probs, data.returns)]
        for _ in range(hyper.epochs):
            for states in np.array_split(rng.permutation(alive), minibatches):
                stats = self._step(self.minibatch(data, np.sort(states)), roles, aim, rng)
                yield stats
                if stats["kl"] > hyper.target_kl:
                    return

    def _role(self, advantage, free, log_prob, returns, minibatches):
        advantage = self._tensor(_normal(advantage.sum(axis=1), free))
        counts = free.sum() / minibatches, len(free) / minibatches
        return Role(advantage, self._tensor(log_prob), self._tensor(returns).float(), *counts)

    def _tensor(self, array):
        return torch.from_numpy(array).to(self.device)

    def _tensors(self, columns):
        """A named tuple of tensors, on the device."""
        return columns._make(column.to(self.device) for column in columns)

    def minibatch(self, data: Experience, states: np.ndarray) -> Minibatch:
        """All decisions that were made in some rising states."""
        rows = robots, operators = _rows_in(data.robot_state, states), _rows_in(data.operator_state, states)
        batch, public, shift = pick_batch(data.robots, data.public, robots)
        task, *others = (column[robots] for column in data.robot_choices)
        choices = RobotChoices(shifted(task, shift), *others)
        at = (data.robot_state, data.robots.robot, robots), (data.operator_state, data.operators.operator, operators)
        return Minibatch(
            rows, Local(self._tensors(batch), public.to(self.device), self._tensors(operator_batch(data.operators, operators))),
            self._tensors(tensors_of(choices)), self._tensor(data.operator_choices[operators]),
            States(*(self._tensor(array[states]) for array in data.states)),
            *(Agents(self._tensor(np.searchsorted(states, state[mine])), self._tensor(agent[mine])) for state, agent, mine in at),
        )  # fmt: skip

    def judge(self, batch: Minibatch, aim: Aim = "improve") -> list[Likelihood]:
        """How likely the actors find the choices that were made: robots', then operators'."""
        robots, public, operators = batch.local
        logits = self.method.robot_logits(robots, public)
        # A teacher asks by a fixed rule, or never: from it nobody learns when to.
        logits = logits._replace(query=None) if aim == "clone" else logits
        picks = judge_operators(self.method.operator_logits(operators), legal_picks(operators), batch.picks)
        return [judge_robots(logits, robots, batch.choices), picks]

    def _step(self, batch, roles, aim, rng):
        hyper, method = self.hyper, self.method
        judged = [] if aim == "value" else self.judge(batch, aim)
        parts = [self._policy_loss(*of, aim) for of in zip(roles, batch.rows, judged)]
        policy_loss, entropy, kl = (_mean(column) for column in zip(*filter(None, parts))) if any(parts) else (_mean([]),) * 3
        value_loss = self._value_loss(batch, roles)
        auxiliary = None if aim == "value" else method.auxiliary(batch, rng)
        loss = policy_loss - hyper.entropy * entropy + hyper.value * value_loss + (0.0 if auxiliary is None else auxiliary)
        self.optimizer.zero_grad()
        loss.backward()
        stats = torch.stack([part.detach().cpu() for part in (policy_loss, value_loss, entropy, kl)])
        self._share_gradients(stats)
        norm = nn.utils.clip_grad_norm_(method.parameters(), hyper.max_grad)
        self.optimizer.step()
        return dict(zip(("policy_loss", "value_loss", "entropy", "kl"), stats.tolist())) | {"grad_norm": norm.item()}

    def _policy_loss(self, role, rows, now, aim):
        """(loss, relative entropy, KL) of one role; nothing if it had no choice in the whole experience.

        Sums over free decisions by how many a minibatch holds in the mean, so that where there are few each counts no more.
        """
        if not role.n_free:
            return ()
        free, n, clip = now.is_free, role.n_free, self.hyper.clip
        entropy = now.entropy[free].sum() / n
        if aim == "clone":
            return -now.log_prob[free & (now.log_prob > OUT_OF_REACH)].sum() / n, entropy, torch.zeros(())
        advantage = role.advantage[rows][free]
        log_ratio = now.log_prob[free] - role.log_prob[rows][free]
        ratio = log_ratio.exp()
        gain = torch.min(ratio * advantage, ratio.clamp(1.0 - clip, 1.0 + clip) * advantage)
        return -gain.sum() / n, entropy, (ratio - 1.0 - log_ratio).detach().sum() / n

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

    def _value_loss(self, batch, roles):
        values = judge_values(self.method.critic, batch.states, batch.robot_agents, batch.operator_agents, batch.local)
        losses = []
        for i, (role, rows) in enumerate(zip(roles, batch.rows)):
            if role.n:
                error = values[i] - self.method.scale.normal(i, role.returns[rows])
                losses.append((error**2).mean(dim=1).sum() / role.n)
        return _mean(losses)


def _rows_in(state_of, states):
    """Rows whose state is among the sorted `states`."""
    first, last = np.searchsorted(state_of, states), np.searchsorted(state_of, states, side="right")
    return np.concatenate([np.arange(a, b) for a, b in zip(first, last)]) if len(states) else np.zeros(0, np.int64)


def _mean(losses):
    return torch.stack(losses).mean() if losses else torch.zeros(())


def _normal(advantage, free):
    """Zero mean and unit spread among those who had a choice; the others learn nothing from theirs."""
    if not free.any():
        return np.zeros(len(advantage), np.float32)
    kept = advantage[free]
    return ((advantage - kept.mean()) / (kept.std() + 1e-8)).astype(np.float32)
