"""InforMARL: agents that aggregate what lies near them (Nayak et al. 2023), on matched information.

It reads neither ages nor whether anything is known nor who has room: its source has no such columns. Communication follows the
fixed schedule (docs/learning.md).
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

from ..critic import N_PARTS, Agents, judge_roles
from ..entity_graphs import EntityGraph, Near, measure, pair_up, within_reach
from ..features import OPERATOR, PEER, PUBLIC, REPORT, ROBOT, TASK_EDGE
from ..heads import RobotLogits, hold_as_chosen, keep_as_chosen
from ..networks import NODE, bounded, linear, pick
from ..ragged import Edges
from ..registry import About, Method, method
from ..state_features import STATE_MISSION, STATE_OPERATOR, STATE_ROBOT, STATE_TASK
from ..states import States

WIDTH = 64
A_ROBOT, A_TASK, AN_OPERATOR = 0, 1, 2  # types of entities

# Columns by name. Of a robot as its peers and it itself see it, the same facts in the same order.
OWN = ROBOT.columns("own", "mask", "public")
OWN_FACTS = ROBOT.columns("is_ugv", "is_uav", "travelling", "servicing", "handover", "controlled", "has_task")
PEER_FACTS = PEER.columns(
    "is_ugv", "is_uav", "travelling", "servicing", "handover", "controlled", "has_task", "same_task", "has_controller"
)
OF_TASK = TASK_EDGE.columns("estimate", "belief", "own", "claim_known")
PUBLIC_OF_TASK = PUBLIC.columns("difficulty", "value", "decay")
PEER_PLACE, TASK_PLACE, OWN_PLACE = PEER.columns("dx", "dy"), TASK_EDGE.columns("dx", "dy"), ROBOT.columns("x", "y")
N_FACTS, N_OF_TASK = len(PEER_FACTS), len(OF_TASK) + len(PUBLIC_OF_TASK)

OF_OPERATOR = OPERATOR.columns("own", "public")
REPORT_PLACE, TASK_DISTANCE = REPORT.columns("x", "y"), REPORT.columns("distance")
OF_REPORT = REPORT.columns(
    "is_ugv", "is_uav", "idle", "travelling", "servicing", "handover", "controlled", "by_another", "by_me", "x", "y", "is_held",
    "request_known",
)  # fmt: skip
OF_REPORTED = REPORT.columns(
    "progress", "difficulty", "value", "slack", "distance", "gain", "uav_only", "ugv_only", "general", "compatible",
    "task_serviced", "task_done", "task_progress",
)  # fmt: skip
HAS_TASK = REPORT.index("has_task")
STATE_PLACE, STATE_TASK_PLACE = STATE_ROBOT.columns("x", "y"), STATE_TASK.columns("x", "y")


def body(n_in: int) -> nn.Sequential:
    """The source's perceptron: normalised inputs, two layers, each normalised."""
    layers = [nn.LayerNorm(n_in)]
    for width in (n_in, NODE):
        layers += [linear(width, NODE), nn.ReLU(), nn.LayerNorm(NODE)]
    return nn.Sequential(*layers)


class RobotActor(nn.Module):
    """All robots' policy: an entity graph around each, and a score for every legal task, near or far."""

    def __init__(self):
        super().__init__()
        self.graph, self.body = EntityGraph(4 + N_FACTS + N_OF_TASK, 2, WIDTH), body(len(OWN) + WIDTH)
        self.score_task, self.score_robot = linear(N_OF_TASK, WIDTH), linear(NODE, WIDTH, bias=False)
        self.score, self.keep_idle = linear(WIDTH, 1, 0.01), linear(NODE, 2, 0.01)

    def forward(self, graphs, public: Tensor) -> RobotLogits:
        tasks = torch.cat([pick(graphs.task_edge, OF_TASK), pick(public, PUBLIC_OF_TASK)[graphs.task]], dim=1)
        places = pick(graphs.task_edge, TASK_PLACE)
        has_own, own = (graphs.own_edge >= 0)[:, None], graphs.own_edge.clamp(min=0)
        held = torch.where(has_own, places[own], 0.0) if len(places) else places.new_zeros(len(own), 2)
        at_me, agents, positions = self._agents(graphs, public, held)
        nodes = torch.cat([
            functional.pad(agents, (0, N_OF_TASK)), torch.cat([places, places, functional.pad(tasks, (N_FACTS, 0))], dim=1),
        ])  # fmt: skip
        types = torch.cat([at_me.new_full((len(agents),), A_ROBOT), at_me.new_full((len(tasks),), A_TASK)])
        near = pair_up(graphs.peer_ptr, graphs.task_ptr, positions, places)
        embedded = self.graph(nodes, types, near, len(agents))[at_me]
        hidden = self.body(torch.cat([pick(graphs.itself, OWN), embedded], dim=1))
        score = Edges(graphs.task_ptr).score(self.score_task(tasks), None, self.score_robot(hidden), self.score.weight[0])
        score = score + self.score.bias
        keep_idle = keep_as_chosen(self.keep_idle(hidden), score, graphs.own_edge)
        return RobotLogits(bounded(score), bounded(keep_idle), None, None, None)

    def _agents(self, graphs, public, held):
        """(where each robot's own row is, rows of all agents, their places): each robot, then its peers."""
        me = graphs.itself
        facts = pick(me, OWN_FACTS)
        under = (facts[:, -3] + facts[:, -2])[:, None]  # handover, controlled: then it has a controller
        mine = torch.cat([torch.zeros_like(held), held, facts, facts[:, -1:], under], dim=1)
        peers = graphs.peer_edge
        place = pick(peers, PEER_PLACE)
        aims = (graphs.peer_task >= 0)[:, None]
        goal = public[graphs.peer_task.clamp(min=0)][:, :2] - pick(me, OWN_PLACE)[graphs.peer_rows]
        others = torch.cat(
            [place, torch.where(aims, goal, place), pick(peers, PEER_FACTS)], dim=1
        )
        n = torch.arange(len(me), device=me.device)
        at_me, at_others = n + graphs.peer_ptr[:-1], torch.arange(len(peers), device=me.device) + graphs.peer_rows + 1
        rows = mine.new_zeros(len(mine) + len(others), mine.shape[1])
        rows = rows.index_copy(0, at_me, mine).index_copy(0, at_others, others)
        return at_me, rows, rows[:, :2]


class OperatorActor(nn.Module):
    """All operators' policy: the operator, the robots that it heard of, and the tasks that these reported."""

    def __init__(self):
        super().__init__()
        self.graph = EntityGraph(len(OF_OPERATOR) + len(OF_REPORT) + len(OF_REPORTED), 3, WIDTH)
        self.body = body(len(OF_OPERATOR) + WIDTH)
        self.score_embedded, self.score_report = linear(WIDTH, WIDTH), linear(len(OF_REPORT) + len(OF_REPORTED), WIDTH)
        self.score_operator, self.score = linear(NODE, WIDTH, bias=False), linear(WIDTH, 1, 0.01)
        self.keep_rest = linear(NODE, 2, 0.01)

    def forward(self, graphs) -> Tensor:
        known, k = graphs.known, len(graphs.known)
        own, reports = pick(graphs.itself, OF_OPERATOR), graphs.report[known]
        row_of, n = known.nonzero()[:, 0], int(known.sum())
        robots, aims = pick(reports, OF_REPORT), reports[:, HAS_TASK] > 0
        tasks = pick(reports[aims], OF_REPORTED)
        a, b, c = len(OF_OPERATOR), len(OF_REPORT), len(OF_REPORTED)
        nodes = torch.cat([
            functional.pad(own, (0, b + c)), functional.pad(robots, (a, c)), functional.pad(tasks, (a + b, 0)),
        ])  # fmt: skip
        sizes = (k, AN_OPERATOR), (n, A_ROBOT), (len(tasks), A_TASK)
        types = torch.cat([row_of.new_full((size,), kind) for size, kind in sizes])
        embedded = self.graph(nodes, types, self._near(graphs, reports, row_of, aims), k + n)
        hidden = self.body(torch.cat([own, embedded[:k]], dim=1))
        told = self.score_embedded(embedded[k:]) + self.score_report(pick(reports, OF_REPORT + OF_REPORTED))
        scored = self.score(torch.relu(told + self.score_operator(hidden)[row_of]))[:, 0]
        score = scored.new_zeros(known.shape).masked_scatter(known, scored)
        return bounded(hold_as_chosen(self.keep_rest(hidden), score, graphs.held))

    def _near(self, graphs, reports, row_of, aims) -> Near:
        """A robot to its operator, who has no place; a task to its robot; robots to each other within reach."""
        k, n = len(graphs.known), len(reports)
        robots = k + torch.arange(n, device=reports.device)
        of_task = robots[aims]
        tasks = k + n + torch.arange(len(of_task), device=reports.device)
        known, place = graphs.known, pick(graphs.report, REPORT_PLACE)
        apart = ~torch.eye(known.shape[1], dtype=torch.bool, device=place.device)
        operator, one, other = (within_reach(place, place) & known[:, :, None] & known[:, None] & apart).nonzero().T
        number = known.flatten().cumsum(dim=0).view_as(known) - 1  # of a robot among all that were heard of
        among = measure(number[operator, one], number[operator, other], pick(reports, REPORT_PLACE))
        distance = torch.cat([place.new_zeros(n, 1), pick(reports[aims], TASK_DISTANCE), among.distance])
        return Near(torch.cat([row_of, of_task, k + among.receiver]), torch.cat([robots, tasks, k + among.source]), distance)


class GraphCritic(nn.Module):
    """The same layers on the true state: the mean over all agents, the mission, and the agent's own true features."""

    reads = "state"

    def __init__(self):
        super().__init__()
        self.graph = EntityGraph(STATE_ROBOT.width + STATE_OPERATOR.width + STATE_TASK.width, 3, WIDTH)
        self.robot, self.operator = (
            nn.Sequential(body(WIDTH + STATE_MISSION.width + group.width), linear(NODE, N_PARTS, 0.1))
            for group in (STATE_ROBOT, STATE_OPERATOR)
        )

    def forward(self, states: States, robots: Agents, operators: Agents) -> tuple[Tensor, Tensor]:
        """(robots' [n, 2], operators' [k, 2]) values in states of tensors."""
        (s, r, a), (h, b), c = states.robot.shape, states.operator.shape[1:], STATE_TASK.width
        tasks = states.task[states.is_open]
        nodes = torch.cat([
            functional.pad(states.robot.flatten(0, 1), (0, b + c)), functional.pad(states.operator.flatten(0, 1), (a, c)),
            functional.pad(tasks, (a + b, 0)),
        ])  # fmt: skip
        sizes = (s * r, A_ROBOT), (s * h, AN_OPERATOR), (len(tasks), A_TASK)
        types = torch.cat([torch.full((size,), kind, device=nodes.device) for size, kind in sizes])
        embedded = self.graph(nodes, types, self._near(states, tasks), s * (r + h))
        each = torch.arange(s, device=nodes.device)
        state_of = torch.cat([each.repeat_interleave(r), each.repeat_interleave(h)])
        mean = embedded.new_zeros(s, WIDTH).index_add(0, state_of, embedded) / (r + h)
        context = torch.cat([mean, states.mission], dim=1)
        return judge_roles(context, (self.robot, states.robot, robots), (self.operator, states.operator, operators))

    def _near(self, states, tasks) -> Near:
        """Into robots from near robots and open tasks; into operators, who have no place, from all robots."""
        (s, r), h = states.robot.shape[:2], states.operator.shape[1]
        place, goal = pick(states.robot, STATE_PLACE), pick(states.task, STATE_TASK_PLACE)
        number = torch.zeros_like(states.is_open, dtype=torch.long)
        number[states.is_open] = torch.arange(len(tasks), device=place.device) + s * (r + h)
        apart = ~torch.eye(r, dtype=torch.bool, device=place.device)
        peers = (within_reach(place, place) & apart).nonzero()
        near_tasks = (within_reach(place, goal) & states.is_open[:, None]).nonzero()
        whole = torch.cartesian_prod(*(torch.arange(size, device=place.device) for size in (s, h, r))) if h else peers[:0]
        places = torch.cat([place.flatten(0, 1), place.new_zeros(s * h, 2), pick(tasks, STATE_TASK_PLACE)])
        robot = lambda pairs, column: pairs[:, 0] * r + pairs[:, column]
        near = measure(
            torch.cat([robot(peers, 1), robot(near_tasks, 1)]),
            torch.cat([robot(peers, 2), number[near_tasks[:, 0], near_tasks[:, 2]]]), places,
        )  # fmt: skip
        operators = s * r + whole[:, 0] * h + whole[:, 1]
        return Near(
            torch.cat([near.receiver, operators]), torch.cat([near.source, robot(whole, 2)]),
            torch.cat([near.distance, place.new_zeros(len(whole), 1)]),
        )  # fmt: skip


@method("informarl")
class InforMARL(Method):
    """Entity graphs, no ages."""

    may_read_plans = False
    about = About(
        source="Nayak et al., InforMARL, ICML 2023; github.com/nsidn98/InforMARL at 7d3c42a",
        reads="own state; near peers, tasks; reports; neither ages nor flags of knowledge nor who has room",
        relations="entities within 0.30 of the side to agent: summed messages, three attention layers",
        heads="fixed schedule",
        critic="true state: the same layers, mean over agents, the agent's own row",
        inferred="goal sets that grow, operators as agents without a place, reach; feed-forward",
    )

    def __init__(self):
        super().__init__(RobotActor(), OperatorActor(), GraphCritic())
