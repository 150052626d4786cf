"""Optimal assignment inside kernels: the Hungarian method by shortest augmenting paths (Kuhn 1955; Jonker, Volgenant 1987)."""

from typing import NamedTuple

import numpy as np

from ..base.kernels import kernel

NONE = 0  # rows and columns of the method count from 1


class Assignment(NamedTuple):
    """Worths and the scratch of the method; `column_of[r + 1]` is one more than the column of row r, or NONE."""

    worth: np.ndarray  # [rows, columns] not negative; 0: no pair
    column_of: np.ndarray  # [rows + 1]
    row_of: np.ndarray  # [columns + 1] one more than the row of a column
    row_price: np.ndarray  # [rows + 1] dual variables of costs -worth
    column_price: np.ndarray  # [columns + 1]
    slack: np.ndarray  # [columns + 1] least reduced cost from the tree of rows reached so far
    reached_from: np.ndarray  # [columns + 1]
    is_reached: np.ndarray  # [columns + 1]


def new_assignment(rows: int, columns: int) -> Assignment:
    """Room for so many rows and columns; each row has a spare column beside them, of no worth."""
    wide = rows + columns
    return Assignment(
        worth=np.zeros((rows, wide)),
        column_of=np.zeros(rows + 1, np.int64),
        row_of=np.zeros(wide + 1, np.int64),
        row_price=np.zeros(rows + 1),
        column_price=np.zeros(wide + 1),
        slack=np.zeros(wide + 1),
        reached_from=np.zeros(wide + 1, np.int64),
        is_reached=np.zeros(wide + 1, np.bool_),
    )


@kernel
def assign(a, rows, columns):
    """Give each of the first rows at most one of the first columns, so that the sum of worths is largest."""
    wide = columns + rows
    a.worth[:rows, columns:wide] = 0.0
    a.row_of[: wide + 1] = NONE
    a.column_of[: rows + 1] = NONE
    a.row_price[: rows + 1] = 0.0
    a.column_price[: wide + 1] = 0.0
    for row in range(1, rows + 1):
        end = shortest_path(a, row, wide)
        while end != NONE:  # each row on the path moves to the column by which it was left
            before = a.reached_from[end]
            a.row_of[end] = a.row_of[before]
            end = before
    for column in range(1, columns + 1):
        row = a.row_of[column]
        if row != NONE and a.worth[row - 1, column - 1] > 0.0:
            a.column_of[row] = column


@kernel
def reduced_cost(a, row, column):
    """What the sum loses if this row gets this column, once all are assigned; both count from 1."""
    return -a.worth[row - 1, column - 1] - a.row_price[row] - a.column_price[column]


@kernel
def shortest_path(a, row, wide):
    """The free column at the end of the cheapest alternating path from a row that has none yet; prices stay dual."""
    a.row_of[NONE] = row
    a.slack[: wide + 1] = np.inf
    a.is_reached[: wide + 1] = False
    last = NONE
    while a.row_of[last] != NONE:
        a.is_reached[last] = True
        row, step, nearest = a.row_of[last], np.inf, NONE
        for column in range(1, wide + 1):
            if not a.is_reached[column]:
                cost = reduced_cost(a, row, column)
                if cost < a.slack[column]:
                    a.slack[column] = cost
                    a.reached_from[column] = last
                if a.slack[column] < step:
                    step = a.slack[column]
                    nearest = column
        for column in range(wide + 1):
            if a.is_reached[column]:
                a.row_price[a.row_of[column]] += step
                a.column_price[column] -= step
            else:
                a.slack[column] -= step
        last = nearest
    return last
