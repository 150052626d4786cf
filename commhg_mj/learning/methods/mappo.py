"""MAPPO: multilayer perceptrons on the best few of what a robot or an operator knows, and a central critic (Yu et al. 2022).

Communication follows the fixed schedule (docs/learning.md).
"""

import torch
from torch import Tensor, nn

from ..critic import N_PARTS, Agents, judge_roles, mean_agents
from ..features import OPERATOR, PEER, REPORT, RESOURCE, ROBOT, TASK_EDGE
from ..heads import LEFT_OUT, RobotLogits
from ..networks import NODE, bounded, linear, pick
from ..registry import About, Method, method
from ..state_features import STATE_MISSION, STATE_OPERATOR, STATE_ROBOT, STATE_TASK
from ..states import States

N_TASKS, N_PEERS, N_OPERATORS, N_REPORTS = 16, 8, 3, 16  # that fit in, the best first
VALUE_RATE, IS_HELD = TASK_EDGE.index("value_rate"), TASK_EDGE.index("is_held")
FRESH, GAIN = PEER.index("age_long"), REPORT.index("gain")
MINE, KNOWN, HEARD = RESOURCE.index("controls_me"), RESOURCE.index("age_known"), RESOURCE.index("age_long")
ENGAGED = RESOURCE.columns("bidding", "holding")
FIRST = 1e3  # rank above any value rate
CRITIC = 256  # units of a layer

ROBOT_WIDTH = ROBOT.width + N_TASKS * (TASK_EDGE.width + 1) + N_PEERS * (PEER.width + 1) + N_OPERATORS * RESOURCE.width
OPERATOR_WIDTH = OPERATOR.width + N_REPORTS * (REPORT.width + 1)
ABOUT = About(
    source="Yu et al., The Surprising Effectiveness of PPO in Cooperative Multi-Agent Games, 2022; its released code",
    reads="own state, the best 16 tasks, 8 peers, 3 operators; 16 reports",
    relations="none: a perceptron on a list",
    heads="fixed schedule",
    critic="true state: mean rows, mission, the agent's own row",
    inferred="what fits in and its order; feed-forward",
)


def perceptron(n_in: int, n_out: int, width: int = NODE, gain: float = 0.01) -> nn.Sequential:
    """Two hidden layers."""
    return nn.Sequential(linear(n_in, width), nn.ReLU(), linear(width, width), nn.ReLU(), linear(width, n_out, gain))


def read_robot(graphs) -> tuple[Tensor, Tensor]:
    """(what robots' perceptrons read [N, ROBOT_WIDTH], the edges of the tasks in it [N, N_TASKS], -1: none)."""
    # What may be chosen or is held comes first: nothing else needs a score.
    rank = graphs.task_edge[:, VALUE_RATE] + FIRST * (graphs.task_legal | (graphs.task_edge[:, IS_HELD] > 0))
    tasks, picked = best_edges(graphs.task_ptr, graphs.rows, graphs.task_edge, rank, N_TASKS)
    peers, _ = best_edges(graphs.peer_ptr, graphs.peer_rows, graphs.peer_edge, graphs.peer_edge[:, FRESH], N_PEERS)
    # The own operator, then who was heard of to be free, then the others, the newest records first.
    operators = graphs.resource
    is_free = operators[..., KNOWN] * (pick(operators, ENGAGED).sum(dim=2) == 0)
    operators, _ = best_rows(operators, 4.0 * operators[..., MINE] + 2.0 * is_free + operators[..., HEARD], N_OPERATORS)
    return torch.cat([graphs.itself, tasks, peers, operators], dim=1), picked


def read_reports(graphs) -> tuple[Tensor, Tensor]:
    """(what operators' perceptrons read [K, OPERATOR_WIDTH], the robots of the reports in it [K, at most N_REPORTS])."""
    gain = torch.where(graphs.known, graphs.report[..., GAIN], -2.0)
    reports, order = best_rows(torch.cat([graphs.report, graphs.known[..., None].float()], dim=2), gain, N_REPORTS)
    return torch.cat([graphs.itself, reports], dim=1), order


class RobotMLP(nn.Module):
    """All robots' policy: KEEP, IDLE or one of the tasks that promise most per second."""

    def __init__(self):
        super().__init__()
        self.net = perceptron(ROBOT_WIDTH, 2 + N_TASKS)

    def forward(self, graphs, public: Tensor) -> RobotLogits:
        read, picked = read_robot(graphs)
        out, is_there = bounded(self.net(read)), picked >= 0
        score = out.new_full((len(graphs.rows),), LEFT_OUT).index_put((picked[is_there],), out[:, 2:][is_there])
        return RobotLogits(score, out[:, :2], None, None, None)


class OperatorMLP(nn.Module):
    """All operators' policy: KEEP, REST or one of the robots that gain most by control."""

    def __init__(self):
        super().__init__()
        self.net = perceptron(OPERATOR_WIDTH, 2 + N_REPORTS)

    def forward(self, graphs) -> Tensor:
        read, order = read_reports(graphs)
        out = bounded(self.net(read))
        score = out.new_full(graphs.legal.shape, LEFT_OUT).scatter(1, order, out[:, 2 : 2 + order.shape[1]])
        return torch.cat([out[:, :2], score], dim=1)


def best_edges(ptr: Tensor, rows: Tensor, edges: Tensor, rank: Tensor, k: int) -> tuple[Tensor, Tensor]:
    """(features [N, k (F + 1)] of each row's k edges of the highest rank, with a flag; their numbers [N, k], -1: none)."""
    n = len(ptr) - 1
    # By row, then by rank: ranks are small numbers.
    order = (rows.double() * 1e6 - rank.double()).argsort(stable=True)
    place = torch.arange(len(rows), device=rows.device) - ptr[rows]
    kept = place < k
    picked = rows.new_full((n, k), -1).index_put((rows[kept], place[kept]), order[kept])
    is_there = (picked >= 0)[..., None]
    padded = torch.cat([edges, edges.new_zeros(1, edges.shape[1])])
    features = padded[picked]  # -1 is the row of zeros
    return torch.cat([features, is_there.float()], dim=2).flatten(1), picked


def best_rows(rows: Tensor, rank: Tensor, k: int) -> tuple[Tensor, Tensor]:
    """([N, k F] of rows [N, n, F] the k of the highest rank [N, n], zeros where there are fewer; which they are)."""
    order = rank.argsort(dim=1, descending=True, stable=True)[:, :k]
    best = rows.gather(1, order[..., None].expand(-1, -1, rows.shape[2]))
    return torch.cat([best, rows.new_zeros(len(rows), k - order.shape[1], rows.shape[2])], dim=1).flatten(1), order


class CentralCritic(nn.Module):
    """Values out of the true state: the mean of each kind's rows, the mission's, and the agent's own."""

    reads = "state"

    def __init__(self):
        super().__init__()
        pooled = STATE_ROBOT.width + STATE_OPERATOR.width + STATE_TASK.width + 1 + STATE_MISSION.width
        self.robot, self.operator = (
            perceptron(pooled + group.width, N_PARTS, CRITIC, 0.1) for group in (STATE_ROBOT, STATE_OPERATOR)
        )

    def forward(self, states: States, robots: Agents, operators: Agents) -> tuple[Tensor, Tensor]:
        """(robots' [n, 2], operators' [k, 2]) values in states of tensors."""
        count = states.is_open.float().sum(dim=1, keepdim=True)
        tasks = (states.task * states.is_open[..., None]).sum(dim=1) / count.clamp(min=1)
        means = mean_agents(states.robot), mean_agents(states.operator), tasks, count / states.task.shape[1]
        pooled = torch.cat([*means, states.mission], dim=1)
        return judge_roles(pooled, (self.robot, states.robot, robots), (self.operator, states.operator, operators))


@method("mappo")
class MAPPO(Method):
    """Local actors, central critic."""

    about = ABOUT

    def __init__(self):
        super().__init__(RobotMLP(), OperatorMLP(), CentralCritic())
