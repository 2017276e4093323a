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
  leaves out one unit (Miller, Biometrika 61, 1974), on the logit scale. The degrees of freedom are Satterthwaite's
  (Bell and McCaffrey, Survey Methodology 28, 2002): below units - 1 where a few long units make most of it. Its lower
  end is that with half a unit more that fails altogether, its upper end that with half a unit more in which all is
  right, as scenes that fail are often rare, and then none is among a dozen. It is never wider than the outer one.
* A mean error is taken as a share of the largest error that was seen: no data bound what lies beyond that. So it has an
  upper end from :data:`INNER_UNITS` units on only.
* :class:`Blocks` of one to three captures describe these recordings only: the jackknife is stratified by capture.
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

LEVELS = 64
"""Values that are tried on either side of a quantile; ends are rounded outwards to one of them."""

CORRELATION_S = 3.0
"""Time over which single frames of a recording may be correlated."""

CLIPPED = 1e-6
"""Shares nearer to 0 or 1 than this are taken as this near, so that their logit is finite."""

Scale = Literal["logit", "log", "plain"]


class Interval(NamedTuple):
    """A number, or an array of them, with its ends.

    Parameters
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


class Blocks(NamedTuple):
    """Blocks of a few recordings, in equal number for each and recording after recording.

    Parameters
    ----------
    captures : int
    seconds : float
        Length of a block, in the shortest recording.
    """

    captures: int
    seconds: float


class Spread(NamedTuple):
    """Standard error and its degrees of freedom; NaN where a single unit carries the number."""

    error: FloatArray
    degrees: FloatArray


def share(num: ArrayLike, den: ArrayLike, *, confidence: float = CONFIDENCE, blocks: Blocks | None = None) -> Interval:
    """Interval of a share, such as recall, precision or F1, on the logit scale.

    Parameters
    ----------
    num, den : (..., units) array
        What each unit adds to the numerator, which is never more than what it adds to the denominator.
    confidence : float
    blocks : Blocks, optional
        The units are blocks of a few recordings; left out: they are scenes.

    Returns
    -------
    Interval

    Examples
    --------
    >>> found = share([90, 80, 100, 95], [100, 100, 100, 100])
    >>> [round(float(end), 3) for end in (found.value, found.low, found.high)]
    [0.912, 0.315, 1.0]
    """
    n, d = np.asarray(num, float), np.asarray(den, float)
    value = _ratio(n, d)
    outer_low, outer_high = exact(value, effective(d), confidence)
    if blocks is None:  # as it is, with half a unit that fails, and with half a one that does not
        half = d.sum(-1, keepdims=True) / np.maximum(2 * np.count_nonzero(d, axis=-1, keepdims=True), 1)
        n = np.stack([np.concatenate([n, part * half], axis=-1) for part in (0, 0, 1)])
        d = np.stack([np.concatenate([d, part * half], axis=-1) for part in (0, 1, 1)])
    lows, highs = _student_ends(n, d, "logit", confidence, blocks)
    if blocks is None:
        lows, highs, d = np.fmin.reduce(lows), np.fmax.reduce(highs), d[0]
    low, high = np.fmax(np.fmin(value, lows), outer_low), np.fmin(np.fmax(value, highs), outer_high)
    inner = (np.count_nonzero(d, axis=-1) >= INNER_UNITS) | (blocks is not None)
    return Interval(value, np.where(inner, low, outer_low), np.where(inner, high, outer_high), outer_low, outer_high)


def ratio(
    num: ArrayLike,
    den: ArrayLike,
    *,
    most: ArrayLike = np.nan,
    confidence: float = CONFIDENCE,
    blocks: Blocks | None = None,
) -> Interval:
    """Interval of a ratio that is never negative, such as a mean absolute error or a rate.

    Parameters
    ----------
    num, den : (..., units) array
        What each unit adds to the numerator and to the denominator.
    most : array
        Largest value that a unit can have: of a mean error, the largest error that was seen. NaN: no bound is known;
        the inner interval is then that of the logarithm, and there is no outer one.
    confidence, blocks
        As in :func:`share`.
    """
    n, d, bound = np.asarray(num, float), np.asarray(den, float), np.asarray(most, float)
    if np.isnan(bound).all():
        low, high = _student_ends(n, d, "log", confidence, blocks)
        enough = (np.count_nonzero(d, axis=-1) >= INNER_UNITS) | (blocks is not None)
        none = np.full_like(low, np.nan)
        return Interval(_ratio(n, d), np.where(enough, low, np.nan), np.where(enough, high, np.nan), none, none)
    scale = np.where(bound > 0, bound, 1.0)
    value, low, high, outer_low, outer_high = (
        bound * part for part in share(n / scale[..., None], d, confidence=confidence, blocks=blocks)
    )
    few = np.count_nonzero(d, axis=-1) < INNER_UNITS
    outer_high = np.where(few & ~np.isnan(value), np.inf, outer_high)
    return Interval(value, low, high if blocks else np.where(few, outer_high, high), outer_low, outer_high)


def mean(
    num: ArrayLike, den: ArrayLike, *, most: ArrayLike, confidence: float = CONFIDENCE, blocks: Blocks | None = None
) -> Interval:
    """Interval of a mean of either sign, such as a bias.

    Parameters
    ----------
    num, den : (..., units) array
        Sum and number of the values of each unit.
    most : array
        Largest magnitude of these values.
    confidence, blocks
        As in :func:`share`.
    """
    n, d, bound = np.asarray(num, float), np.asarray(den, float), np.asarray(most, float)
    scale = np.where(bound > 0, bound, 1.0)
    above = (n / scale[..., None] + d) / 2  # a mean in -most...most is a share of the way between them
    found = [scale * (2 * part - 1) for part in share(above, d, confidence=confidence, blocks=blocks)]
    few = (np.count_nonzero(d, axis=-1) < INNER_UNITS) & (blocks is None)
    return Interval(found[0], *(np.where(few, np.nan, end) for end in found[1:]))


def quantile(
    samples: Sequence[FloatArray], q: float, *, confidence: float = CONFIDENCE, blocks: Blocks | None = None
) -> Interval:
    """Interval of a quantile: all values below which the share of samples may be ``q`` (Woodruff, JASA 47, 1952).

    A value is inside if ``q`` is in the interval of the share of samples up to it.

    Parameters
    ----------
    samples : sequence of (n,) array
        Samples of each unit.
    q : float
        Which quantile, 0...1; linear between order statistics.
    confidence : float
    blocks : Blocks, optional
        As in :func:`share`.

    Returns
    -------
    Interval
        With an upper end of inf where it lies beyond the largest sample.
    """
    held = [np.sort(np.asarray(part, float)) for part in samples]
    every = np.sort(np.concatenate([*held, np.empty(0)]))
    if not len(every):
        return Interval(*np.full(5, np.nan))
    levels = np.concatenate([q * np.linspace(0, 1, LEVELS, endpoint=False), q + (1 - q) * np.linspace(0, 1, LEVELS)])
    tried = every[np.unique(np.round(levels * (len(every) - 1)).astype(int))]
    below = np.array([np.searchsorted(part, tried, side="right") for part in held], float).T
    size = np.broadcast_to(np.array([len(part) for part in held], float), below.shape)
    found = share(below, size, confidence=confidence, blocks=blocks)
    value = np.quantile(every, q)
    ends = []
    for low, high in ((found.low, found.high), (found.outer_low, found.outer_high)):
        under, over = tried[high < q], tried[low > q]
        ends += [under.max(initial=every[0]), over.min() if len(over) else np.inf]
    return Interval(value, *(np.asarray(end) for end in ends))


def of_left_out(
    value: ArrayLike,
    left: ArrayLike,
    weights: ArrayLike,
    *,
    enough: bool,
    scale: Scale = "plain",
    confidence: float = CONFIDENCE,
    blocks: Blocks | None = None,
) -> Interval:
    """Interval of any number from its values without one part of the data at a time; there is no outer interval.

    Parameters
    ----------
    value : (...) array
    left : (..., parts) array
        The value without each unit, or each of some equal shares of the units.
    weights : (..., parts) array
        How much each part adds, such as samples; for the degrees of freedom.
    enough : bool
        Whether there are units enough for an interval; blocks always are.
    scale : {"logit", "log", "plain"}
        On which the interval is symmetric.
    confidence, blocks
        As in :func:`share`.
    """
    centre = np.asarray(value, float)
    middle = _scaled(centre, scale)
    spread = _spread(middle, _scaled(np.asarray(left, float), scale), np.asarray(weights, float), blocks)
    known = enough or blocks is not None
    reach = spread.error * student(spread.degrees, confidence) if known else np.full_like(middle, np.nan)
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

    Parameters
    ----------
    value, left, weights : (...), (..., units) and (..., units) array
    """
    units = np.count_nonzero(weights, axis=-1)
    off = np.where(weights > 0, left - value[..., None], 0.0)
    error = np.sqrt((units - 1) / np.maximum(units, 1) * np.square(off).sum(-1))
    return Spread(np.where(units > 1, error, np.nan), degrees(weights))


def stratified(left: FloatArray, blocks: Blocks) -> Spread:
    """Standard error from values without one block at a time, blocks being compared with others of their capture only.

    Degrees of freedom after Satterthwaite (Biometrics Bulletin 2, 1946), over the captures. Neighbouring blocks are
    alike, which hides part of the spread: the variance is widened by ``1 + 2 s / b``, with blocks of b seconds and
    frames that are correlated over s = :data:`CORRELATION_S`.
    """
    cells = left.reshape(*left.shape[:-1], blocks.captures, -1)
    count = cells.shape[-1]
    off = cells - cells.mean(-1, keepdims=True)
    parts = (count - 1) / count * np.square(off).sum(-1)
    total, squares = parts.sum(-1), np.square(parts).sum(-1)
    freedom = np.where(squares > 0, np.square(total) * (count - 1) / np.where(squares > 0, squares, 1.0), 1.0)
    return Spread(np.sqrt(total * (1 + 2 * CORRELATION_S / blocks.seconds)), freedom)


def exact(value: FloatArray, trials: FloatArray, confidence: float = CONFIDENCE) -> tuple[FloatArray, FloatArray]:
    """Ends of Clopper and Pearson's interval for a share of a number of trials, which need not be whole.

    Parameters
    ----------
    value, trials : (...) array
    confidence : float
    """
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


def _spread(value: FloatArray, left: FloatArray, weights: FloatArray, blocks: Blocks | None) -> Spread:
    return stratified(left, blocks) if blocks else jackknife(value, left, weights)


def _ratio(num: FloatArray, den: FloatArray) -> FloatArray:
    total = den.sum(-1)
    return np.where(total > 0, num.sum(-1) / np.where(total > 0, total, 1.0), np.nan)


def _student_ends(
    num: FloatArray, den: FloatArray, scale: Scale, confidence: float, blocks: Blocks | None
) -> tuple[FloatArray, FloatArray]:
    """Ends of Student's interval of a ratio of sums on a scale; NaN where nothing varies."""
    middle = _scaled(_ratio(num, den), scale)
    spread = _spread(middle, _scaled(delete_one(num, den), scale), den, blocks)
    reach = np.where(spread.error > 1e-9, spread.error * student(spread.degrees, confidence), np.nan)
    return _unscaled(middle - reach, scale), _unscaled(middle + reach, scale)


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
