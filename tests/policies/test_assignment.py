"""The assignment inside kernels is optimal, whatever the shape."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from commhg_mj.policies.assignment import assign, new_assignment


def solved(worth):
    rows, columns = worth.shape
    table = new_assignment(rows, columns)
    table.worth[:, :columns] = worth
    assign(table, rows, columns)
    return table.column_of[1:] - 1


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (4, 22), (16, 112), (64, 7), (12, 12)])
def test_the_sum_of_worths_is_the_largest(shape):
    rng = np.random.default_rng(sum(shape))
    for density in (0.2, 0.6, 1.0):
        worth = rng.random(shape) * (rng.random(shape) < density)
        column_of = solved(worth)
        given = np.flatnonzero(column_of >= 0)
        assert len(set(column_of[given])) == len(given), "a column has one row"
        assert np.all(worth[given, column_of[given]] > 0), "nobody gets what is worth nothing"
        best = worth[linear_sum_assignment(worth, maximize=True)].sum()
        assert worth[given, column_of[given]].sum() == pytest.approx(best, rel=1e-12)


def test_a_table_serves_again_for_fewer_rows_and_columns():
    table, rng = new_assignment(8, 20), np.random.default_rng(0)
    for rows, columns in ((8, 20), (3, 5), (8, 2), (1, 20)):
        worth = rng.random((rows, columns))
        table.worth[:rows, :columns] = worth
        assign(table, rows, columns)
        assert np.array_equal(table.column_of[1 : rows + 1] - 1, solved(worth))
