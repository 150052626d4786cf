"""IPPO: MAPPO's actors, each with a critic that reads what its actor reads (Yu et al. 2022)."""

from torch import Tensor, nn

from ..critic import N_PARTS
from ..networks import NODE, mlp
from ..registry import Method, method
from .mappo import ABOUT, OPERATOR_WIDTH, ROBOT_WIDTH, OperatorMLP, RobotMLP, read_reports, read_robot


class LocalCritic(nn.Module):
    """Values out of an actor's own inputs."""

    reads = "local"

    def __init__(self):
        super().__init__()
        self.robot, self.operator = mlp(ROBOT_WIDTH, NODE, N_PARTS, 0.1), mlp(OPERATOR_WIDTH, NODE, N_PARTS, 0.1)

    def forward(self, robots, public: Tensor, operators) -> tuple[Tensor, Tensor]:
        """(robots' [n, 2], operators' [k, 2]) values out of what `critic.Local` says."""
        return self.robot(read_robot(robots)[0]), self.operator(read_reports(operators)[0])


@method("ippo")
class IPPO(Method):
    """Local actors, local critics."""

    about = ABOUT._replace(critic="what its actor reads")

    def __init__(self):
        super().__init__(RobotMLP(), OperatorMLP(), LocalCritic())
