"""What a method makes of the planner's numbers: scores added to those of its own networks, whatever these are."""

import torch
from torch import Tensor, nn
from torch.nn import functional

from ..base.terms import KEEP
from .features import PLAN, PLAN_EDGE, ROBOT, TASK_EDGE
from .heads import RobotLogits, keep_as_chosen
from .networks import bounded, linear

WIDTH = 64
IS_PICK, IS_CANDIDATE, IDLES = PLAN_EDGE.index("is_pick"), PLAN_EDGE.index("is_candidate"), PLAN.index("idles")
BEYOND = 50.0  # logits that keep a choice from being the best


class PlanReader(nn.Module):
    """Robots' scores for each task and for idling, operators' for the planner's choice. What is said is the planner's, too.

    Attributes:
      trust: [2] what the planner's choice gets beside its score, a robot's and an operator's: another must promise so much
        more, for what seems best among many is best by luck in part.
      bounds: 1 if robots choose among the planner's candidates, whose worths were learned; else 0.
    """

    def __init__(self):
        super().__init__()
        own = PLAN.width + ROBOT.width
        self.robot, self.edge = linear(own, WIDTH, bias=False), linear(PLAN_EDGE.width + TASK_EDGE.width, WIDTH)
        self.between, self.score = linear(WIDTH, WIDTH // 2), linear(WIDTH // 2, 1, 0.01)
        self.own = nn.Sequential(linear(own, WIDTH), nn.ReLU(), linear(WIDTH, 2, 0.01))
        self.pick = nn.Parameter(torch.zeros(()))  # score of the operator's choice that the planner would make
        self.register_buffer("trust", torch.zeros(2))
        self.register_buffer("bounds", torch.zeros(()))

    def operators(self, graphs, logits: Tensor) -> Tensor:
        """The logits [K, 2 + R] of `OperatorGraphs` of tensors with these scores."""
        column = torch.where(graphs.plan >= 0, graphs.plan + 2, torch.where(graphs.plan == KEEP, 0, 1))
        return logits + (self.pick + self.trust[1]) * functional.one_hot(column, logits.shape[1])

    def robots(self, graphs, logits: RobotLogits) -> RobotLogits:
        """The logits of a `batches.RobotBatch` with these scores."""
        own = torch.cat([graphs.plan, graphs.itself], dim=1)
        edges = torch.cat([graphs.plan_edge, graphs.task_edge], dim=1)
        hidden = torch.relu(self.edge(edges) + self.robot(own)[graphs.rows])
        beyond = BEYOND * self.bounds
        score = bounded(self.score(torch.relu(self.between(hidden)))[:, 0])
        score = score + self.trust[0] * graphs.plan_edge[:, IS_PICK] - beyond * (1.0 - graphs.plan_edge[:, IS_CANDIDATE])
        keep_idle = keep_as_chosen(bounded(self.own(own)), score, graphs.own_edge)
        idle = (self.trust[0] + beyond) * graphs.plan[:, IDLES] - beyond
        keep_idle = keep_idle + torch.stack([torch.zeros_like(idle), idle], dim=1)
        return RobotLogits(logits.task + score, logits.keep_idle + keep_idle, None, None, None)
