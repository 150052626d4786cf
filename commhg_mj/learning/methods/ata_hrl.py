"""ATA-HRL: an initial allocation, a trigger, a conditional reallocation, and reconstruction of old records (ICRA 2025).

No code and no full text of it could be had: what is known of it, and what is ours, stands in docs/learning.md. It is
centralised in its source; here every actor runs its own copy on its own records. Communication follows the fixed schedule.

A trigger z and a choice among the rest are one flat choice: p(KEEP) = p(z = 0), p(j) = p(z = 1) p(j | z = 1). So an
untriggered choice enters neither likelihood nor ratio, and where the choice is forced there is no trigger.
"""

import torch
from torch import Tensor, nn
from torch.nn.functional import logsigmoid

from ..attention import softmax_by
from ..critic import Critic
from ..features import OPERATOR, PEER, PUBLIC, REPORT, RESOURCE, ROBOT, TASK_EDGE
from ..graphs import Wants
from ..heads import RobotLogits
from ..networks import bounded, linear, mlp, pick
from ..ragged import Edges
from ..reconstruction import RobotReconstruction, TaskReconstruction
from ..registry import About, Method, method

WIDTH, ALL_DRAWN = 64, 4
N_PAST = 4  # reports of each robot
AUXILIARY = 0.1  # weight of each reconstruction's loss
SELDOM = -2.2  # logit of the trigger at first: one decision in ten
TIME = ROBOT.index("time")

BELIEF = TASK_EDGE.columns(
    "uav_only", "ugv_only", "general", "serviced", "progress", "age_known", "age_short", "age_long", "claim_known", "claim_short",
    "claim_long",
)  # fmt: skip
SITUATION = ROBOT.columns("time", "time_left", "x", "y")
INHERENT = ROBOT.columns("is_ugv", "is_uav", "speed")  # of a robot, known to all
ANNOUNCED = TASK_EDGE.columns("uav_only", "ugv_only", "general")
DISTANCE = TASK_EDGE.columns("distance")


class CrossAttention(nn.Module):
    """Each receiver's token asks the tokens of its edges."""

    def __init__(self):
        super().__init__()
        self.query, self.key, self.value = linear(WIDTH, WIDTH), linear(WIDTH, WIDTH), linear(WIDTH, WIDTH)
        self.out = linear(WIDTH, WIDTH)

    def forward(self, receivers: Tensor, receiver: Tensor, tokens: Tensor) -> Tensor:
        """[n, WIDTH] of receivers [n, WIDTH]; edge e leads from tokens[e] to receiver[e]."""
        split = lambda rows: rows.view(-1, ALL_DRAWN, WIDTH // ALL_DRAWN)
        score = (split(self.query(receivers))[receiver] * split(self.key(tokens))).sum(dim=2) / (WIDTH // ALL_DRAWN) ** 0.5
        heads = softmax_by(receiver, score, len(receivers))[..., None] * split(self.value(tokens))
        return self.out(torch.zeros_like(receivers).index_add(0, receiver, heads.flatten(1)))


class Encoder(nn.Module):
    """An own token that asks one group of tokens after the other, and a feed-forward layer."""

    def __init__(self, n_groups: int):
        super().__init__()
        self.groups, self.feed = nn.ModuleList(CrossAttention() for _ in range(n_groups)), mlp(WIDTH, 2 * WIDTH, WIDTH)
        self.norms = nn.ModuleList(nn.LayerNorm(WIDTH) for _ in range(2))

    def forward(self, own: Tensor, *groups: tuple[Tensor, Tensor]) -> Tensor:
        own = self.norms[0](own + sum(attend(own, *group) for attend, group in zip(self.groups, groups)))
        return self.norms[1](own + self.feed(own))


class InitialAllocation(nn.Module):
    """Robots and tasks attend to each other by what all know of them; a pointer scores each pair."""

    def __init__(self):
        super().__init__()
        self.robot, self.task = linear(len(INHERENT), WIDTH), linear(PUBLIC.width, WIDTH)
        self.edge = linear(len(DISTANCE + ANNOUNCED), WIDTH)
        self.to_robots, self.to_tasks = Encoder(1), Encoder(1)
        self.point_robot, self.point_task, self.point_edge = (linear(WIDTH, WIDTH, bias=i == 0) for i in range(3))
        self.point = linear(WIDTH, 1, 0.01)

    def forward(self, robots: Tensor, rows: Tensor, edges: Tensor, task: Tensor, public: Tensor) -> Tensor:
        """[E] scores of edges [E] from tasks, rows of `public`, to robots, rows of `robots` [n, ROBOT.width]."""
        robot, tasks, edge = self.robot(pick(robots, INHERENT)), self.task(public), self.edge(pick(edges, DISTANCE + ANNOUNCED))
        robot = self.to_robots(robot, (rows, tasks[task] + edge))
        tasks = self.to_tasks(tasks, (task, robot[rows] + edge))
        hidden = self.point_robot(robot)[rows] + self.point_task(tasks)[task] + self.point_edge(edge)
        return self.point(torch.relu(hidden))[:, 0]


class RobotActor(nn.Module):
    """All robots' policy."""

    def __init__(self):
        super().__init__()
        self.reconstruct_task = TaskReconstruction(len(BELIEF), PUBLIC.width + len(SITUATION))
        self.reconstruct_peer, self.first = RobotReconstruction(), InitialAllocation()
        self.itself, self.operator = mlp(ROBOT.width, 2 * WIDTH, WIDTH), linear(RESOURCE.width, WIDTH)
        self.task = mlp(TASK_EDGE.width + PUBLIC.width + TaskReconstruction.WIDTH, 2 * WIDTH, WIDTH)
        self.peer = mlp(PEER.width + RobotReconstruction.WIDTH, 2 * WIDTH, WIDTH)
        self.encoder, self.trigger, self.idle = Encoder(3), linear(WIDTH, 1, 0.01), linear(WIDTH, 1, 0.01)
        self.score_task, self.score_robot = linear(WIDTH, WIDTH), linear(WIDTH, WIDTH, bias=False)
        self.score = linear(WIDTH, 1, 0.01)
        nn.init.constant_(self.trigger.bias, SELDOM)

    def forward(self, graphs, public: Tensor) -> RobotLogits:
        node, tasks = self.embed(graphs, public)
        score = Edges(graphs.task_ptr).score(self.score_task(tasks), None, self.score_robot(node), self.score.weight[0])
        score, idle = bounded(score + self.score.bias), bounded(self.idle(node)[:, 0])
        trigger, rows = bounded(self.trigger(node)[:, 0]), graphs.rows
        # Among all that is legal but KEEP.
        weight = torch.where(graphs.task_legal, score.exp(), 0.0)
        norm = torch.where(graphs.keep_idle[:, 1], idle.exp(), 0.0).index_add(0, rows, weight).clamp(min=1e-30).log()
        chosen = logsigmoid(trigger) - norm
        score, keep_idle = score + chosen[rows], torch.stack([logsigmoid(-trigger), idle + chosen], dim=1)
        begins = (graphs.itself[:, TIME] == 0.0) & ~graphs.keep_idle[:, 0]  # first_targets.beginners
        first = begins[rows]
        if first.any():
            robot_of = begins.cumsum(dim=0) - 1
            pairs = self.first(graphs.itself[begins], robot_of[rows[first]], graphs.task_edge[first], graphs.task[first], public)
            score = score.masked_scatter(first, bounded(pairs))
        return RobotLogits(score, keep_idle, None, None, None)

    def embed(self, graphs, public: Tensor) -> tuple[Tensor, Tensor]:
        """(robots [N, WIDTH], their task tokens [E, WIDTH])."""
        now = self.reconstruct_task(*self.tasks_now(graphs, public))
        tasks = self.task(torch.cat([graphs.task_edge, public[graphs.task], now], dim=1))
        peers = self.peer(torch.cat([graphs.peer_edge, self.reconstruct_peer(graphs.peer_past)], dim=1))
        n, h = graphs.resource.shape[:2]
        asked = torch.arange(n, device=tasks.device).repeat_interleave(h)
        groups = (graphs.rows, tasks), (graphs.peer_rows, peers), (asked, self.operator(graphs.resource.flatten(0, 1)))
        return self.encoder(self.itself(graphs.itself), *groups), tasks

    def tasks_now(self, graphs, public: Tensor) -> tuple[Tensor, Tensor]:
        """(beliefs, what they depend on) of task edges, for their reconstruction."""
        situation = pick(graphs.itself, SITUATION)[graphs.rows]
        return pick(graphs.task_edge, BELIEF), torch.cat([public[graphs.task], situation], dim=1)


class OperatorActor(nn.Module):
    """All operators' policy: KEEP unless triggered, else REST or a robot."""

    def __init__(self):
        super().__init__()
        self.reconstruct_robot, self.itself = RobotReconstruction(), mlp(OPERATOR.width, 2 * WIDTH, WIDTH)
        self.report = mlp(REPORT.width + RobotReconstruction.WIDTH, 2 * WIDTH, WIDTH)
        self.encoder, self.trigger, self.rest = Encoder(1), linear(WIDTH, 1, 0.01), linear(WIDTH, 1, 0.01)
        self.score_report, self.score_operator = linear(WIDTH, WIDTH), linear(WIDTH, WIDTH, bias=False)
        self.score = linear(WIDTH, 1, 0.01)
        nn.init.constant_(self.trigger.bias, SELDOM)

    def forward(self, graphs) -> Tensor:
        """[K, 2 + R] logits of KEEP, REST and the robots, of `OperatorGraphs` of tensors."""
        known = graphs.known
        row_of = known.nonzero()[:, 0]
        reports = self.report(torch.cat([graphs.report[known], self.reconstruct_robot(graphs.past[known])], dim=1))
        node = self.encoder(self.itself(graphs.itself), (row_of, reports))
        scored = self.score(torch.relu(self.score_report(reports) + self.score_operator(node)[row_of]))[:, 0]
        others = torch.cat([self.rest(node), scored.new_zeros(known.shape).masked_scatter(known, scored)], dim=1)
        legal = torch.cat([graphs.keep_rest[:, 1:], graphs.legal], dim=1)
        others, trigger = bounded(others), bounded(self.trigger(node))
        chosen = logsigmoid(trigger) - torch.where(legal, others.exp(), 0.0).sum(dim=1, keepdim=True).clamp(min=1e-30).log()
        return torch.cat([logsigmoid(-trigger), others + chosen], dim=1)


@method("ata-hrl")
class ATAHRL(Method):
    """Initial allocation, trigger, reallocation, reconstruction."""

    picks_first = True
    wants = Wants(n_past=N_PAST)
    about = About(
        source="ATA-HRL, ICRA 2025 (abstract, project site); ITA, IROS 2023; AeHRL, RA-L 2024; no code",
        reads="own state; tasks, peers, reports with ages and their last 4 records; operators heard of",
        relations="cross-attention of the actor to tasks, peers, operators or reports; robots and tasks at t = 0",
        heads="fixed schedule; first target, trigger",
        critic="as commhg's",
        inferred="all sizes, weights and the decentralised form; one team reward instead of three",
    )

    def __init__(self):
        super().__init__(RobotActor(), OperatorActor(), Critic())

    def auxiliary(self, decided, rng) -> Tensor:
        """Losses of the reconstructions, against the true state of the second in which the records were read."""
        (robots, public, operators), truth = decided.local, decided.states
        state, n_tasks = decided.robot_agents.state, truth.task.shape[1]
        at = state[robots.rows], robots.task % n_tasks
        tasks = self.robot.reconstruct_task.loss(*self.robot.tasks_now(robots, public), truth.task[at], truth.is_open[at], rng)
        peers = self.robot.reconstruct_peer.loss(robots.peer_past, truth.robot[state[robots.peer_rows], robots.peer])
        row_of, robot = operators.known.nonzero().T
        seen = truth.robot[decided.operator_agents.state[row_of], robot]
        reports = self.operator.reconstruct_robot.loss(operators.past[operators.known], seen)
        return AUXILIARY * (tasks + peers + reports)
