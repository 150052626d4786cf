"""PPO over decisions of both roles (paper, section III-C and D): one joint ratio a robot decision, clipped once."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import nn

from .batches import legal_picks, operator_batch, pick_robots, robot_batch
from .critic import Agents
from .heads import RobotChoices, judge_operators, judge_robots, tensors_of
from .rollout import Experience
from .states import States


@dataclass(frozen=True)
class Hyper:
    """Numbers of the learning algorithm, the same for every learned method."""

    gamma: float = 0.998  # a second
    lam: float = 0.95  # a decision
    clip: float = 0.2
    epochs: int = 4
    decisions: int = 8192  # of robots, an update
    minibatches: int = 8
    learning_rate: float = 3e-4
    entropy: float = 0.003  # weight of the relative entropy
    value: float = 0.5  # weight of the critic's loss
    max_grad: float = 0.5
    target_kl: float = 0.03  # a minibatch beyond it ends the update

    @classmethod
    def of(cls, n_robots: int) -> "Hyper":
        """For a team: it shares one reward, so the more decide, the noisier each one's share of an update is."""
        return cls(decisions=max(cls.decisions, 1024 * n_robots))


class Learner:
    """Optimises a method's actors and critic."""

    def __init__(self, method, hyper: Hyper):
        self.method, self.hyper = method, hyper
        self.optimizer = torch.optim.Adam(method.parameters(), lr=hyper.learning_rate, eps=1e-5)

    def set_rate(self, share: float) -> None:
        """Learn at a share of the plan's rate."""
        for group in self.optimizer.param_groups:
            group["lr"] = self.hyper.learning_rate * max(0.05, share)

    def update(self, data: Experience, rng, is_cloning=False) -> dict:
        """Some epochs over the experience; `is_cloning` follows the remembered choices instead of their advantages."""
        hyper, method = self.hyper, self.method
        for role, returns in enumerate((data.robot_return, data.operator_return)):
            method.scale.update(role, torch.from_numpy(returns).float())
        advantages = [_normal(a.sum(axis=1)) for a in (data.robot_advantage, data.operator_advantage)]
        old = [torch.from_numpy(log_prob) for log_prob in (data.robot_log_prob, data.operator_log_prob)]
        stats = []
        # Nobody decides in some states; a minibatch of nobody teaches nothing.
        alive = np.union1d(data.robot_state, data.operator_state)
        for _ in range(hyper.epochs):
            for states in np.array_split(rng.permutation(alive), min(hyper.minibatches, len(alive))):
                stats.append(self._step(data, np.sort(states), advantages, old, is_cloning))
                if not is_cloning and stats[-1]["kl"] > hyper.target_kl:
                    return _means(stats)
        return _means(stats)

    def _step(self, data, states, advantages, old, is_cloning):
        hyper, method = self.hyper, self.method
        robots, operators = _rows_in(data.robot_state, states), _rows_in(data.operator_state, states)
        new = [self._judge_robots(data, robots, is_cloning), self._judge_operators(data, operators)]
        losses, entropies, kls = [], [], []
        for role, (rows, now) in enumerate(zip((robots, operators), new)):
            free = now.is_free
            if not free.any():
                continue
            if is_cloning:
                losses.append(-now.log_prob[free].mean())
            else:
                advantage = advantages[role][rows][free]
                log_ratio = now.log_prob[free] - old[role][rows][free]
                ratio = log_ratio.exp()
                clipped = ratio.clamp(1.0 - hyper.clip, 1.0 + hyper.clip)
                losses.append(-torch.min(ratio * advantage, clipped * advantage).mean())
                kls.append(float((ratio - 1.0 - log_ratio).detach().mean()))
            entropies.append(now.entropy[free].mean())
        value_loss = self._value_loss(data, states, robots, operators)
        policy_loss, entropy = _mean(losses), _mean(entropies)
        loss = policy_loss - hyper.entropy * entropy + hyper.value * value_loss
        self.optimizer.zero_grad()
        loss.backward()
        norm = nn.utils.clip_grad_norm_(method.parameters(), hyper.max_grad)
        self.optimizer.step()
        return {
            "policy_loss": policy_loss.item(), "value_loss": value_loss.item(), "entropy": entropy.item(),
            "kl": float(np.mean(kls)) if kls else 0.0, "grad_norm": norm.item(),
        }  # fmt: skip

    def _value_loss(self, data, states, robots, operators):
        method = self.method
        at = (data.robot_state, data.robots.robot, robots), (data.operator_state, data.operators.operator, operators)
        asked = [
            Agents(torch.from_numpy(np.searchsorted(states, state[rows])), torch.from_numpy(agent[rows]))
            for state, agent, rows in at
        ]
        values = method.critic(States(*(torch.from_numpy(array[states]) for array in data.states)), *asked)
        losses = []
        for role, (returns, rows) in enumerate(((data.robot_return, robots), (data.operator_return, operators))):
            if len(rows):
                target = method.scale.normal(role, torch.from_numpy(returns[rows]).float())
                losses.append(((values[role] - target) ** 2).mean())
        return _mean(losses)

    def _judge_robots(self, data, rows, is_cloning):
        graphs, shift = pick_robots(data.robots, rows)
        # Only the worlds of the minibatch are encoded.
        worlds, index = np.unique(graphs.mission, return_inverse=True)
        batch = robot_batch(graphs._replace(mission=index), data.public.shape[1])
        public = torch.from_numpy(data.public[worlds].reshape(-1, data.public.shape[2]))
        task, *others = (column[rows] for column in data.robot_choices)
        choices = tensors_of(RobotChoices(np.where(task >= 0, task + shift, task), *others))
        logits = self.method.robot(batch, public)
        # The teacher never asks: from it nobody learns when to.
        return judge_robots(logits._replace(query=None) if is_cloning else logits, batch, choices)

    def _judge_operators(self, data, rows):
        graphs = operator_batch(data.operators, rows)
        return judge_operators(self.method.operator(graphs), legal_picks(graphs), torch.from_numpy(data.operator_choices[rows]))


def _rows_in(state_of, states):
    """Rows whose state is among the sorted `states`."""
    first, last = np.searchsorted(state_of, states), np.searchsorted(state_of, states, side="right")
    return np.concatenate([np.arange(a, b) for a, b in zip(first, last)]) if len(states) else np.zeros(0, np.int64)


def _mean(losses):
    return torch.stack(losses).mean() if losses else torch.zeros(())


def _normal(advantage):
    if not len(advantage):  # nobody of this role
        return torch.zeros(0)
    return torch.from_numpy((advantage - advantage.mean()) / (advantage.std() + 1e-8)).float()


def _means(stats):
    return {name: float(np.mean([row[name] for row in stats])) for name in stats[0]}
