"""IPPO: MAPPO's actors, each with a critic that sees its own state alone."""

import torch
from torch import Tensor, nn

from ..critic import N_PARTS, ReturnScale
from ..networks import NODE, mlp
from ..registry import method
from ..states import N_STATE_OPERATOR, N_STATE_ROBOT, OWN_TIME, States
from .mappo import OperatorMLP, RobotMLP


class LocalCritic(nn.Module):
    """Values out of the agent's own state and the clock."""

    def __init__(self):
        super().__init__()
        self.robot = mlp(N_STATE_ROBOT + OWN_TIME, NODE, N_PARTS, 0.1)
        self.operator = mlp(N_STATE_OPERATOR + OWN_TIME, NODE, N_PARTS, 0.1)

    def forward(self, states: States) -> tuple[Tensor, Tensor]:
        """(robots' [S, R, 2], operators' [S, H, 2]) values."""
        clock = states.mission[:, None, :OWN_TIME]
        return tuple(
            value(torch.cat([agents, clock.expand(-1, agents.shape[1], -1)], dim=2))
            for value, agents in ((self.robot, states.robot), (self.operator, states.operator))
        )


@method("ippo")
class IPPO(nn.Module):
    """Local actors, local critics."""

    communicates = False

    def __init__(self):
        super().__init__()
        self.robot, self.operator = RobotMLP(), OperatorMLP()
        self.critic, self.scale = LocalCritic(), ReturnScale()
