"""CommHG: a communication-conditioned graph policy (paper, section III-B and C). Its ablations change the class's attributes."""

import torch
from torch import Tensor, nn

from ..critic import Critic
from ..features import OPERATOR, PEER, PUBLIC, REPORT, RESOURCE, ROBOT, TASK_EDGE, Group
from ..heads import RobotLogits, hold_as_chosen, keep_as_chosen
from ..networks import MESSAGE, NODE, Relation, Update, after, bounded, head, linear, mlp, pick
from ..ragged import Edges, edges_where
from ..registry import About, Method, method

ROUNDS = 2
IS_KNOWN = RESOURCE.index("age_known")
RARELY = 3.0  # logit of nobody at first: a query displaces telemetry


class Reading(nn.Module):
    """The columns of a group that a network reads."""

    def __init__(self, group: Group, leaves_out: tuple[str, ...]):
        super().__init__()
        self.columns = [i for i, feature in enumerate(group.features) if feature.kind not in leaves_out]
        self.width, self.whole = len(self.columns), not leaves_out

    def forward(self, rows: Tensor) -> Tensor:
        return rows if self.whole else pick(rows, self.columns)


class RobotActor(nn.Module):
    """All robots' policy: relations to tasks, peers and operators, two updates, five heads.

    What a robot has heard of operators reaches every head, for an operator who is busy changes which task is worth taking
    (paper, case study); the paper names the two other relations only.

    Args:
      relations: along which messages pass.
      asks: there is a query head.
      every_record: messages come from all, heard of or not.
      leaves_out: kinds of features that edges do not have.
    """

    def __init__(self, relations=("tasks", "peers", "operators"), asks=True, every_record=False, leaves_out=()):
        super().__init__()
        self.asks, self.every_record = asks, every_record
        self.edge, self.peer_columns, self.resource = (Reading(group, leaves_out) for group in (TASK_EDGE, PEER, RESOURCE))
        self.itself, self.attributes = mlp(ROBOT.width, NODE, NODE), linear(PUBLIC.width, MESSAGE)
        self.task = linear(MESSAGE, NODE)
        if "operators" in relations or asks:
            self.operator = linear(self.resource.width, NODE)
        if "peers" in relations:
            self.peer = linear(self.peer_columns.width, NODE)
        widths = {"tasks": self.edge.width, "peers": self.peer_columns.width, "operators": self.resource.width}
        self.relations = nn.ModuleDict({name: Relation(widths[name]) for name in relations})
        self.update = Update(len(relations))
        self.score_task, self.score_edge = linear(NODE, MESSAGE), linear(self.edge.width, MESSAGE)
        self.score_robot, self.score = linear(NODE, MESSAGE, bias=False), linear(MESSAGE, 1, 0.01)
        self.keep_idle, self.gate, self.assist = head(NODE, 2), head(NODE, 1), head(NODE, 1)
        if asks:
            self.query_robot, self.query_operator = linear(NODE, MESSAGE), linear(NODE, MESSAGE, bias=False)
            self.query, self.nobody = linear(MESSAGE, 1, 0.01), head(NODE, 1)
            nn.init.constant_(self.nobody[2].bias, RARELY)

    def forward(self, graphs, public: Tensor) -> RobotLogits:
        """Logits of N robots.

        Args:
          graphs: `batches.RobotBatch`. public: [tasks, PUBLIC.width].
        """
        attributes = torch.relu(self.attributes(public))
        task_edges, edges = Edges(graphs.task_ptr, graphs.task), self.edge(graphs.task_edge)
        node = self.embed(graphs, task_edges, edges, attributes)
        score = task_edges.score(
            self.score_edge(edges), after(self.score_task, self.task, attributes), self.score_robot(node), self.score.weight[0]
        ) + self.score.bias  # fmt: skip
        keep_idle = keep_as_chosen(self.keep_idle(node), score, graphs.own_edge)
        query = bounded(self.score_operators(graphs, node)) if self.asks else None
        return RobotLogits(
            bounded(score), bounded(keep_idle), bounded(self.gate(node)[:, 0]), query, bounded(self.assist(node)[:, 0])
        )

    def score_operators(self, graphs, node: Tensor) -> Tensor:
        """[N, 1 + H] of nobody and of each operator, by its own record."""
        operators = after(self.query_operator, self.operator, self.resource(graphs.resource)) + self.query_robot(node)[:, None]
        return torch.cat([self.nobody(node), self.query(torch.relu(operators))[..., 0]], dim=1)

    def embed(self, graphs, task_edges: Edges, edges: Tensor, attributes: Tensor) -> Tensor:
        """[N, NODE] of robots out of their local graphs."""
        node, messages = self.itself(graphs.itself), []
        if "tasks" in self.relations:
            tasks = self.relations["tasks"]
            messages.append((tasks, task_edges, tasks.edge(edges), after(tasks.source, self.task, attributes)))
        if "peers" in self.relations:
            peers, records = self.relations["peers"], self.peer_columns(graphs.peer_edge)
            messages.append((peers, Edges(graphs.peer_ptr), peers.of_records(self.peer, records), None))
        if "operators" in self.relations:
            operators, known = self.relations["operators"], graphs.resource[..., IS_KNOWN] > 0.0
            is_there = torch.ones_like(known) if self.every_record else known
            records = operators.of_records(self.operator, self.resource(graphs.resource[is_there]))
            messages.append((operators, edges_where(is_there), records, None))
        for _ in range(ROUNDS):
            node = self.update(node, *(relation(edges, edge, source, node) for relation, edges, edge, source in messages))
        return node


class OperatorActor(nn.Module):
    """All operators' policy: the report relation, two updates, a score a robot.

    Args:
      passes: messages pass along the relation.
      every_record, leaves_out: as of `RobotActor`; a robot without a report is scored like one with.
    """

    def __init__(self, passes=True, every_record=False, leaves_out=()):
        super().__init__()
        self.every_record, self.columns = every_record, Reading(REPORT, leaves_out)
        self.itself, self.report = mlp(OPERATOR.width, NODE, NODE), linear(self.columns.width, NODE)
        self.reports, self.update = Relation(self.columns.width) if passes else None, Update(int(passes))
        self.score_report, self.score_operator = linear(NODE, MESSAGE), linear(NODE, MESSAGE, bias=False)
        self.score, self.keep_rest = linear(MESSAGE, 1, 0.01), head(NODE, 2)

    def forward(self, graphs) -> Tensor:
        """[K, 2 + R] logits of KEEP, REST and the robots, of `OperatorGraphs` of tensors."""
        is_there = torch.ones_like(graphs.known) if self.every_record else graphs.known
        edges, records, node = edges_where(is_there), self.columns(graphs.report[is_there]), self.itself(graphs.itself)
        reports = self.reports.of_records(self.report, records) if self.reports else None
        for _ in range(ROUNDS):
            node = self.update(node, *([self.reports(edges, reports, None, node)] if self.reports else []))
        scored = edges.score(
            after(self.score_report, self.report, records), None, self.score_operator(node), self.score.weight[0]
        ) + self.score.bias  # fmt: skip
        score = scored.new_zeros(is_there.shape).masked_scatter(is_there, scored)
        return bounded(hold_as_chosen(self.keep_rest(node), score, graphs.held))


@method("commhg")
class CommHG(Method):
    """Two actors, a critic, learned communication.

    Attributes:
      relations: of robots, along which messages pass; operators' own, "reports", too.
      asks: there is a query head.
      leaves_out: kinds of features that edges do not have.
    """

    communicates = True
    relations = ("tasks", "peers", "operators", "reports")
    asks = True
    leaves_out = ()
    about = About(
        source="the CommHG paper, sections III-B to III-D",
        reads="own state, tasks with ages, peers and operators heard of, reports; all with ages",
        relations="task, peer, operator to robot; report to operator",
        heads="broadcast, query, request",
        critic="true state: graph with pooled means",
        inferred="operator to robot (`commhg-three` is without); widths that the paper leaves open",
    )

    def __init__(self):
        robots, every_record = tuple(name for name in self.relations if name != "reports"), self.wants.every_record
        super().__init__(
            RobotActor(robots, self.asks, every_record, self.leaves_out),
            OperatorActor("reports" in self.relations, every_record, self.leaves_out), Critic(),
        )  # fmt: skip
