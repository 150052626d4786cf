"""CommHG's networks against naive ones, and the invariances that a graph policy owes."""

import numpy as np
import pytest
import torch
from learners import (
    Row,
    operator_graphs,
    random_public,
    random_row,
    random_states,
    robot_graphs,
    shaken,
)
from torch import nn

from commhg_mj.learning.batches import operator_batch, pick_robots, robot_batch
from commhg_mj.learning.critic import Agents, Critic
from commhg_mj.learning.features import TASK_EDGE
from commhg_mj.learning.methods.commhg import IS_KNOWN, ROUNDS, CommHG, OperatorActor, RobotActor
from commhg_mj.learning.networks import LARGEST_LOGIT, MESSAGE, NODE, Relation, Update
from commhg_mj.learning.ragged import Edges
from commhg_mj.learning.states import States

BIG = 100.0
ROWS = [Row(), Row((True,)), Row(n_peers=2), *(random_row(np.random.default_rng(seed)) for seed in range(12))]
close = dict(rtol=1e-3, atol=1e-4)


@pytest.fixture(autouse=True)
def no_gradients():
    with torch.no_grad():
        yield


@pytest.fixture
def robot():
    torch.manual_seed(0)
    return shaken(RobotActor())


@pytest.fixture
def operator():
    torch.manual_seed(0)
    return shaken(OperatorActor())


def embed(actor, graphs, public):
    batch = robot_batch(graphs, len(public))
    return actor.embed(batch, Edges(batch.task_ptr, batch.task), batch.task_edge, torch.relu(actor.attributes(public)))


def encoded(actor, public):
    """[T, NODE] of tasks: what the actor never makes, since only linear maps read it."""
    return actor.task(torch.relu(actor.attributes(public)))


def everyone(states):
    """Critic's arguments: the states of tensors, and every robot and operator of each."""
    counts = states.robot.shape[1], states.operator.shape[1]
    s = len(states.robot)
    return States(*map(torch.from_numpy, states)), *(
        Agents(torch.arange(s).repeat_interleave(n), torch.arange(n).repeat(s)) for n in counts
    )


def value_all(critic, states):
    """(robots' [S, R, 2], operators' [S, H, 2]) values."""
    return [values.unflatten(0, (len(states.robot), -1)) for values in critic(*everyone(states))]


def score(actor, graphs, public=None):
    public = random_public() if public is None else public
    return actor(robot_batch(graphs, len(public)), public)


def unbounded(logits):
    return LARGEST_LOGIT * torch.atanh(logits.double() / LARGEST_LOGIT)


def as_mlp(relation):
    """The relation as a plain network on [source, edge, receiver]."""
    first = nn.Linear(2 * NODE + relation.edge.in_features, MESSAGE)
    first.weight[:] = torch.cat([relation.source.weight, relation.edge.weight, relation.receiver.weight], dim=1)
    first.bias[:] = relation.edge.bias
    return nn.Sequential(first, nn.ReLU(), relation.out)


def naive_mean(relation, sources, edges, receiver):
    """[MESSAGE] mean message to one receiver, edge by edge; zeros without edges."""
    net = as_mlp(relation)
    messages = [net(torch.cat([source, edge, receiver])) for source, edge in zip(sources, edges)]
    return torch.stack(messages).mean(dim=0) if messages else torch.zeros(MESSAGE)


def test_a_relation_is_the_mean_of_a_plain_network():
    torch.manual_seed(0)
    relation = shaken(Relation(TASK_EDGE.width))
    ptr = torch.tensor([0, 3, 3, 4, 9])
    source, edge, receiver = torch.randn(6, NODE), torch.randn(9, TASK_EDGE.width), torch.randn(4, NODE)
    index = torch.tensor([0, 5, 2, 2, 1, 0, 3, 4, 5])
    mean = relation(Edges(ptr, index), relation.edge(edge), relation.source(source), receiver)
    for i in range(4):
        wanted = naive_mean(relation, source[index[ptr[i] : ptr[i + 1]]], edge[ptr[i] : ptr[i + 1]], receiver[i])
        torch.testing.assert_close(mean[i], wanted, **close)
    assert torch.all(mean[1] == 0)


def test_a_robots_embedding_is_two_rounds_of_one_update_over_plain_means(robot):
    graphs, public = robot_graphs(ROWS), random_public()
    tensors = robot_batch(graphs, len(public))
    node, ptr, peers, passes = robot.itself(tensors.itself), graphs.task_ptr, graphs.peer_ptr, robot.relations
    for _ in range(2):
        received = []
        for i in range(len(ROWS)):
            edges, others = slice(ptr[i], ptr[i + 1]), slice(peers[i], peers[i + 1])
            tasks = naive_mean(passes["tasks"], encoded(robot, public)[tensors.task[edges]], tensors.task_edge[edges], node[i])
            heard, reports = tensors.peer_edge[others], tensors.resource[i][tensors.resource[i, :, IS_KNOWN] > 0]
            means = [
                naive_mean(passes[name], encoder(records), records, node[i])
                for name, encoder, records in (("peers", robot.peer, heard), ("operators", robot.operator, reports))
            ]
            received.append(torch.cat([tasks, *means]))
        change = robot.update.mlp(torch.cat([node, torch.stack(received)], dim=1))
        node = robot.update.norm(node + change)
    torch.testing.assert_close(embed(robot, graphs, public), node, **close)
    assert ROUNDS == 2


def test_rounds_and_roles_share_what_they_should():
    method = CommHG()
    updates = [name for name, module in method.named_modules() if isinstance(module, Update)]
    relations = [name for name, module in method.named_modules() if isinstance(module, Relation)]
    assert updates == ["robot.update", "operator.update"]
    assert relations == [*(f"robot.relations.{name}" for name in ("tasks", "peers", "operators")), "operator.reports"]


def test_an_empty_neighbourhood_contributes_zeros(robot):
    graphs, public = robot_graphs(ROWS), random_public()
    before = embed(robot, graphs, public)
    counts = np.diff(graphs.task_ptr), np.diff(graphs.peer_ptr), (graphs.resource[..., IS_KNOWN] > 0).sum(axis=1)
    for relation, count in zip(robot.relations.values(), counts):
        is_empty = torch.from_numpy(count == 0)
        bias = relation.out.bias.clone()
        relation.out.bias += BIG
        after = embed(robot, graphs, public)
        relation.out.bias.copy_(bias)
        assert is_empty.any() and torch.equal(after[is_empty], before[is_empty])
        assert not torch.isclose(after[~is_empty], before[~is_empty]).all(dim=1).any()


def test_a_station_without_reports_contributes_zeros(operator):
    graphs = operator_graphs(6, 3, known=0.4)
    before = operator(operator_batch(graphs))
    operator.reports.out.bias += BIG
    after = operator(operator_batch(graphs))
    is_empty = torch.from_numpy(~graphs.known.any(axis=1))
    assert is_empty.any() and not is_empty.all()
    assert torch.equal(after[is_empty], before[is_empty])
    assert not torch.isclose(after[~is_empty], before[~is_empty]).all(dim=1).any()


def test_the_critic_sees_closed_tasks_as_nothing():
    torch.manual_seed(0)
    critic, states = shaken(Critic()), random_states(8)
    states.is_open[:3] = False
    values = value_all(critic, states)
    noisy = states._replace(task=np.where(states.is_open[..., None], states.task, BIG).astype(np.float32))
    for one, two in zip(values, value_all(critic, noisy)):
        assert torch.equal(one, two)
    critic.tasks.bias += BIG
    for one, two in zip(values, value_all(critic, noisy)):
        assert torch.equal(one[:3], two[:3])
        assert not torch.isclose(one[3:], two[3:]).any(dim=0).all()


def test_the_critic_values_each_agent_in_its_own_state():
    torch.manual_seed(0)
    critic, states = shaken(Critic()), random_states(5)
    whole = value_all(critic, states)
    tensors = States(*map(torch.from_numpy, states))
    at = Agents(torch.tensor([4, 0, 2]), torch.tensor([1, 2, 0])), Agents(torch.tensor([3]), torch.tensor([1]))
    for values, wanted, asked in zip(critic(tensors, *at), whole, at):
        torch.testing.assert_close(values, wanted[asked.state, asked.agent], **close)
    assert whole[0].std() > 0.01


def test_reports_that_never_came_change_nothing(operator):
    graphs = operator_graphs(8, 4)
    noise = np.random.default_rng(1).normal(0, 10, graphs.report.shape).astype(np.float32)
    noisy = graphs._replace(report=np.where(graphs.known[..., None], graphs.report, noise))
    logits, other = operator(operator_batch(graphs)), operator(operator_batch(noisy))
    assert torch.equal(logits, other)
    known = graphs._replace(report=np.where(graphs.known[..., None], noise, graphs.report))
    assert not torch.equal(logits, operator(operator_batch(known)))


def test_what_operators_report_reaches_every_head_of_a_robot_and_what_they_never_reported_none(robot):
    graphs = robot_graphs([Row((True, True))] * 30)
    is_known = graphs.resource[..., IS_KNOWN] > 0
    noise = np.random.default_rng(1).normal(0, 10, graphs.resource.shape).astype(np.float32)
    noise[..., IS_KNOWN] = graphs.resource[..., IS_KNOWN]
    news, nothing = (graphs._replace(resource=np.where(at[..., None], noise, graphs.resource)) for at in (is_known, ~is_known))
    before, after, same = score(robot, graphs), score(robot, news), score(robot, nothing)
    hears = torch.from_numpy(is_known.any(axis=1))
    for name, was, now, still in zip(before._fields, before, after, same):
        changed = (was != now).reshape(len(hears), -1).any(dim=1)
        assert torch.equal(changed, hears), name
        if name != "query":  # whom it may ask is scored one by one
            assert torch.equal(was, still), name
    assert hears.any() and not hears.all()


def test_permuted_tasks_and_peers_are_scored_alike(robot):
    rows, public = [Row((True,) * 5, n_peers=4, own=2)], random_public()
    graphs, rng = robot_graphs(rows), np.random.default_rng(0)
    order, peers, names = rng.permutation(5), rng.permutation(4), rng.permutation(5)
    one, table = score(robot, graphs, public), torch.empty_like(public)
    table[names] = public
    moved = graphs._replace(
        task=names[graphs.task[order]], task_edge=graphs.task_edge[order], peer_edge=graphs.peer_edge[peers],
        own_edge=np.array([int(np.flatnonzero(order == 2)[0])]),
    )  # fmt: skip
    other = score(robot, moved, table)
    torch.testing.assert_close(other.task, one.task[order], **close)
    for name in ("keep_idle", "gate", "query", "assist"):
        torch.testing.assert_close(getattr(other, name), getattr(one, name), **close)
    assert one.task.std() > 0.01, "all tasks score alike: nothing is shown"


def test_permuted_operators_are_asked_alike(robot):
    graphs = robot_graphs([Row(query=(True,) * 4)])
    order = np.array([2, 0, 3, 1])
    one, other = score(robot, graphs), score(robot, graphs._replace(resource=graphs.resource[:, order]))
    torch.testing.assert_close(other.query[:, 1:], one.query[:, 1:][:, order], **close)
    torch.testing.assert_close(other.query[:, 0], one.query[:, 0], **close)


def test_permuted_robots_are_supervised_alike(operator):
    graphs, order = operator_graphs(6, 5), np.array([3, 0, 4, 1, 2])
    moved = graphs._replace(report=graphs.report[:, order], known=graphs.known[:, order], held=np.full(6, 1))
    one, other = operator(operator_batch(graphs)), operator(operator_batch(moved))
    torch.testing.assert_close(other[:, 2:], one[:, 2:][:, order], **close)
    torch.testing.assert_close(other[:, :2], one[:, :2], **close)


def test_a_robot_is_alone_in_its_row(robot, operator):
    """The answer for one actor does not depend on who decides beside it."""
    graphs = robot_graphs(ROWS)
    whole, start = score(robot, graphs), graphs.task_ptr
    for i in range(len(ROWS)):
        alone = score(robot, pick_robots(graphs, np.array([i]))[0])
        torch.testing.assert_close(alone.task, whole.task[start[i] : start[i + 1]], **close)
        for name in ("keep_idle", "gate", "query", "assist"):
            torch.testing.assert_close(getattr(alone, name)[0], getattr(whole, name)[i], **close)
    stations = operator_graphs(5, 3)
    for i in range(5):
        one = operator(operator_batch(stations, np.array([i])))
        torch.testing.assert_close(one[0], operator(operator_batch(stations))[i], **close)


def test_to_keep_a_task_scores_as_that_task(robot, operator):
    held = robot_graphs([Row((True, True, True), own=1)], seed=1)
    with_task, without = score(robot, held), score(robot, held._replace(own_edge=np.array([-1])))
    gain = unbounded(with_task.keep_idle) - unbounded(without.keep_idle)
    torch.testing.assert_close(gain[0, 0], unbounded(with_task.task[1]), **close)
    assert gain[0, 1] == 0 and with_task.task[1].abs() > 0.01
    stations = operator_graphs(4, 3)._replace(held=np.array([2, 0, 1, -1]))
    kept, free = operator(operator_batch(stations)), operator(operator_batch(stations._replace(held=np.full(4, -1))))
    gain = unbounded(kept) - unbounded(free)
    torch.testing.assert_close(gain[:3, 0], unbounded(kept[torch.arange(3), torch.tensor([4, 2, 3])]), **close)
    assert gain[3, 0] == 0 and torch.all(gain[:, 1:] == 0)


@pytest.mark.parametrize("n_robots, n_operators, n_tasks", [(1, 0, 1), (6, 2, 20), (64, 24, 200)])
def test_weights_fit_any_team(n_robots, n_operators, n_tasks):
    method = CommHG()
    method.load_state_dict(CommHG().state_dict())
    rows = [Row((True,) * min(n_tasks, 3), query=(True,) * n_operators)] * n_robots
    logits = score(method.robot, robot_graphs(rows, n_tasks), random_public(n_tasks))
    assert logits.query.shape == (n_robots, 1 + n_operators) and logits.task.shape == (n_robots * min(n_tasks, 3),)
    assert method.operator(operator_batch(operator_graphs(max(1, n_operators), n_robots))).shape[1] == 2 + n_robots
    states = random_states(2, n_robots, n_operators, n_tasks)
    robots, operators = method.critic(*everyone(states))
    assert robots.shape == (2 * n_robots, 2) and operators.shape == (2 * n_operators, 2)
    assert all(torch.isfinite(values).all() for values in (robots, operators, logits.query, logits.task))


def test_logits_are_bounded(robot):
    for parameter in robot.parameters():
        parameter *= 30
    for logits in score(robot, robot_graphs(ROWS)):
        assert torch.isfinite(logits).all() and logits.abs().max() <= LARGEST_LOGIT
