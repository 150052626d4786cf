"""Compiled attention against the same in plain torch, values and gradients."""

import pytest
import torch

from commhg_mj.learning.attention import attend, plain_attend, softmax_by
from commhg_mj.learning.ragged import Edges

COUNTS = {"some empty": [3, 0, 1, 5, 0], "one row": [4], "no edges": [0, 0], "no rows": []}
N_SOURCES, HEADS, WIDTH = 6, 3, 8


@pytest.mark.parametrize("size", [1.0, 1e3])
@pytest.mark.parametrize("case", COUNTS)
def test_what_is_read_and_its_gradients_are_those_of_torch(case, size):
    """However large the scores are: no weight is lost to an exponential."""
    generator = torch.Generator().manual_seed(0)
    noise = lambda *shape: torch.randn(shape, generator=generator).requires_grad_()
    counts = torch.tensor(COUNTS[case], dtype=torch.long)
    ptr, n_edges = torch.nn.functional.pad(counts.cumsum(0), (1, 0)), int(counts.sum())
    index = torch.randint(0, N_SOURCES, (n_edges,), generator=generator)
    query, along = noise(len(counts), HEADS, WIDTH), noise(len(counts), HEADS)
    key, value = noise(N_SOURCES, HEADS, WIDTH), noise(N_SOURCES, HEADS, WIDTH)
    leaves = query, key, value, along
    distance = torch.rand(n_edges, generator=generator)
    found = attend(size * query, key, value, along, distance, Edges(ptr, index))
    wanted = plain_attend(size * query, key, value, along, distance, index, ptr)
    for one, other in zip(found, wanted):
        assert one.isfinite().all()
        torch.testing.assert_close(one, other, rtol=1e-4 if size > 1 else 1e-5, atol=1e-6)
    down = [torch.randn(part.shape, generator=generator) for part in found]
    for mine, theirs in zip(torch.autograd.grad(found, leaves, down), torch.autograd.grad(wanted, leaves, down)):
        torch.testing.assert_close(mine, theirs, rtol=1e-3 if size > 1 else 1e-5, atol=size * 1e-6)


def test_weights_of_a_row_add_up_to_one_however_large_scores_are():
    rows = torch.tensor([0, 0, 2, 2, 2])
    weight = softmax_by(rows, 1e4 * torch.randn(5, 3, generator=torch.Generator().manual_seed(0)), 3)
    total = torch.zeros(3, 3).index_add(0, rows, weight)
    torch.testing.assert_close(total, torch.tensor([[1.0] * 3, [0.0] * 3, [1.0] * 3]))
