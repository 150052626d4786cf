"""Building blocks that every method's networks share."""

import torch
from torch import Tensor, nn

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


def bounded(logits: Tensor) -> Tensor:
    """Logits in ±LARGEST_LOGIT: no choice is ever ruled out by its score."""
    return LARGEST_LOGIT * torch.tanh(logits / LARGEST_LOGIT)


class Relation(nn.Module):
    """A relation's messages and their mean: MLP([source, edge, receiver]) of 64 dimensions.

    The first layer is a sum of its three parts, and the last one is applied to the mean: the same function, but each source
    is multiplied once, each edge once for both rounds, and each receiver's mean once.
    """

    def __init__(self, n_edge: int):
        super().__init__()
        self.source, self.edge = linear(NODE, MESSAGE, bias=False), linear(n_edge, MESSAGE)
        self.receiver, self.out = linear(NODE, MESSAGE, bias=False), linear(MESSAGE, MESSAGE)

    def forward(self, ends: Tensor, receiver: Tensor, mean, has_edges: Tensor) -> Tensor:
        """[N, MESSAGE]; a receiver without edges gets zeros, no bias.

        Args:
          ends: of the edges, the sum of `source` and `edge`.
          receiver: [N, NODE].
          mean: (ends, [N, MESSAGE]) -> [N, MESSAGE], the mean over a receiver's edges of relu(end + receiver's row).
          has_edges: [N, 1] 0 or 1.
        """
        return self.out(mean(ends, self.receiver(receiver))) * has_edges


class Update(nn.Module):
    """A residual update of the receiver's embedding; both rounds share it."""

    def __init__(self, n_relations: int):
        super().__init__()
        self.mlp = mlp(NODE + n_relations * MESSAGE, NODE, NODE)
        self.norm = nn.LayerNorm(NODE)

    def forward(self, node: Tensor, *messages: Tensor) -> Tensor:
        return self.norm(node + self.mlp(torch.cat([node, *messages], dim=-1)))
