"""Which detection belongs to which object: one-to-one, as many pairs as possible, and those as cheap as possible.

Conventions
-----------
* A pair is allowed where its cost is at most the gate. The comparison is ``cost <= gate`` on the numbers as they are,
  without a tolerance: a detection exactly at the gate matches, the next larger number does not.
* A cost of NaN is never allowed, whatever the gate.
* The number of pairs comes first: a cheap pair is given up where that lets one more pair exist. Among all matchings
  with the largest possible number of pairs the one with the smallest sum of costs is taken. A greedy matching (nearest
  first) has neither property.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from uwbbench.api.arrays import FloatArray, IntArray


def match(cost: FloatArray, gate: float) -> tuple[IntArray, IntArray]:
    """Match rows and columns one-to-one: the minimum total cost among all matchings with the most pairs.

    Solved as a linear assignment (Kuhn, Naval Research Logistics Quarterly 2, 1955; Crouse's implementation in scipy)
    in which every forbidden pair costs more than all allowed pairs together. All matchings of interest have the same
    number of pairs, so allowed costs may be shifted and scaled to 0...1 first: the penalty is then a small number,
    and no digit of the costs drowns in it.

    Parameters
    ----------
    cost : (rows, columns) array
        Non-negative costs, for example distances in metres; NaN where a pair is impossible.
    gate : float
        Largest allowed cost, inclusive.

    Returns
    -------
    (pairs,) int array, (pairs,) int array
        Rows, ascending, and the column of each.

    Examples
    --------
    Taking the cheapest pair (0.1) first would leave the second row alone.

    >>> rows, columns = match(np.array([[0.10, 0.15], [0.18, 0.90]]), gate=0.2)
    >>> rows.tolist(), columns.tolist()
    ([0, 1], [1, 0])
    """
    from scipy.optimize import linear_sum_assignment

    allowed = cost <= gate
    if not allowed.any():
        return np.empty(0, np.int64), np.empty(0, np.int64)
    least = cost[allowed].min()
    spread = cost[allowed].max() - least
    scaled = np.full(cost.shape, min(cost.shape) + 1.0)
    scaled[allowed] = (cost[allowed] - least) / spread if spread > 0 else 0.0
    rows, columns = linear_sum_assignment(scaled)
    real = allowed[rows, columns]
    return rows[real].astype(np.int64), columns[real].astype(np.int64)


def match_frames(
    frame: IntArray,
    cost: FloatArray,
    gate: float,
    solve: Callable[[FloatArray, float], tuple[IntArray, IntArray]] = match,
) -> IntArray:
    """Match the detections of many frames with the objects, each frame for itself, as :func:`match` does.

    Most frames have allowed pairs with one detection or one object only. There the cheapest pair is the answer, and
    all of them are found at once; the assignment is solved for the rest.

    Parameters
    ----------
    frame : (n,) int array
        Frame of each detection, in any order.
    cost : (n, objects) array
        Cost of each detection with each object; NaN where the object is not to be matched in that frame.
    gate : float
        Largest allowed cost, inclusive.
    solve : callable
        What matches rows and columns of a frame, as :func:`match` does; of one row or one column it must take the
        cheapest pair.

    Returns
    -------
    (n,) int array
        Object of each detection, -1 where it has none.

    Examples
    --------
    >>> cost = np.array([[0.1, np.nan], [0.05, np.nan], [0.3, 0.0]])
    >>> match_frames(np.array([7, 7, 8]), cost, gate=0.2).tolist()
    [-1, 0, 1]
    """
    partner = np.full(len(frame), -1, np.int64)
    row, column = np.nonzero(cost <= gate)
    order = np.lexsort((cost[row, column], frame[row]))
    row, column = row[order], column[order]
    _, first, index = np.unique(frame[row], return_index=True, return_inverse=True)
    other_row = np.bincount(index, row != row[first][index]) > 0
    other_column = np.bincount(index, column != column[first][index]) > 0
    crowded = other_row & other_column
    cheapest = first[~crowded]
    partner[row[cheapest]] = column[cheapest]
    ends = np.append(first, len(row))
    for number in np.flatnonzero(crowded):
        members = np.unique(row[ends[number] : ends[number + 1]])
        rows, columns = solve(cost[members], gate)
        partner[members[rows]] = columns
    return partner
