"""Which of several detectors differ on the same scenes, and which ranks that leaves: pure functions of arrays.

Conventions
-----------
* Detectors are compared in pairs, on the same units (:mod:`uwbbench.measure.accuracy.intervals` says what these are):
  what makes a scene hard for both cancels. The difference is held against its jackknife with Student's t; the degrees
  of freedom are Satterthwaite's, the fewer of the two detectors'.
* The p-values of all pairs of a board are adjusted together after Holm, so that at most 5 % of boards of equal
  detectors hold any difference.
* A detector's *rank set* reaches from one more than the detectors that are better to the number of detectors less those
  that are worse: the ranks that it may have. Those that may be first are the top group.
* *Equal* is what is shown to be so: the 99 % interval of the difference lies inside the margin, from twelve units on.
  At 90 %, the usual two tests, one in six pairs of different detectors would be called equal where F1 is near 1.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.measure.accuracy.intervals import INNER_UNITS, Blocks, degrees, jackknife, stratified, student

RANKED_UNITS = 6
"""Fewer units than this rank nobody."""

SIGNIFICANCE = 0.05
EQUAL_CONFIDENCE = 0.99

Verdict = Literal["differs", "equal", "not told apart", "too few", "undefined"]


class Contrast(NamedTuple):
    """Differences, first minus second.

    Parameters
    ----------
    value, error : float array
        Difference, and its standard error.
    degrees : float array
    p_value : float array
        Two-sided, for no difference; not adjusted.
    """

    value: FloatArray
    error: FloatArray
    degrees: FloatArray
    p_value: FloatArray

    def ends(self, confidence: float) -> tuple[FloatArray, FloatArray]:
        """Ends of the interval of the difference."""
        reach = self.error * student(self.degrees, confidence)
        return self.value - reach, self.value + reach


def contrast(
    value: ArrayLike, left: ArrayLike, weights: tuple[FloatArray, FloatArray], *, blocks: Blocks | None = None
) -> Contrast:
    """Difference of two detectors on the same units.

    Parameters
    ----------
    value : (...) array
        The difference.
    left : (..., units) array
        The difference without each unit.
    weights : pair of (..., units) array
        What each unit weighs for either detector: the denominators of a ratio.
    blocks : Blocks, optional
        The units are blocks of a few recordings; left out: they are scenes.

    Returns
    -------
    Contrast
        Where all units show the same difference, its p-value is that of so many equal signs.
    """
    difference, without = np.asarray(value, float), np.asarray(left, float)
    together = weights[0] + weights[1]
    if blocks is not None:
        spread = stratified(without, blocks)
        freedom = spread.degrees
    else:
        spread = jackknife(difference, without, together)
        freedom = np.minimum(degrees(weights[0]), degrees(weights[1]))
    units = np.count_nonzero(together, axis=-1)
    return Contrast(difference, spread.error, freedom, _p_value(difference, spread.error, freedom, units))


def board(values: FloatArray, left: FloatArray, weights: FloatArray) -> Contrast:
    """All differences of several detectors on the same units.

    Parameters
    ----------
    values : (..., detectors) array
        Number of each detector.
    left : (..., detectors, units) array
        The same without each unit.
    weights : (..., detectors, units) array
        What each unit weighs for each.

    Returns
    -------
    Contrast
        Of (..., detectors, detectors) arrays, row minus column; NaN where a number is undefined.
    """
    units = np.count_nonzero(weights.any(axis=-2), axis=-1)[..., None, None]
    off = np.where(weights > 0, left - values[..., None], 0.0)
    inner = off @ np.swapaxes(off, -1, -2)
    own = np.diagonal(inner, axis1=-2, axis2=-1)
    both = own[..., :, None] + own[..., None, :]
    square = both - 2 * inner
    square = np.where(square > 1e-12 * both, square, 0.0)  # what is left of equal ones is rounding
    error = np.sqrt(square * (units - 1) / np.maximum(units, 1))
    freedom = degrees(weights)
    fewer = np.minimum(freedom[..., :, None], freedom[..., None, :])
    difference = values[..., :, None] - values[..., None, :]
    return Contrast(difference, error, fewer, _p_value(difference, error, fewer, units))


def _p_value(difference: FloatArray, error: FloatArray, freedom: FloatArray, units: ArrayLike) -> FloatArray:
    from scipy.special import stdtr

    varies = error > 1e-9 * np.abs(difference)  # less is what rounding leaves of the same difference in all units
    constant = np.where(difference == 0, 1.0, 2.0 ** (1 - np.asarray(units, float)))
    p_value = np.where(varies, 2 * stdtr(freedom, -np.abs(difference) / np.where(varies, error, 1.0)), constant)
    return np.where(np.isnan(difference) | np.isnan(error), np.nan, p_value)


def holm(p_values: ArrayLike) -> FloatArray:
    """Adjust p-values for several comparisons (Holm, Scandinavian Journal of Statistics 6, 1979).

    The i-th smallest of m is multiplied by m - i + 1, made non-decreasing, and cut at 1. NaN stays NaN and does not
    count as a comparison.

    Examples
    --------
    >>> holm([0.01, 0.04, 0.03]).round(6).tolist()
    [0.03, 0.06, 0.06]
    """
    given = np.asarray(p_values, float)
    adjusted = np.full(given.shape, np.nan)
    tested = np.flatnonzero(np.isfinite(given))
    order = tested[np.argsort(given[tested], kind="stable")]
    factors = len(order) - np.arange(len(order))
    adjusted[order] = np.minimum(np.maximum.accumulate(given[order] * factors), 1.0)
    return adjusted


def adjusted(p_values: FloatArray) -> FloatArray:
    """P-values of all pairs (detectors, detectors) after Holm, each pair counted once."""
    first, second = np.triu_indices(len(p_values), 1)
    every = np.full(p_values.shape, np.nan)
    every[first, second] = every[second, first] = holm(p_values[first, second])
    return every


def rank_sets(ahead: BoolArray) -> IntArray:
    """Smallest and largest rank (detectors, 2) that each detector may have.

    Parameters
    ----------
    ahead : (detectors, detectors) bool array
        Whether the detector of the row is better than that of the column, beyond chance.

    Examples
    --------
    Three detectors, of which the first is better than the last, and no more is known:

    >>> rank_sets(np.array([[0, 0, 1], [0, 0, 0], [0, 0, 0]], bool)).tolist()
    [[1, 2], [1, 3], [2, 3]]
    """
    return np.stack([1 + ahead.sum(axis=0), len(ahead) - ahead.sum(axis=1)], axis=1)


def verdict(found: Contrast, adjusted_p: float, units: int, margin: float, least: int = RANKED_UNITS) -> Verdict:
    """What a single difference says, in one word or two.

    Parameters
    ----------
    found : Contrast
        Of single numbers.
    adjusted_p : float
        Its p-value after Holm.
    units : int
        Scenes behind it.
    margin : float
        Difference that does not matter.
    least : int
        Fewer units than this decide nothing.

    Returns
    -------
    {"differs", "equal", "not told apart", "too few", "undefined"}
        A difference that is certain but smaller than the margin is "equal".
    """
    if units < least:
        return "too few"
    if np.isnan(found.value) or np.isnan(found.error):
        return "undefined"
    low, high = found.ends(EQUAL_CONFIDENCE)
    if units >= INNER_UNITS and -margin < low and high < margin:
        return "equal"
    return "differs" if adjusted_p < SIGNIFICANCE else "not told apart"
