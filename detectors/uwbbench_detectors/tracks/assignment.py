"""The cheapest way to give rows to columns, one to one, for the few tracks and detections of a frame."""

from __future__ import annotations

import numpy as np

from uwbbench.api import FloatArray, IntArray, compiled


@compiled
def assigned(cost: FloatArray) -> IntArray:
    """Column (rows,) of each row so that the sum of costs is least; -1 where there are more rows than columns.

    Shortest augmenting paths with potentials, one row after the other: ``rows^2 columns`` steps at worst. Of equal
    sums the one found first is taken.

    Parameters
    ----------
    cost : (rows, columns) array
        Finite.

    Returns
    -------
    (rows,) int array

    References
    ----------
    R. Jonker and A. Volgenant, Computing 38, 1987; :func:`scipy.optimize.linear_sum_assignment` solves the same, but
    cannot be called from compiled code.
    """
    rows, columns = cost.shape
    if rows <= columns:
        return _by_rows(cost)
    turned = np.empty((columns, rows))
    for row in range(rows):
        for column in range(columns):
            turned[column, row] = cost[row, column]
    return _inverse(_by_rows(turned), columns, rows)


@compiled
def _inverse(row_of: IntArray, columns: int, rows: int) -> IntArray:
    """Column of each row, -1 for none, from the row of each column."""
    column_of = np.empty(rows, np.int64)
    column_of[:] = -1
    for column in range(columns):
        if row_of[column] >= 0:
            column_of[row_of[column]] = column
    return column_of


@compiled
def _by_rows(cost: FloatArray) -> IntArray:
    """As :func:`assigned`, for at most as many rows as columns."""
    rows, columns = cost.shape
    # The last column is where the row that seeks a place starts.
    row_of, previous = np.empty(columns + 1, np.int64), np.empty(columns + 1, np.int64)
    row_of[:] = -1
    of_row, of_column, shortest = np.zeros(rows), np.zeros(columns + 1), np.empty(columns + 1)
    reached = np.empty(columns + 1, np.bool_)
    for row in range(rows):
        at = columns
        row_of[at] = row
        shortest[:] = np.inf
        reached[:] = False
        while row_of[at] >= 0:
            reached[at] = True
            seeking, step, onward = row_of[at], np.inf, columns
            for column in range(columns):
                if not reached[column]:
                    reduced = cost[seeking, column] - of_row[seeking] - of_column[column]
                    if reduced < shortest[column]:
                        shortest[column] = reduced
                        previous[column] = at
                    if shortest[column] < step:
                        step = shortest[column]
                        onward = column
            for column in range(columns + 1):
                if reached[column]:
                    of_row[row_of[column]] += step
                    of_column[column] -= step
                else:
                    shortest[column] -= step
            at = onward
        while at != columns:
            row_of[at] = row_of[previous[at]]
            at = previous[at]
        row_of[columns] = -1
    return _inverse(row_of, columns, rows)
