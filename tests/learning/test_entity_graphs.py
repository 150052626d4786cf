"""Layers among near entities, against dense ones."""

import math

import numpy as np
import pytest
import torch
from learners import random_states

from commhg_mj.learning.critic import Agents
from commhg_mj.learning.entity_graphs import REACH, Attention, EmbedConv, Near, among_agents, pair_up, within_reach
from commhg_mj.learning.methods.informarl import GraphCritic
from commhg_mj.learning.states import States

EDGES = [(0, 1), (0, 2), (1, 0), (2, 0), (2, 1), (2, 3)]  # receiver, source; agent 3 has none


def near(pairs, generator):
    receiver, source = torch.tensor(pairs).T
    return Near(receiver, source, torch.rand(len(pairs), 1, generator=generator))


def test_attention_is_that_of_a_dense_masked_softmax():
    torch.manual_seed(0)
    layer, n, width = Attention(8, heads=3), 4, 8
    generator = torch.Generator().manual_seed(0)
    agents, edges = torch.randn(n, width, generator=generator), near(EDGES, generator)
    mask, distance = torch.zeros(n, n, dtype=torch.bool), torch.zeros(n, n, 1)
    mask[edges.receiver, edges.source], distance[edges.receiver, edges.source] = True, edges.distance
    split = lambda rows: rows.view(*rows.shape[:-1], 3, width)
    key, value = (split(part(agents)[None] + layer.distance(distance)) for part in (layer.key, layer.value))
    score = (split(layer.query(agents))[:, None] * key).sum(dim=-1) / math.sqrt(width)
    weight = torch.where(mask[..., None], score, -torch.inf).softmax(dim=1).nan_to_num()
    wanted = torch.relu(layer.itself(agents) + (weight[..., None] * value).sum(dim=1).mean(dim=1))
    torch.testing.assert_close(layer(agents, *among_agents(edges, n)), wanted, rtol=1e-5, atol=1e-6)


def test_messages_are_added_up_and_an_agent_with_nothing_near_gets_zeros():
    torch.manual_seed(0)
    layer, generator = EmbedConv(5, 2, 6), torch.Generator().manual_seed(1)
    nodes, types, edges = torch.randn(4, 5, generator=generator), torch.tensor([0, 0, 1, 1]), near(EDGES, generator)
    together = layer(nodes, types, edges, 4)
    assert torch.equal(together[3], torch.zeros(6))
    each = [layer(nodes, types, Near(*(column[e : e + 1] for column in edges)), 4) for e in range(len(EDGES))]
    torch.testing.assert_close(together, sum(each), rtol=1e-5, atol=1e-6)
    assert not torch.allclose(together, layer(nodes, 1 - types, edges, 4)), "types of entities do not matter"


def test_edges_among_agents_go_by_receiver_and_leave_out_other_sources():
    receiver, source = torch.tensor([(2, 0), (0, 4), (0, 2), (2, 3), (0, 1), (2, 1)]).T
    edges, distance = among_agents(Near(receiver, source, torch.arange(6.0)[:, None]), 3)
    assert edges.ptr.tolist() == [0, 2, 2, 4] and edges.index.tolist() == [2, 1, 0, 1]
    assert distance.tolist() == [2, 4, 0, 5]


@pytest.mark.parametrize("seed", range(3))
def test_pairs_are_all_that_are_near_in_one_graph_and_no_others(seed):
    rng = np.random.default_rng(seed)
    peers, tasks = rng.integers(0, 4, 5), rng.integers(0, 6, 5)
    pointer = lambda counts: torch.from_numpy(np.concatenate([[0], np.cumsum(counts)]))
    agents, goals = (torch.from_numpy(rng.random((n, 2), np.float32)) for n in (5 + peers.sum(), tasks.sum()))
    found = pair_up(pointer(peers), pointer(tasks), agents, goals)
    graph_of = np.concatenate([np.repeat(np.arange(5), peers + 1), np.repeat(np.arange(5), tasks)])
    places = np.concatenate([agents, goals]).astype(float)
    wanted = {
        (a, b)
        for a in range(len(agents)) for b in range(len(places))
        if a != b and graph_of[a] == graph_of[b] and np.hypot(*(places[a] - places[b])) <= REACH
    }  # fmt: skip
    assert set(zip(found.receiver.tolist(), found.source.tolist())) == wanted and len(found.receiver) == len(wanted) > 0
    lengths = np.hypot(*(places[found.receiver] - places[found.source]).T)
    np.testing.assert_allclose(found.distance[:, 0], lengths, atol=1e-6)


def test_reach_is_a_share_of_the_side():
    a, b = torch.tensor([[0.0, 0.0]]), torch.tensor([[0.29, 0.0], [0.31, 0.0], [0.2, 0.2], [0.25, 0.25]])
    assert within_reach(a, b).tolist() == [[True, False, True, False]]


def test_the_critic_reads_open_tasks_alone_and_whoever_is_near():
    torch.manual_seed(0)
    critic, states = GraphCritic(), States(*map(torch.from_numpy, random_states(12, seed=2)))
    everyone = [Agents(torch.arange(12).repeat_interleave(n), torch.arange(n).repeat(12)) for n in (3, 2)]
    before = critic(states, *everyone)
    closed = states.task + ~states.is_open[..., None] * 5.0
    assert all(map(torch.equal, before, critic(states._replace(task=closed), *everyone)))
    opened = states.task + states.is_open[..., None] * 5.0
    assert not torch.equal(before[1], critic(states._replace(task=opened), *everyone)[1])
