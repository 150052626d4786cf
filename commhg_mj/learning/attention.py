"""Attention over ragged edges, compiled for the CPU, with its gradients: keys and values are read where they lie.

In torch each edge gets copies of its query, key and value, heads times width numbers each, and memory is what bounds it. Other
devices take that (tests hold both equal).
"""

import math

import numpy as np
import torch
from torch import Tensor

from ..base.kernels import reduction
from .ragged import NOTHING, Edges, arrays_of, rows_of


def attend(query: Tensor, key: Tensor, value: Tensor, along: Tensor, distance: Tensor, edges: Edges) -> tuple[Tensor, Tensor]:
    """What each receiver's heads read from its sources (scaled dot products, a softmax over the receiver's edges).

    Args:
      query: [N, H, F] of receivers. key, value: [M, H, F] of sources.
      along: [N, H] what a unit of distance adds to a score before it is scaled. distance: [E], without gradients.

    Returns:
      ([N, F] values, the mean over heads of their weighted sums; [N, H] weighted sums of distances); 0 without edges.
    """
    found = _Attend.apply if query.is_cpu else plain_attend
    return found(query, key, value, along, distance, edges.index, edges.ptr)


def plain_attend(query, key, value, along, distance, index, ptr) -> tuple[Tensor, Tensor]:
    """`attend` in torch."""
    rows, n, distance = rows_of(ptr), len(query), distance[:, None]
    score = (query[rows] * key[index]).sum(dim=2) + distance * along[rows]
    weight = softmax_by(rows, score / math.sqrt(query.shape[2]), n)
    told = torch.zeros_like(query[:, 0]).index_add(0, rows, (weight[..., None] * value[index]).mean(dim=1))
    return told, torch.zeros_like(along).index_add(0, rows, weight * distance)


def softmax_by(rows: Tensor, score: Tensor, n: int) -> Tensor:
    """[E, H] weights that add up to 1 over the edges of each row."""
    each = rows[:, None].expand_as(score)
    top = score.new_full((n, score.shape[1]), -torch.inf).scatter_reduce(0, each, score.detach(), "amax")
    weight = (score - top[rows]).exp()
    return weight / torch.zeros_like(top).index_add(0, rows, weight)[rows]


class _Attend(torch.autograd.Function):
    @staticmethod
    def forward(ctx, query, key, value, along, distance, index, ptr):
        tensors = [tensor.contiguous() for tensor in (query, key, value, along, distance, index, ptr)]
        query, along = tensors[0], tensors[3]
        weight = query.new_empty(len(index), query.shape[1])
        told, far = torch.zeros_like(query[:, 0]), torch.zeros_like(along)
        read_sources(*arrays_of(*tensors, weight, told, far))
        ctx.save_for_backward(*tensors, weight)
        return told, far

    @staticmethod
    def backward(ctx, d_told, d_far):
        grads = [torch.zeros_like(tensor) for tensor in ctx.saved_tensors[:4]]
        add_gradients(*arrays_of(*ctx.saved_tensors, d_told.contiguous(), d_far.contiguous(), *grads))
        return *grads, None, None, None


@reduction
def read_sources(query, key, value, along, distance, index, ptr, weight, told, far):
    """Write the edges' weights [E, H]; add to told and far."""
    _, heads, width = query.shape
    scale, share = np.float32(1.0 / math.sqrt(width)), np.float32(1.0 / heads)
    for i in range(len(query)):
        for h in range(heads):
            own, total, top = query[i, h], NOTHING, np.float32(-np.inf)
            for e in range(ptr[i], ptr[i + 1]):
                other, score = key[index[e], h], NOTHING
                for k in range(width):
                    score += own[k] * other[k]
                weight[e, h] = (score + along[i, h] * distance[e]) * scale
                top = max(top, weight[e, h])
            for e in range(ptr[i], ptr[i + 1]):
                weight[e, h] = math.exp(weight[e, h] - top)
                total += weight[e, h]
            for e in range(ptr[i], ptr[i + 1]):
                weight[e, h] /= total
                far[i, h] += weight[e, h] * distance[e]
                other, mine = value[index[e], h], weight[e, h] * share
                for k in range(width):
                    told[i, k] += mine * other[k]


@reduction
def add_gradients(
    query, key, value, along, distance, index, ptr, weight, d_told, d_far, d_query, d_key, d_value, d_along
):
    """Add what `told` and `far` pass back."""
    _, heads, width = query.shape
    scale, share = np.float32(1.0 / math.sqrt(width)), np.float32(1.0 / heads)
    for i in range(len(query)):
        down = d_told[i]
        for h in range(heads):
            mean = NOTHING  # of what the weights pass back, by these weights
            for e in range(ptr[i], ptr[i + 1]):
                mean += weight[e, h] * _back_to_weight(value[index[e], h], down, share, d_far[i, h] * distance[e])
            own, d_own = query[i, h], d_query[i, h]
            for e in range(ptr[i], ptr[i + 1]):
                source, mine = index[e], weight[e, h]
                back = _back_to_weight(value[source, h], down, share, d_far[i, h] * distance[e])
                back = mine * (back - mean) * scale
                other, d_other, d_read = key[source, h], d_key[source, h], d_value[source, h]
                d_along[i, h] += back * distance[e]
                for k in range(width):
                    d_own[k] += back * other[k]
                    d_other[k] += back * own[k]
                    d_read[k] += mine * share * down[k]


@reduction
def _back_to_weight(read, down, share, from_distance):
    total = NOTHING
    for k in range(len(down)):
        total += read[k] * down[k]
    return total * share + from_distance
