"""CommHG: a communication-conditioned graph policy (paper, section III-B and C)."""

import torch
from torch import Tensor, nn

from ..critic import Critic, ReturnScale
from ..features import OPERATOR, PEER, PUBLIC, REPORT, RESOURCE, ROBOT, TASK_EDGE
from ..heads import RobotLogits
from ..networks import MESSAGE, NODE, Relation, Update, after, bounded, head, linear, mlp
from ..ragged import Edges, edges_where
from ..registry import method

ROUNDS = 2
IS_KNOWN = RESOURCE.index("age_known")
RARELY = 3.0  # logit of nobody at first: a query displaces telemetry


class RobotActor(nn.Module):
    """All robots' policy: relations to tasks, peers and operators, two updates, five heads.

    What a robot has heard of operators reaches every head, for an operator who is busy changes which task is worth taking
    (paper, case study); the paper names the two other relations only.
    """

    def __init__(self):
        super().__init__()
        self.itself, self.attributes = mlp(ROBOT.width, NODE, NODE), linear(PUBLIC.width, MESSAGE)
        self.task = linear(MESSAGE, NODE)
        self.peer, self.operator = linear(PEER.width, NODE), linear(RESOURCE.width, NODE)
        self.tasks, self.peers, self.operators = Relation(TASK_EDGE.width), Relation(PEER.width), Relation(RESOURCE.width)
        self.update = Update(3)
        self.score_task, self.score_edge = linear(NODE, MESSAGE), linear(TASK_EDGE.width, MESSAGE)
        self.score_robot, self.score = linear(NODE, MESSAGE, bias=False), linear(MESSAGE, 1, 0.01)
        self.keep_idle, self.gate, self.assist = head(NODE, 2), head(NODE, 1), head(NODE, 1)
        self.query_robot, self.query_operator = linear(NODE, MESSAGE), linear(NODE, MESSAGE, bias=False)
        self.query, self.nobody = linear(MESSAGE, 1, 0.01), head(NODE, 1)
        nn.init.constant_(self.nobody[2].bias, RARELY)

    def forward(self, graphs, public: Tensor) -> RobotLogits:
        """Logits of N robots.

        Args:
          graphs: `batches.RobotBatch`. public: [tasks, PUBLIC.width].
        """
        attributes = torch.relu(self.attributes(public))
        task_edges = Edges(graphs.task_ptr, graphs.task)
        node = self.embed(graphs, task_edges, attributes)
        score = task_edges.score(
            self.score_edge(graphs.task_edge), after(self.score_task, self.task, attributes), self.score_robot(node),
            self.score.weight[0],
        ) + self.score.bias  # fmt: skip
        # To keep a task is to choose it once more.
        own = torch.where(graphs.own_edge >= 0, score[graphs.own_edge.clamp(min=0)], 0.0) if len(score) else 0.0
        keep_idle = self.keep_idle(node)
        keep_idle = torch.stack([keep_idle[:, 0] + own, keep_idle[:, 1]], dim=1)
        operators = after(self.query_operator, self.operator, graphs.resource) + self.query_robot(node)[:, None]
        query = torch.cat([self.nobody(node), self.query(torch.relu(operators))[..., 0]], dim=1)
        return RobotLogits(
            bounded(score), bounded(keep_idle), bounded(self.gate(node)[:, 0]), bounded(query), bounded(self.assist(node)[:, 0])
        )

    def embed(self, graphs, task_edges: Edges, attributes: Tensor) -> Tensor:
        """[N, NODE] of robots out of their local graphs."""
        node = self.itself(graphs.itself)
        is_known = graphs.resource[..., IS_KNOWN] > 0.0
        peer_edges, operator_edges = Edges(graphs.peer_ptr), edges_where(is_known)
        tasks, edges = after(self.tasks.source, self.task, attributes), self.tasks.edge(graphs.task_edge)
        peers = self.peers.of_records(self.peer, graphs.peer_edge)
        operators = self.operators.of_records(self.operator, graphs.resource[is_known])
        for _ in range(ROUNDS):
            node = self.update(
                node, self.tasks(task_edges, edges, tasks, node), self.peers(peer_edges, peers, None, node),
                self.operators(operator_edges, operators, None, node),
            )  # fmt: skip
        return node


class OperatorActor(nn.Module):
    """All operators' policy: the report relation, two updates, a score a robot."""

    def __init__(self):
        super().__init__()
        self.itself, self.report = mlp(OPERATOR.width, NODE, NODE), linear(REPORT.width, NODE)
        self.reports, self.update = Relation(REPORT.width), Update(1)
        self.score_report, self.score_operator = linear(NODE, MESSAGE), linear(NODE, MESSAGE, bias=False)
        self.score, self.keep_rest = linear(MESSAGE, 1, 0.01), head(NODE, 2)

    def forward(self, graphs) -> Tensor:
        """[K, 2 + R] logits of KEEP, REST and the robots, of `OperatorGraphs` of tensors."""
        edges = edges_where(graphs.known)
        records, node = graphs.report[graphs.known], self.itself(graphs.itself)
        reports = self.reports.of_records(self.report, records)
        for _ in range(ROUNDS):
            node = self.update(node, self.reports(edges, reports, None, node))
        known = edges.score(
            after(self.score_report, self.report, records), None, self.score_operator(node), self.score.weight[0]
        ) + self.score.bias  # fmt: skip
        score = known.new_zeros(graphs.known.shape).masked_scatter(graphs.known, known)
        own = score.gather(1, graphs.held.clamp(min=0)[:, None])[:, 0]
        keep_rest = self.keep_rest(node)
        keep = keep_rest[:, 0] + torch.where(graphs.held >= 0, own, 0.0)
        return bounded(torch.cat([keep[:, None], keep_rest[:, 1:], score], dim=1))


@method("commhg")
class CommHG(nn.Module):
    """Two actors, a critic, learned communication."""

    communicates = True

    def __init__(self):
        super().__init__()
        self.robot, self.operator = RobotActor(), OperatorActor()
        self.critic, self.scale = Critic(), ReturnScale()
