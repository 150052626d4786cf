"""Ragged rows: the edges of row i are ptr[i]:ptr[i + 1]. Sums over them are compiled for the CPU, with their gradients.

An edge's hidden layer is relu(edge + source + receiver); there it is made in registers and never lies in memory, which is
what bounds the same sums in torch. Other devices take those (tests hold both equal).
"""

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from ..base.kernels import kernel, reduction

NOTHING = np.float32(0.0)


def rows_of(ptr: Tensor) -> Tensor:
    """[E] the row of every edge."""
    return torch.repeat_interleave(torch.arange(len(ptr) - 1, device=ptr.device), ptr.diff())


class Edges:
    """Ragged edges, each from a row of a table of sources to a receiver.

    Args:
      ptr: [N + 1] i8. index: [E] i8 the source of every edge; None: edges carry what their sources say.
    """

    def __init__(self, ptr: Tensor, index: Tensor | None = None):
        self.ptr, self.index = ptr, ptr.new_zeros(int(ptr[-1])) if index is None else index
        self.exist = (ptr.diff() > 0).float()[:, None]  # [N, 1]

    def mean(self, edge: Tensor, source: Tensor | None, receiver: Tensor) -> Tensor:
        """[N, F] means over each row's edges of relu(edge [E, F] + source [., F] + receiver [N, F]); 0 without edges."""
        source = edge.new_zeros(1, edge.shape[1]) if source is None else source
        mean = _Mean.apply if edge.is_cpu else plain_mean
        return mean(edge, source, receiver, self.index, self.ptr)

    def score(self, edge: Tensor, source: Tensor | None, receiver: Tensor, weight: Tensor) -> Tensor:
        """[E] products of the same hidden layers with weight [F]."""
        source = edge.new_zeros(1, edge.shape[1]) if source is None else source
        score = _Score.apply if edge.is_cpu else plain_score
        return score(edge, source, receiver, weight, self.index, self.ptr)


def edges_where(exist: Tensor) -> Edges:
    """The edges of a dense table [N, M] of bool, row after row."""
    return Edges(functional.pad(exist.sum(dim=1).cumsum(dim=0), (1, 0)))


def plain_mean(edge, source, receiver, index, ptr) -> Tensor:
    """`Edges.mean` in torch."""
    rows = rows_of(ptr)
    total = torch.zeros_like(receiver).index_add(0, rows, torch.relu(edge + source[index] + receiver[rows]))
    return total / ptr.diff().clamp(min=1)[:, None]


def plain_score(edge, source, receiver, weight, index, ptr) -> Tensor:
    """`Edges.score` in torch."""
    return torch.relu(edge + source[index] + receiver[rows_of(ptr)]) @ weight


class _Mean(torch.autograd.Function):
    @staticmethod
    def forward(ctx, edge, source, receiver, index, ptr):
        tensors = [tensor.contiguous() for tensor in (edge, source, receiver, index, ptr)]
        ctx.save_for_backward(*tensors)
        out = torch.zeros_like(tensors[2])
        add_means(*arrays_of(*tensors), out.numpy())
        return out

    @staticmethod
    def backward(ctx, grad):
        edge, source, receiver = ctx.saved_tensors[:3]
        grads = torch.empty_like(edge), torch.zeros_like(source), torch.zeros_like(receiver)
        add_mean_gradients(*arrays_of(*ctx.saved_tensors, grad.contiguous(), *grads))
        return *grads, None, None


class _Score(torch.autograd.Function):
    @staticmethod
    def forward(ctx, edge, source, receiver, weight, index, ptr):
        tensors = [tensor.contiguous() for tensor in (edge, source, receiver, weight, index, ptr)]
        ctx.save_for_backward(*tensors)
        out = edge.new_empty(len(edge))
        write_scores(*arrays_of(*tensors), out.numpy())
        return out

    @staticmethod
    def backward(ctx, grad):
        edge, source, receiver, weight = ctx.saved_tensors[:4]
        grads = torch.empty_like(edge), *(torch.zeros_like(tensor) for tensor in (source, receiver, weight))
        add_score_gradients(*arrays_of(*ctx.saved_tensors, grad.contiguous(), *grads))
        return *grads, None, None


def arrays_of(*tensors) -> list[np.ndarray]:
    """Tensors on the CPU as the arrays that they are."""
    return [tensor.detach().numpy() for tensor in tensors]


@kernel
def add_means(edge, source, receiver, index, ptr, out):
    """out += the means of `Edges.mean`."""
    for i in range(len(out)):
        share = np.float32(1.0) / np.float32(max(1, ptr[i + 1] - ptr[i]))
        total, own = out[i], receiver[i]
        for e in range(ptr[i], ptr[i + 1]):
            row, other = edge[e], source[index[e]]
            for k in range(len(own)):
                hidden = row[k] + other[k] + own[k]
                total[k] += hidden if hidden > NOTHING else NOTHING
        for k in range(len(own)):
            total[k] *= share


@kernel
def add_mean_gradients(edge, source, receiver, index, ptr, grad, d_edge, d_source, d_receiver):
    """Write d_edge, add to d_source and d_receiver."""
    for i in range(len(grad)):
        share = np.float32(1.0) / np.float32(max(1, ptr[i + 1] - ptr[i]))
        own, d_own, down = receiver[i], d_receiver[i], grad[i]
        for e in range(ptr[i], ptr[i + 1]):
            row, other, d_row, d_other = edge[e], source[index[e]], d_edge[e], d_source[index[e]]
            for k in range(len(own)):
                back = down[k] * share if row[k] + other[k] + own[k] > NOTHING else NOTHING
                d_row[k] = back
                d_other[k] += back
                d_own[k] += back


@reduction
def write_scores(edge, source, receiver, weight, index, ptr, out):
    """Write the scores of `Edges.score`."""
    for i in range(len(receiver)):
        own = receiver[i]
        for e in range(ptr[i], ptr[i + 1]):
            row, other = edge[e], source[index[e]]
            total = NOTHING
            for k in range(len(own)):
                hidden = row[k] + other[k] + own[k]
                total += weight[k] * (hidden if hidden > NOTHING else NOTHING)
            out[e] = total


@kernel
def add_score_gradients(edge, source, receiver, weight, index, ptr, grad, d_edge, d_source, d_receiver, d_weight):
    """Write d_edge, add to the others."""
    for i in range(len(receiver)):
        own, d_own = receiver[i], d_receiver[i]
        for e in range(ptr[i], ptr[i + 1]):
            row, other, d_row, d_other = edge[e], source[index[e]], d_edge[e], d_source[index[e]]
            down = grad[e]
            for k in range(len(own)):
                hidden = row[k] + other[k] + own[k]
                back = down * weight[k] if hidden > NOTHING else NOTHING
                d_weight[k] += down * hidden if hidden > NOTHING else NOTHING
                d_row[k] = back
                d_other[k] += back
                d_own[k] += back
