"""How far a set of estimates is from the set of what is there: GOSPA and OSPA, of one moment.

Conventions
-----------
* Base distances are cut at a cut-off c: beyond it an estimate is not the object's. Orders p are at least 1; larger ones
  punish outliers more.
* GOSPA, with alpha = 2 (Rahmathullah, Garcia-Fernandez and Svensson, FUSION 2017): the p-th root of the smallest value,
  over all assignments, of the p-th powers of the assigned distances plus ``c^p / 2`` for everything not assigned. Its
  parts are the sums behind the root: localisation, missed objects, false estimates. Pairs as far apart as c or farther
  are not assigned.
* OSPA (Schuhmacher, Vo and Vo, IEEE Transactions on Signal Processing 56(8), 2008): the p-th root of the smallest mean,
  over the larger set, of the p-th powers of the cut distances, with ``c^p`` for every element that the other set lacks.
  0 for two empty sets, c where one is empty. The assignment is that of the p-th powers, not of the distances.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from uwbbench.api.arrays import FloatArray, IntArray
from uwbbench.api.errors import ScoringError


@dataclass(frozen=True)
class Gospa:
    """GOSPA distance of two sets, with its parts.

    Attributes
    ----------
    localisation, missed, false : float
        Parts of its p-th power: of assigned pairs, of objects without an estimate, of estimates without an object.
    order : float
        The order p.
    """

    localisation: float
    missed: float
    false: float
    order: float

    @property
    def value(self) -> float:
        """The distance, in the unit of the base distance."""
        return float((self.localisation + self.missed + self.false) ** (1 / self.order))


def gospa(truth: ArrayLike, found: ArrayLike, cutoff: float, order: float = 2.0) -> Gospa:
    """GOSPA distance, with alpha = 2, between what is there and what was found.

    Parameters
    ----------
    truth, found : (n,) or (n, axes) array
        Ranges, or positions.
    cutoff : float
        In their unit.
    order : float
        The p of its definition, at least 1.

    Raises
    ------
    ScoringError
        If the cut-off or the order is not allowed, or the sets have different axes.

    Examples
    --------
    One object found 0.3 m off, one missed:

    >>> of = gospa([2.0, 5.0], [2.3], cutoff=0.5)
    >>> round(of.localisation, 6), of.missed, of.false, round(of.value, 6)
    (0.09, 0.125, 0.0, 0.463681)
    """
    distance = _distances(truth, found, cutoff, order)
    rows, columns = assigned(distance, cutoff, order)
    localisation = float(np.sum(distance[rows, columns] ** order))
    missed, false = (cutoff**order / 2 * (count - len(rows)) for count in distance.shape)
    return Gospa(localisation, missed, false, order)


def ospa(truth: ArrayLike, found: ArrayLike, cutoff: float, order: float = 1.0) -> float:
    """OSPA distance between what is there and what was found.

    Parameters
    ----------
    truth, found : (n,) or (n, axes) array
        Ranges, or positions.
    cutoff : float
        In their unit.
    order : float
        The p of its definition, at least 1.

    Raises
    ------
    ScoringError
        If the cut-off or the order is not allowed, or the sets have different axes.

    Examples
    --------
    >>> round(ospa([2.0, 5.0], [2.3], cutoff=0.5), 6), ospa([], [], cutoff=0.5), ospa([2.0], [], cutoff=0.5)
    (0.4, 0.0, 0.5)
    """
    distance = _distances(truth, found, cutoff, order)
    rows, columns = assigned(distance, cutoff, order)
    larger = max(distance.shape)
    if not larger:
        return 0.0
    total = np.sum(distance[rows, columns] ** order) + cutoff**order * (larger - len(rows))
    return float((total / larger) ** (1 / order))


def assigned(distance: FloatArray, cutoff: float, order: float) -> tuple[IntArray, IntArray]:
    """Pairs closer than the cut-off in the assignment whose cut distances, to their p-th power, have the smallest sum.

    Parameters
    ----------
    distance : (rows, columns) array
        NaN where a pair is impossible.
    cutoff : float
    order : float

    Returns
    -------
    (pairs,) int array, (pairs,) int array
        Rows, ascending, and the column of each.
    """
    from scipy.optimize import linear_sum_assignment

    near = distance < cutoff
    rows, columns = linear_sum_assignment(np.where(near, distance / cutoff, 1.0) ** order)
    real = near[rows, columns]
    return rows[real].astype(np.int64), columns[real].astype(np.int64)


def _distances(truth: ArrayLike, found: ArrayLike, cutoff: float, order: float) -> FloatArray:
    """Base distances (truth, found) of checked arguments."""
    if not 0 < cutoff < math.inf:
        raise ScoringError(f"the cut-off must be positive and finite, not {cutoff}")
    if not 1 <= order < math.inf:
        raise ScoringError(f"the order must be at least 1 and finite, not {order}")
    there, seen = (np.asarray(values, float) for values in (truth, found))
    axes = {one.shape[1:] for one in (there, seen) if one.size}
    if len(axes) > 1 or any(len(axis) > 1 for axis in axes):
        raise ScoringError(
            f"expected two sets of ranges, or of positions of as many axes, not {there.shape}, {seen.shape}"
        )
    if not axes:
        return np.zeros((len(there), len(seen)))
    (axis,) = axes
    there, seen = there.reshape(len(there), *axis), seen.reshape(len(seen), *axis)
    difference = there[:, None] - seen[None, :]
    return np.asarray(np.sqrt(np.sum(difference**2, axis=-1)) if axis else np.abs(difference))
