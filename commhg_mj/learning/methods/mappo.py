"""MAPPO: multilayer perceptrons on the best few of what a robot or an operator knows, and a central critic.

Communication follows the fixed schedule (docs/learning.md).
"""

import torch
from torch import Tensor, nn

from ..critic import Critic, ReturnScale
from ..features import OPERATOR, PEER, REPORT, RESOURCE, ROBOT, TASK_EDGE
from ..heads import RobotLogits
from ..networks import NODE, bounded, linear
from ..registry import method

N_TASKS, N_PEERS, N_OPERATORS, N_REPORTS = 8, 6, 3, 8  # that fit in, the best first
VALUE_RATE, IS_HELD = TASK_EDGE.index("value_rate"), TASK_EDGE.index("is_held")
FRESH, GAIN = PEER.index("age_long"), REPORT.index("gain")
FIRST = 1e3  # rank above any value rate
LEFT_OUT = -30.0  # logit of what does not fit in: hardly ever chosen


def perceptron(n_in: int, n_out: int) -> nn.Sequential:
    """Two hidden layers."""
    return nn.Sequential(linear(n_in, NODE), nn.ReLU(), linear(NODE, NODE), nn.ReLU(), linear(NODE, n_out, 0.01))


class RobotMLP(nn.Module):
    """All robots' policy: KEEP, IDLE or one of the tasks that promise most per second."""

    def __init__(self):
        super().__init__()
        width = ROBOT.width + N_TASKS * (TASK_EDGE.width + 1) + N_PEERS * (PEER.width + 1) + N_OPERATORS * RESOURCE.width
        self.net = perceptron(width, 2 + N_TASKS)

    def forward(self, graphs, public: Tensor) -> RobotLogits:
        # What may be chosen or is held comes first: nothing else needs a score.
        rank = graphs.task_edge[:, VALUE_RATE] + FIRST * (graphs.task_legal | (graphs.task_edge[:, IS_HELD] > 0))
        tasks, picked = best_edges(graphs.task_ptr, graphs.rows, graphs.task_edge, rank, N_TASKS)
        peers, _ = best_edges(graphs.peer_ptr, graphs.peer_rows, graphs.peer_edge, graphs.peer_edge[:, FRESH], N_PEERS)
        operators = fit(graphs.resource, N_OPERATORS)
        out = bounded(self.net(torch.cat([graphs.itself, tasks, peers, operators], dim=1)))
        score = out.new_full((len(graphs.rows),), LEFT_OUT)
        is_there = picked >= 0
        score = score.index_put((picked[is_there],), out[:, 2:][is_there])
        return RobotLogits(score, out[:, :2], None, None, None)


class OperatorMLP(nn.Module):
    """All operators' policy: KEEP, REST or one of the robots that gain most by control."""

    def __init__(self):
        super().__init__()
        self.net = perceptron(OPERATOR.width + N_REPORTS * (REPORT.width + 1), 2 + N_REPORTS)

    def forward(self, graphs) -> Tensor:
        k, r = graphs.legal.shape
        gain = torch.where(graphs.known, graphs.report[..., GAIN], -2.0)
        order = gain.argsort(dim=1, descending=True, stable=True)[:, :N_REPORTS]
        reports = torch.cat([graphs.report, graphs.known[..., None].float()], dim=2)
        best = reports.gather(1, order[..., None].expand(-1, -1, reports.shape[2]))
        out = bounded(self.net(torch.cat([graphs.itself, fit(best, N_REPORTS)], dim=1)))
        score = out.new_full((k, r), LEFT_OUT).scatter(1, order, out[:, 2 : 2 + order.shape[1]])
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


def fit(rows: Tensor, k: int) -> Tensor:
    """[N, k F]: the first k of rows [N, n, F], zeros where there are fewer."""
    n, count, width = rows.shape
    rows = rows[:, :k]
    return torch.cat([rows, rows.new_zeros(n, max(0, k - count), width)], dim=1).flatten(1)


@method("mappo")
class MAPPO(nn.Module):
    """Local actors, central critic."""

    communicates = False

    def __init__(self):
        super().__init__()
        self.robot, self.operator = RobotMLP(), OperatorMLP()
        self.critic, self.scale = Critic(), ReturnScale()
