"""Critics: the central one, a graph over the full true state with four heads (paper, section III-D). Never used in execution.

A critic `reads` the true "state" of all, or the "local" graphs that the actors read, as IPPO's does.
"""

from typing import NamedTuple

import torch
from torch import Tensor, nn

from .networks import MESSAGE, NODE, linear, mlp
from .state_features import STATE_MISSION, STATE_OPERATOR, STATE_ROBOT, STATE_TASK
from .states import States

N_PARTS = 2  # of the reward: mission, coordination


class Agents(NamedTuple):
    """Whose values are asked for."""

    state: Tensor  # [n] i8 row of the states
    agent: Tensor  # [n] i8 number within its role


class Local(NamedTuple):
    """What those whose values are asked for see, as tensors."""

    robots: NamedTuple  # batches.RobotBatch
    public: Tensor  # [tasks, PUBLIC.width]
    operators: NamedTuple  # graphs.OperatorGraphs


def judge_values(critic: nn.Module, states: States, robots: Agents, operators: Agents, local: Local) -> tuple[Tensor, Tensor]:
    """(robots' [n, 2], operators' [k, 2]) values by what the critic reads; `local` has a row for each of them."""
    return critic(*local) if critic.reads == "local" else critic(states, robots, operators)


class Critic(nn.Module):
    """Values of both roles' agents, mission and coordination apart, in units of `ReturnScale`.

    A state is encoded once for all who decide in it; only what belongs to a deciding agent is done per decision.
    """

    reads = "state"

    def __init__(self):
        super().__init__()
        self.robot, self.operator = linear(STATE_ROBOT.width, NODE), linear(STATE_OPERATOR.width, NODE)
        self.task, self.tasks = linear(STATE_TASK.width, MESSAGE), linear(MESSAGE, NODE)
        self.robot_node, self.operator_node = linear(NODE, NODE), linear(NODE, NODE)
        self.context = mlp(3 * NODE + STATE_MISSION.width + 1, NODE, NODE)
        self.robot_value, self.operator_value = (mlp(2 * NODE, NODE, N_PARTS, 0.1) for _ in range(2))

    def forward(self, states: States, robots: Agents, operators: Agents) -> tuple[Tensor, Tensor]:
        """(robots' [n, 2], operators' [k, 2]) values in states of tensors."""
        hidden = torch.relu(self.robot(states.robot)), torch.relu(self.operator(states.operator))
        is_open = states.is_open[..., None].float()
        count = is_open.sum(dim=1)
        # The last layer after the mean, as in networks.Relation.
        tasks = (torch.relu(self.task(states.task)) * is_open).sum(dim=1) / count.clamp(min=1)
        tasks = self.tasks(tasks) * (count > 0).float()
        nodes = self.robot_node, self.operator_node
        means = [node(mean_agents(agents)) for node, agents in zip(nodes, hidden)]
        context = torch.relu(self.context(torch.cat([*means, tasks, states.mission, count / states.task.shape[1]], dim=1)))
        values = self.robot_value, self.operator_value
        return tuple(
            value(torch.cat([torch.relu(node(pick_agents(agents, at))), context.index_select(0, at.state)], dim=1))
            for value, node, agents, at in zip(values, nodes, hidden, (robots, operators))
        )


def pick_agents(agents: Tensor, at: Agents) -> Tensor:
    """[n, F] of agents [S, A, F]."""
    return agents.flatten(0, 1).index_select(0, at.state * agents.shape[1] + at.agent)


def judge_roles(context: Tensor, *roles: tuple[nn.Module, Tensor, Agents]) -> tuple[Tensor, ...]:
    """Each role's values out of the contexts [S, C] of its agents' states and of their own rows.

    Args:
      roles: (network, rows of all its agents [S, A, F], whose values are asked for) each.
    """
    return tuple(
        value(torch.cat([context.index_select(0, at.state), pick_agents(rows, at)], dim=1)) for value, rows, at in roles
    )


def mean_agents(agents: Tensor) -> Tensor:
    """[S, F] of agents [S, A, F]; zeros where a mission has none."""
    return agents.mean(dim=1) if agents.shape[1] else agents.new_zeros(len(agents), agents.shape[2])


class ReturnScale(nn.Module):
    """Running mean and spread of returns, a role and a part each; the critic learns in these units."""

    def __init__(self):
        super().__init__()
        for name, value in (("mean", 0.0), ("square", 0.0), ("weight", 0.0)):
            self.register_buffer(name, torch.full((2, N_PARTS), value))

    @torch.no_grad()
    def update(self, role: int, returns: Tensor, rate: float = 0.05) -> None:
        """Take in returns [n, 2] of one role."""
        if len(returns):
            for total, value in ((self.mean, returns.mean(dim=0)), (self.square, (returns**2).mean(dim=0))):
                total[role] += rate * (value - total[role])
            self.weight[role] += rate * (1.0 - self.weight[role])

    def _moments(self, role):
        weight = self.weight[role].clamp(min=1e-6)
        mean = self.mean[role] / weight
        return mean, (self.square[role] / weight - mean**2).clamp(min=1e-6).sqrt()

    def normal(self, role: int, returns: Tensor) -> Tensor:
        """Returns in the critic's units."""
        mean, spread = self._moments(role)
        return (returns - mean) / spread

    def real(self, role: int, values: Tensor) -> Tensor:
        """The critic's values in units of reward."""
        if self.weight[role, 0] == 0:
            return torch.zeros_like(values)
        mean, spread = self._moments(role)
        return values * spread + mean
