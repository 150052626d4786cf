"""IPPO: MAPPO's actors, each with a critic that sees its own state alone."""

import torch
from torch import Tensor, nn

from ..critic import N_PARTS, Agents, ReturnScale, pick_agents
from ..features import STATE_MISSION, STATE_OPERATOR, STATE_ROBOT
from ..networks import NODE, mlp
from ..registry import method
from ..states import States
from .mappo import OperatorMLP, RobotMLP

CLOCK = STATE_MISSION.columns("time", "time_left")


class LocalCritic(nn.Module):
    """Values out of the agent's own state and the clock."""

    def __init__(self):
        super().__init__()
        self.robot = mlp(STATE_ROBOT.width + len(CLOCK), NODE, N_PARTS, 0.1)
        self.operator = mlp(STATE_OPERATOR.width + len(CLOCK), NODE, N_PARTS, 0.1)

    def forward(self, states: States, robots: Agents, operators: Agents) -> tuple[Tensor, Tensor]:
        """(robots' [n, 2], operators' [k, 2]) values in states of tensors."""
        clock = torch.stack([states.mission[:, column] for column in CLOCK], dim=1)
        roles = (self.robot, states.robot, robots), (self.operator, states.operator, operators)
        return tuple(
            value(torch.cat([pick_agents(agents, at), clock.index_select(0, at.state)], dim=1)) for value, agents, at in roles
        )


@method("ippo")
class IPPO(nn.Module):
    """Local actors, local critics."""

    communicates = False

    def __init__(self):
        super().__init__()
        self.robot, self.operator = RobotMLP(), OperatorMLP()
        self.critic, self.scale = LocalCritic(), ReturnScale()
