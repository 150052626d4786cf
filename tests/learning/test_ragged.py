"""Compiled sums over ragged edges against the same in plain torch, values and gradients."""

import pytest
import torch

from commhg_mj.learning.ragged import Edges

COUNTS = {"some empty": [3, 0, 1, 5, 0], "one row": [4], "no edges": [0, 0], "no rows": []}


def plain_hidden(edge, source, receiver, index, ptr):
    rows = torch.repeat_interleave(torch.arange(len(ptr) - 1), ptr.diff())
    return torch.relu(edge + (0 if source is None else source[index]) + receiver[rows]), rows


def plain_mean(hidden, rows, ptr, width):
    total = torch.zeros(len(ptr) - 1, width).index_add(0, rows, hidden)
    return total / ptr.diff().clamp(min=1)[:, None]


@pytest.mark.parametrize("with_source", [True, False])
@pytest.mark.parametrize("case", COUNTS)
def test_means_and_scores_are_those_of_torch(case, with_source):
    generator = torch.Generator().manual_seed(0)
    noise = lambda *shape: torch.randn(shape, generator=generator).requires_grad_()
    counts, width = torch.tensor(COUNTS[case], dtype=torch.long), 8
    ptr = torch.nn.functional.pad(counts.cumsum(0), (1, 0))
    n, n_edges = len(counts), int(counts.sum())
    index = torch.randint(0, 3, (n_edges,), generator=generator)
    leaves = noise(n_edges, width), noise(3, width), noise(n, width), noise(width)
    edge, source, receiver, weight = leaves[0], leaves[1] if with_source else None, *leaves[2:]
    edges = Edges(ptr, index if with_source else None)
    hidden, rows = plain_hidden(edge, source, receiver, index, ptr)
    wanted = plain_mean(hidden, rows, ptr, width), hidden @ weight
    found = edges.mean(edge, source, receiver), edges.score(edge, source, receiver, weight)
    for one, other in zip(found, wanted):
        torch.testing.assert_close(one, other, rtol=1e-5, atol=1e-6)
        down = torch.randn(one.shape, generator=generator)
        grads = [torch.autograd.grad(value, leaves, down, allow_unused=True, retain_graph=True) for value in (one, other)]
        for mine, theirs in zip(*grads):
            assert (mine is None) == (theirs is None)
            if mine is not None:
                torch.testing.assert_close(mine, theirs, rtol=1e-5, atol=1e-6)
    assert edges.exist.flatten().tolist() == [float(count > 0) for count in counts]
