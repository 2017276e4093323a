"""How sure a number is that is made of several scenes: pure functions of what each scene adds to it.

Conventions
-----------
* A *unit* is what counts as one piece of evidence: a scene or set-up, with all captures that repeat it. A number is a
  ratio of sums over units, ``sum(numerators) / sum(denominators)``: for F1 that is 2 tp over 2 tp + fp + fn.
* Arrays are (..., units), so that many numbers are worked out at once. A unit without denominator adds nothing and does
  not count.
* The **outer** interval is given at any number of units. It is that of Clopper and Pearson (Biometrika 26, 1934), as if
  each unit were a single trial that ends all or nothing, with Kish's effective number of trials for units of unequal
  size (Survey Sampling, 1965, section 11.7). No share with the same mean varies more between units.
* The **inner** interval is given from :data:`INNER_UNITS` units on: value +- t x standard error of the jackknife that
  leaves out one unit (Miller, Biometrika 61, 1974), on a scale on which it is nearly symmetric, never beyond the outer.
  The degrees of freedom are Satterthwaite's (Bell and McCaffrey, Survey Methodology 28, 2002): below units - 1 where a
  few long units make most of the number. It describes scenes like those that were seen: of a failure that none of them
  holds it knows nothing, and :func:`failing_share` says how many such scenes there may be.
* Blocks of one to three captures (``strata``) describe these recordings only: the jackknife is stratified by capture.
* Undefined is NaN, also an end that cannot be given; inf is an end that the data do not reach.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from uwbbench.api.arrays import FloatArray

CONFIDENCE = 0.95

INNER_UNITS = 12
"""Fewer units than this have the outer interval only."""

CLIPPED = 1e-6
"""Shares nearer to 0 or 1 than this are taken as this near, so that their logit is finite."""

Scale = Literal["logit", "log", "plain"]


class Interval(NamedTuple):
    """A number, or an array of them, with its ends.

    Attributes
    ----------
    value : float array
    low, high : float array
        The inner interval; the outer one where there are too few units for it.
    outer_low, outer_high : float array
        The outer interval; NaN where the number has no known bound.
    """

    value: FloatArray
    low: FloatArray
    high: FloatArray
    outer_low: FloatArray
    outer_high: FloatArray


class Spread(NamedTuple):
    """Standard error and its degrees of freedom; NaN where a single unit carries the number."""

    error: FloatArray
    degrees: FloatArray


def share(num: ArrayLike, den: ArrayLike, *, confidence: float = CONFIDENCE, strata: int = 0) -> Interval:
    """Interval of a share, such as recall, precision or F1, on the logit scale.

    Parameters
    ----------
    num, den : (..., units) array
        What each unit adds to the numerator, which is never more than what it adds to the denominator.
    confidence : float
    strata : int
        Captures whose blocks the units are, in equal number and capture after capture; 0: the units are scenes.

    Returns
    -------
    Interval

    Examples
    --------
    >>> found = share([90, 80, 100, 95], [100, 100, 100, 100])
    >>> [round(float(end), 3) for end in (found.value, found.low, found.high)]
    [0.912, 0.315, 1.0]
    """
    return _of_ratio(np.asarray(num, float), np.asarray(den, float), "logit", (0.0, 1.0), confidence, strata)


def ratio(
    num: ArrayLike, den: ArrayLike, *, most: ArrayLike = np.nan, confidence: float = CONFIDENCE, strata: int = 0
) -> Interval:
    """Interval of a ratio that is never negative, such as a mean absolute error or a rate, on the log scale.

    Parameters
    ----------
    num, den : (..., units) array
        What each unit adds to the numerator and to the denominator.
    most : array
        Largest value that a unit can have, for the outer interval: of a mean error, the largest error that was seen.
        NaN: no bound is known, and there is no outer interval.
    confidence : float
    strata : int
        As in :func:`share`.

    Returns
    -------
    Interval
    """
    return _of_ratio(np.asarray(num, float), np.asarray(den, float), "log", (0.0, most), confidence, strata)


def mean(
    num: ArrayLike, den: ArrayLike, *, most: ArrayLike = np.nan, confidence: float = CONFIDENCE, strata: int = 0
) -> Interval:
    """Interval of a mean of either sign, such as a bias.

    Parameters
    ----------
    num, den : (..., units) array
        Sum and number of the values of each unit.
    most : array
        Largest magnitude that a value can have, for the outer interval; NaN: not known.
    confidence : float
    strata : int
        As in :func:`share`.

    Returns
    -------
    Interval
    """
    bounds = (-np.asarray(most, float), most)
    return _of_ratio(np.asarray(num, float), np.asarray(den, float), "plain", bounds, confidence, strata)


def quantile(samples: Sequence[FloatArray], q: float, *, confidence: float = CONFIDENCE, strata: int = 0) -> Interval:
    """Interval of a quantile: that of the share of samples below it, mapped back (Woodruff, JASA 47, 1952).

    The share's interval is that of Clopper and Pearson with as many trials as give its standard error (Korn and
    Graubard, Survey Methodology 24, 1998), with t in place of the normal quantile.

    Parameters
    ----------
    samples : sequence of (n,) array
        Samples of each unit.
    q : float
        Which quantile, 0...1; linear between order statistics.
    confidence : float
    strata : int
        As in :func:`share`.

    Returns
    -------
    Interval
        With an upper end of inf where it lies beyond the largest sample.
    """
    held = [np.asarray(part, float) for part in samples]
    every = np.sort(np.concatenate([*held, np.empty(0)]))
    if not len(every):
        return Interval(*np.full(5, np.nan))
    value = np.quantile(every, q)
    size = np.array([len(part) for part in held], float)
    below = np.array([np.count_nonzero(part <= value) for part in held], float)
    ends = [_mapped(every, end) for end in exact(np.asarray(q), effective(size), confidence)]
    spread = _spread(below.sum() / size.sum(), delete_one(below, size), size, strata)
    inner = ends
    if (strata or np.count_nonzero(size) >= INNER_UNITS) and spread.error > 0:
        wide = student(spread.degrees, confidence) / _normal(confidence)
        trials = np.minimum(q * (1 - q) / np.square(spread.error * wide), size.sum())
        low, high = (_mapped(every, end) for end in exact(np.asarray(q), trials, confidence))
        inner = [np.maximum(low, ends[0]), np.minimum(high, ends[1])]
    return Interval(np.asarray(value), *inner, *ends)


def of_left_out(
    value: ArrayLike,
    left: ArrayLike,
    weights: ArrayLike,
    *,
    units: int,
    scale: Scale = "plain",
    confidence: float = CONFIDENCE,
    strata: int = 0,
) -> Interval:
    """Interval of any number from its values without one part of the data at a time; there is no outer interval.

    Parameters
    ----------
    value : (...) array
    left : (..., parts) array
        The value without each unit, or each of some equal shares of the units.
    weights : (..., parts) array
        How much each part adds, such as samples; for the degrees of freedom.
    units : int
        Units that there are.
    scale : {"logit", "log", "plain"}
        On which the interval is symmetric.
    confidence : float
    strata : int
        As in :func:`share`.

    Returns
    -------
    Interval
    """
    centre = np.asarray(value, float)
    middle = _scaled(centre, scale)
    spread = _spread(middle, _scaled(np.asarray(left, float), scale), np.asarray(weights, float), strata)
    enough = units >= INNER_UNITS or strata
    reach = spread.error * student(spread.degrees, confidence) if enough else np.full_like(middle, np.nan)
    none = np.full_like(middle, np.nan)
    return Interval(centre, _unscaled(middle - reach, scale), _unscaled(middle + reach, scale), none, none)


def failing_share(units: int, confidence: float = CONFIDENCE) -> float:
    """Largest share of scenes that may fail although none of those that were seen did: 1 - tail^(1/units).

    Examples
    --------
    >>> [round(failing_share(units), 2) for units in (6, 12, 40)]
    [0.46, 0.26, 0.09]
    """
    return float(1 - ((1 - confidence) / 2) ** (1 / units)) if units else 1.0


# Parts of it -----------------------------------------------------------------------------------------------------


def delete_one(num: FloatArray, den: FloatArray) -> FloatArray:
    """Ratio (..., units) of the sums without each unit; NaN where nothing is left."""
    rest = den.sum(-1, keepdims=True) - den
    missing = rest <= 1e-12 * den.sum(-1, keepdims=True)
    return np.where(missing, np.nan, (num.sum(-1, keepdims=True) - num) / np.where(missing, 1.0, rest))


def effective(weights: FloatArray) -> FloatArray:
    """Kish's effective number of units (...) of unequal size: the square of their sum over the sum of their squares."""
    squares = np.square(weights).sum(-1)
    return np.asarray(np.square(weights.sum(-1)) / np.where(squares > 0, squares, 1.0))


def degrees(weights: FloatArray) -> FloatArray:
    """Satterthwaite's degrees of freedom (...) of the jackknife of a ratio with these denominators (..., units).

    For values of units that are independent, normal and of equal variance, the sum of squares of the jackknife is a
    quadratic form ``y' A y``; it has the degrees of freedom ``tr(A)^2 / tr(A A)`` (Bell and McCaffrey, Survey
    Methodology 28, 2002). Here both traces are worked out in a time that grows with the number of units. They are
    units - 1 for units of one size, and never taken as less than 1.

    Examples
    --------
    >>> degrees(np.ones(10)).round(9).item(), degrees(np.array([9.0, 1, 1, 1, 1])).round(1).item()
    (9.0, 1.1)
    """
    total = weights.sum(-1, keepdims=True)
    part = weights / np.where(total > 0, total, 1.0)
    square = np.square(part).sum(-1)
    pull = np.square(part / np.maximum(1 - part, 1e-3))  # the traces of more extreme ones drown in rounding
    on_diagonal = 1 - 2 * part + square[..., None]
    first = (pull * on_diagonal).sum(-1)
    moments = [(pull * part**power).sum(-1) for power in range(3)]
    second = (np.square(pull) * (np.square(on_diagonal) - np.square(on_diagonal - 1))).sum(-1)
    second += np.square(square * moments[0]) + 2 * moments[0] * moments[2] + 2 * np.square(moments[1])
    second -= 4 * square * moments[0] * moments[1]
    return np.asarray(np.maximum(np.square(first) / np.where(second > 0, second, 1.0), 1.0))


def jackknife(value: FloatArray, left: FloatArray, weights: FloatArray) -> Spread:
    """Standard error of a number (...) from its values without one unit at a time (..., units).

    Deviations are taken from the number itself; units that weigh nothing do not count.
    """
    units = np.count_nonzero(weights, axis=-1)
    off = np.where(weights > 0, left - value[..., None], 0.0)
    error = np.sqrt((units - 1) / np.maximum(units, 1) * np.square(off).sum(-1))
    return Spread(np.where(units > 1, error, np.nan), degrees(weights))


def stratified(left: FloatArray, strata: int) -> Spread:
    """Standard error from values without one block at a time, blocks being compared with others of their capture only.

    Degrees of freedom after Satterthwaite (Biometrics Bulletin 2, 1946), over the captures.
    """
    cells = left.reshape(*left.shape[:-1], strata, -1)
    blocks = cells.shape[-1]
    off = cells - cells.mean(-1, keepdims=True)
    parts = (blocks - 1) / blocks * np.square(off).sum(-1)
    total, squares = parts.sum(-1), np.square(parts).sum(-1)
    freedom = np.where(squares > 0, np.square(total) * (blocks - 1) / np.where(squares > 0, squares, 1.0), 1.0)
    return Spread(np.sqrt(total), freedom)


def exact(value: FloatArray, trials: FloatArray, confidence: float = CONFIDENCE) -> tuple[FloatArray, FloatArray]:
    """Ends of Clopper and Pearson's interval for a share (...) of a number of trials, which need not be whole."""
    from scipy.special import betaincinv

    tail = (1 - confidence) / 2
    yes = np.clip(value, 0.0, 1.0) * trials
    no = np.maximum(trials - yes, 0.0)
    none, all_ = yes <= 1e-9, no <= 1e-9
    low = np.where(none, 0.0, betaincinv(np.where(none, 1.0, yes), no + 1, tail))
    high = np.where(all_, 1.0, betaincinv(yes + 1, np.where(all_, 1.0, no), 1 - tail))
    undefined = np.isnan(value)
    return np.where(undefined, np.nan, low), np.where(undefined, np.nan, high)


def student(freedom: FloatArray, confidence: float = CONFIDENCE) -> FloatArray:
    """Quantile of Student's t that leaves out (1 - confidence) / 2 above it."""
    from scipy.special import stdtrit

    return np.asarray(stdtrit(freedom, (1 + confidence) / 2))


def _normal(confidence: float) -> float:
    from scipy.special import ndtri

    return float(ndtri((1 + confidence) / 2))


def _spread(value: FloatArray, left: FloatArray, weights: FloatArray, strata: int) -> Spread:
    return stratified(left, strata) if strata else jackknife(value, left, weights)


def _of_ratio(
    num: FloatArray,
    den: FloatArray,
    scale: Scale,
    bounds: tuple[ArrayLike, ArrayLike],
    confidence: float,
    strata: int,
) -> Interval:
    """Interval of a ratio of sums: the outer one between the bounds of a unit's value, the inner one on a scale."""
    total = den.sum(-1)
    value = np.where(total > 0, num.sum(-1) / np.where(total > 0, total, 1.0), np.nan)
    least, most = (np.asarray(end, float) for end in bounds)
    width = np.where(most > least, most - least, 1.0)
    ends = [least + width * end for end in exact((value - least) / width, effective(den), confidence)]
    outer_low, outer_high = (np.where(np.isnan(most), np.nan, end) for end in ends)
    spread = _spread(_scaled(value, scale), _scaled(delete_one(num, den), scale), den, strata)
    reach = spread.error * student(spread.degrees, confidence)
    middle = _scaled(value, scale)
    low = np.fmax(_unscaled(middle - reach, scale), outer_low)
    high = np.fmin(_unscaled(middle + reach, scale), outer_high)
    enough = (np.count_nonzero(den, axis=-1) >= INNER_UNITS) | bool(strata)
    inner = enough & np.isfinite(middle) & (spread.error > 1e-9)
    if scale == "logit":
        inner &= (value > 0) & (value < 1)
    return Interval(value, np.where(inner, low, outer_low), np.where(inner, high, outer_high), outer_low, outer_high)


def _scaled(value: FloatArray, scale: Scale) -> FloatArray:
    if scale == "logit":
        kept = np.clip(value, CLIPPED, 1 - CLIPPED)
        return np.asarray(np.log(kept / (1 - kept)))
    if scale == "log":
        return np.log(np.where(value > 0, value, np.nan))
    return value


def _unscaled(value: FloatArray, scale: Scale) -> FloatArray:
    if scale == "logit":
        return 1 / (1 + np.exp(-np.clip(value, -700, 700)))
    return np.exp(np.clip(value, -700, 700)) if scale == "log" else value


def _mapped(every: FloatArray, end: FloatArray) -> FloatArray:
    """Quantile of sorted samples at the end of a share's interval; inf beyond the largest."""
    if end >= 1 - 1 / len(every):
        return np.asarray(np.inf)
    return np.asarray(np.quantile(every, end))
