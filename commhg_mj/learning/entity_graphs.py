"""Layers of graphs of near entities, as InforMARL has them: messages that are added up, then attention among agents.

Edges lead into agents alone, from whatever lies within reach: receiver[e] of agents, source[e] of nodes, distance[e] between.
"""

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from ..base.kernels import kernel
from .attention import attend
from .networks import linear
from .ragged import Edges

ALL_DRAWN, LAYERS = 3, 3  # of attention
REACH = 0.30  # sides: within it entities are near; the radio's nominal range
TYPE = 4  # width of an entity type's embedding


class Near(NamedTuple):
    """E edges."""

    receiver: Tensor  # [E] i8 agent
    source: Tensor  # [E] i8 node
    distance: Tensor  # [E, 1] sides


class EmbedConv(nn.Module):
    """Sums of messages MLP([source, embedding of its type, distance]), normalised within the message."""

    def __init__(self, n_features: int, n_types: int, width: int):
        super().__init__()
        self.kind = nn.Embedding(n_types, TYPE)
        self.source, self.distance = linear(n_features + TYPE, width), linear(1, width, bias=False)
        self.hidden, self.norm = linear(width, width), nn.LayerNorm(width)  # one norm twice, as in the source

    def forward(self, nodes: Tensor, types: Tensor, near: Near, n_agents: int) -> Tensor:
        """[n_agents, width] of nodes [n, F] of types [n]; an agent with nothing near gets zeros."""
        source = self.source(torch.cat([nodes, self.kind(types)], dim=1))
        message = self.norm(torch.relu(source[near.source] + self.distance(near.distance)))
        message = self.norm(torch.relu(self.hidden(message)))
        return message.new_zeros(n_agents, message.shape[1]).index_add(0, near.receiver, message)


class Attention(nn.Module):
    """One layer: a linear map of the agent itself, and the mean of heads that attend to near agents (Shi et al. 2021)."""

    def __init__(self, width: int, heads: int = ALL_DRAWN):
        super().__init__()
        self.heads, self.width = heads, width
        self.query, self.key, self.value = (linear(width, heads * width) for _ in range(3))
        self.distance, self.itself = linear(1, heads * width, bias=False), linear(width, width)

    def forward(self, agents: Tensor, edges: Edges, distance: Tensor) -> Tensor:
        """[n, width] of agents [n, width], with the distance [E] of every edge; sources are agents, too."""
        query, key, value = (layer(agents).view(-1, self.heads, self.width) for layer in (self.query, self.key, self.value))
        # Keys and values have the mapped distance added; by linearity it is multiplied once an agent, not once an edge.
        along = self.distance.weight.view(self.heads, self.width)
        told, far = attend(query, key, value, (query * along).sum(dim=2), distance, edges)
        return torch.relu(self.itself(agents) + told + far @ along / self.heads)


class EntityGraph(nn.Module):
    """Agents' embeddings out of near entities."""

    def __init__(self, n_features: int, n_types: int, width: int):
        super().__init__()
        self.embed, self.layers = EmbedConv(n_features, n_types, width), nn.ModuleList(Attention(width) for _ in range(LAYERS))

    def forward(self, nodes: Tensor, types: Tensor, near: Near, n_agents: int) -> Tensor:
        """[n_agents, width]; the first nodes are the agents."""
        agents = self.embed(nodes, types, near, n_agents)
        edges, distance = among_agents(near, n_agents)
        for layer in self.layers:
            agents = layer(agents, edges, distance)
        return agents


def among_agents(near: Near, n_agents: int) -> tuple[Edges, Tensor]:
    """(edges whose sources are agents, by receiver; their distances [E])."""
    among = (near.source < n_agents).nonzero()[:, 0]
    rows = near.receiver[among]
    among = among[torch.argsort(rows, stable=True)]
    counts = torch.bincount(rows, minlength=n_agents)
    return Edges(functional.pad(counts.cumsum(dim=0), (1, 0)), near.source[among]), near.distance[among, 0]


def pair_up(peer_ptr: Tensor, task_ptr: Tensor, agents: Tensor, tasks: Tensor) -> Near:
    """Who is near whom in robots' local graphs: into a robot and its peers, from these and its tasks.

    Args:
      peer_ptr, task_ptr: [N + 1] i8. agents: [N + P, 2] places in sides, of each robot first, then of its peers.
      tasks: [E, 2] places, which are nodes after all agents.
    """
    arrays = [tensor.detach().cpu().numpy() for tensor in (peer_ptr, task_ptr, agents, tasks)]
    pairs = np.empty((count_pairs(*arrays, np.empty((0, 2), np.int64)), 2), np.int64)
    count_pairs(*arrays, pairs)
    pairs = torch.from_numpy(pairs).to(agents.device)
    return measure(pairs[:, 0], pairs[:, 1], torch.cat([agents, tasks]))


def within_reach(a: Tensor, b: Tensor) -> Tensor:
    """[.., A, B] bool: which of two sets of places [.., A, 2] and [.., B, 2] are near."""
    return ((a[..., :, None, :] - b[..., None, :, :]) ** 2).sum(dim=-1) <= REACH * REACH


def measure(receiver: Tensor, source: Tensor, places: Tensor) -> Near:
    """Edges with their lengths."""
    return Near(receiver, source, (places[receiver] - places[source]).norm(dim=1, keepdim=True))


@kernel
def count_pairs(peer_ptr, task_ptr, agents, tasks, pairs):
    """How many pairs of agent and node are near; written to `pairs` [count, 2] if there is room."""
    count, n_agents, reach2 = 0, agents.shape[0], REACH * REACH
    for i in range(len(peer_ptr) - 1):
        first, last = i + peer_ptr[i], i + 1 + peer_ptr[i + 1]
        for a in range(first, last):
            for b in range(first, last):
                if a != b and (agents[a, 0] - agents[b, 0]) ** 2 + (agents[a, 1] - agents[b, 1]) ** 2 <= reach2:
                    if len(pairs):
                        pairs[count, 0], pairs[count, 1] = a, b
                    count += 1
            for j in range(task_ptr[i], task_ptr[i + 1]):
                if (agents[a, 0] - tasks[j, 0]) ** 2 + (agents[a, 1] - tasks[j, 1]) ** 2 <= reach2:
                    if len(pairs):
                        pairs[count, 0], pairs[count, 1] = a, n_agents + j
                    count += 1
    return count
