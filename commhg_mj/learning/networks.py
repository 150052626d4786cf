"""Building blocks that every method's networks share."""

import torch
from torch import Tensor, nn
from torch.nn import functional

from .ragged import Edges

LARGEST_LOGIT = 10.0
NODE, MESSAGE = 128, 64  # widths (paper, section III-B)


def linear(n_in: int, n_out: int, gain: float = 2.0**0.5, bias: bool = True) -> nn.Linear:
    """A linear map with orthogonal weights and no bias at first."""
    layer = nn.Linear(n_in, n_out, bias)
    nn.init.orthogonal_(layer.weight, gain)
    if bias:
        nn.init.zeros_(layer.bias)
    return layer


def mlp(n_in: int, hidden: int, n_out: int, gain: float = 2.0**0.5) -> nn.Sequential:
    """Two layers."""
    return nn.Sequential(linear(n_in, hidden), nn.ReLU(), linear(hidden, n_out, gain))


def head(n_in: int, n_out: int) -> nn.Sequential:
    """Scores that begin near 0."""
    return mlp(n_in, MESSAGE, n_out, 0.01)


def pick(rows: Tensor, columns: list[int]) -> Tensor:
    """[.., len(columns)] of rows [.., F]: slices, since a list of indices would have to be sent to the rows' device."""
    cuts = [0, *(i for i in range(1, len(columns)) if columns[i] != columns[i - 1] + 1), len(columns)]
    return torch.cat([rows[..., columns[a] : columns[b - 1] + 1] for a, b in zip(cuts, cuts[1:])], dim=-1)


def bounded(logits: Tensor) -> Tensor:
    """Logits in ±LARGEST_LOGIT: no choice is ever ruled out by its score."""
    return LARGEST_LOGIT * torch.tanh(logits / LARGEST_LOGIT)


def after(outer: nn.Linear, encoder: nn.Linear, x: Tensor) -> Tensor:
    """outer(encoder(x)), multiplied by one small matrix: wide nodes that only linear maps read are never made."""
    bias = outer.weight @ encoder.bias
    return functional.linear(x, outer.weight @ encoder.weight, bias if outer.bias is None else bias + outer.bias)


class Relation(nn.Module):
    """A relation's messages and their mean: MLP([source, edge, receiver]) of 64 dimensions.

    The first layer is a sum of its three parts, and the last one is applied to the mean: the same function, but each source
    is multiplied once, each edge once for both rounds, and each receiver's mean once.
    """

    def __init__(self, n_edge: int):
        super().__init__()
        self.source, self.edge = linear(NODE, MESSAGE, bias=False), linear(n_edge, MESSAGE)
        self.receiver, self.out = linear(NODE, MESSAGE, bias=False), linear(MESSAGE, MESSAGE)

    def of_records(self, encoder: nn.Linear, records: Tensor) -> Tensor:
        """[E, MESSAGE] of edges whose source is the encoded record that also lies on the edge."""
        weight = self.source.weight @ encoder.weight + self.edge.weight
        return functional.linear(records, weight, self.source.weight @ encoder.bias + self.edge.bias)

    def forward(self, edges: Edges, edge: Tensor, source: Tensor | None, receiver: Tensor) -> Tensor:
        """[N, MESSAGE] means of messages; a receiver without edges gets zeros, no bias.

        Args:
          edge: [E, MESSAGE], and source: [., MESSAGE], each through its own layer.
          receiver: [N, NODE].
        """
        return self.out(edges.mean(edge, source, self.receiver(receiver))) * edges.exist


class Update(nn.Module):
    """A residual update of the receiver's embedding; both rounds share it."""

    def __init__(self, n_relations: int):
        super().__init__()
        self.mlp = mlp(NODE + n_relations * MESSAGE, NODE, NODE)
        self.norm = nn.LayerNorm(NODE)

    def forward(self, node: Tensor, *messages: Tensor) -> Tensor:
        return self.norm(node + self.mlp(torch.cat([node, *messages], dim=-1)))
