"""Values in order, compiled: the k-th smallest, the median, and a sort.

numba's own compile to a dozen functions each, two seconds of a machine's first run; these are one small function.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from uwbbench.api import FloatArray, compiled


@compiled
def smallest(values: FloatArray, place: int) -> float:
    """Value that would stand at a place, from 0, if the values (n,) were sorted; they change their order.

    C. A. R. Hoare, "Algorithm 65: FIND", Communications of the ACM 4(7), 1961.
    """
    low, high = 0, len(values) - 1
    while low < high:
        pivot, left, right = values[place], low, high
        while left <= right:
            while values[left] < pivot:
                left += 1
            while pivot < values[right]:
                right -= 1
            if left <= right:
                values[left], values[right] = values[right], values[left]
                left += 1
                right -= 1
        if right < place:
            low = left
        if place < left:
            high = right
    found: float = values[place]
    return found


@compiled
def median(values: FloatArray) -> float:
    """Median of values (n,), NaN of none, as numpy's; they change their order."""
    count = len(values)
    if count == 0:
        return np.nan
    middle = smallest(values, count // 2)
    if count % 2:
        return middle
    below: float = values[0]  # what stands before the middle is not larger
    for place in range(1, count // 2):
        below = max(below, values[place])
    return (below + middle) / 2


@compiled
def _sift(values: Any, root: int, stop: int) -> None:
    """Let the value at the root of a heap sink to where no value below it is larger."""
    top = values[root]
    while True:
        child = 2 * root + 1
        if child >= stop:
            break
        if child + 1 < stop and values[child] < values[child + 1]:
            child += 1
        if not top < values[child]:
            break
        values[root] = values[child]
        root = child
    values[root] = top


@compiled
def sort(values: Any) -> None:
    """Sort values (n,) in place, rising.

    J. W. J. Williams, "Algorithm 232: Heapsort", Communications of the ACM 7(6), 1964.
    """
    count = len(values)
    for root in range(count // 2 - 1, -1, -1):
        _sift(values, root, count)
    for last in range(count - 1, 0, -1):
        values[0], values[last] = values[last], values[0]
        _sift(values, last - last, last)  # what is called with a plain 0 is compiled for it alone
