"""Means over ragged rows: the edges of row i are ptr[i]:ptr[i + 1]."""

import torch
from torch import Tensor


def rows_of(ptr: Tensor) -> Tensor:
    """[E] the row of every edge."""
    return torch.repeat_interleave(torch.arange(len(ptr) - 1), ptr.diff())


class Edges:
    """Ragged edges: where they begin, and which row each belongs to."""

    def __init__(self, ptr: Tensor, rows: Tensor):
        self.rows, self.count = rows, ptr.diff()[:, None]
        self.exist = (self.count > 0).float()  # [N, 1]

    def mean_of_sums(self, ends: Tensor, receiver: Tensor) -> Tensor:
        """[N, F] means over each row's edges of relu(ends [E, F] + the row's receiver [N, F]); 0 without edges."""
        total = torch.zeros_like(receiver).index_add(0, self.rows, torch.relu(ends + receiver[self.rows]))
        return total / self.count.clamp(min=1)
