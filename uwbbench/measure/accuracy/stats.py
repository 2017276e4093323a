"""How sure a number is: intervals, comparisons of detectors, and how many samples a percentile needs.

Conventions
-----------
* Single frames are correlated (the scene hardly changes between them), so they are never resampled one by one. What is
  drawn is a group: a capture where there are at least eight, else a block of at least one second of a capture.
* Below eight groups a bootstrap interval means little: it is NaN, and the value of each group is given instead.
* Intervals are two-sided with equal tails. All draws are seeded: the same input gives the same interval.
* A metric is merged before it is evaluated: the value of a set of groups is that of all their frames together, not
  the mean of the groups' values.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.metric import Metric, Outcome
from uwbbench.measure.accuracy.groups import groups_of, taken

MINIMUM_GROUPS = 8
"""Fewer groups than this give no interval."""

DEFINED_SHARE = 0.95
"""Share of the resamples in which a metric must be defined; with less, its interval would describe the rest alone."""


@dataclass(frozen=True)
class Estimate:
    """A number and how sure it is.

    Attributes
    ----------
    value : float
        The metric of all outcomes together; NaN where it is undefined.
    low, high : float
        Ends of the interval; NaN where there are too few groups.
    n : int
        Samples behind the value: errors for a metric that stacks them, scored frames for one that counts (none where
        that metric is undefined).
    groups : int
        Groups that were resampled.
    per_group : tuple of float
        Value of each group where there are too few of them for an interval.
    """

    value: float
    low: float
    high: float
    n: int
    groups: int
    per_group: tuple[float, ...] = ()


@dataclass(frozen=True)
class Difference(Estimate):
    """A difference of two detectors on the same captures.

    Attributes
    ----------
    p_value : float
        Two-sided, for the hypothesis that they do not differ; NaN where there are too few groups. Adjust it with
        :func:`holm` where several detectors are compared.
    """

    p_value: float = math.nan


def merge(metric: type[Metric], partials: Sequence[FloatArray]) -> FloatArray:
    """One partial from several, in the way that the metric merges."""
    return np.sum(partials, axis=0) if metric.merge == "sum" else np.concatenate(partials)


def evaluate(metric: type[Metric], outcomes: Sequence[Outcome]) -> float:
    """Value of a metric over all outcomes together; NaN where there are none."""
    if not outcomes:
        return math.nan
    return metric.value(merge(metric, [metric.partial(outcome) for outcome in outcomes]))


def bootstrap(
    metric: type[Metric],
    outcomes: Sequence[Outcome],
    *,
    resamples: int = 2000,
    confidence: float = 0.95,
    seed: int = 0,
) -> Estimate:
    """Estimate a metric with its percentile-bootstrap interval over groups.

    Percentile interval after Efron and Tibshirani, An Introduction to the Bootstrap (1993), chapter 13, on whole
    groups, which keeps the correlation inside them.

    Parameters
    ----------
    metric : type of Metric
    outcomes : sequence of Outcome
        One for each capture.
    resamples : int
    confidence : float
        Coverage of the interval.
    seed : int

    Returns
    -------
    Estimate
    """
    (groups,) = groups_of([outcomes], MINIMUM_GROUPS)
    partials = [metric.partial(group) for group in groups]
    value = metric.value(merge(metric, partials)) if partials else math.nan
    low, high = _interval(_draws(metric, [partials], resamples, seed)[:, 0], confidence)
    few = tuple(metric.value(part) for part in partials) if len(groups) < MINIMUM_GROUPS else ()
    return Estimate(value, low, high, _samples(metric, outcomes, value), len(groups), few)


def paired_difference(
    metric: type[Metric],
    first: Sequence[Outcome],
    second: Sequence[Outcome],
    *,
    resamples: int = 2000,
    confidence: float = 0.95,
    seed: int = 0,
) -> Difference:
    """Difference of two detectors, first minus second, on the same captures.

    Both are evaluated on the same drawn groups, so that what makes a capture hard for both cancels. The p-value is
    the achieved significance level of the bootstrap with one added to both counts, so that it is never 0 (Davison and
    Hinkley, Bootstrap Methods and their Application, 1997, eq. 4.11).

    Parameters
    ----------
    metric : type of Metric
    first, second : sequence of Outcome
        One for each capture, the captures in the same order.
    resamples : int
    confidence : float
        Coverage of the interval.
    seed : int

    Returns
    -------
    Difference

    Raises
    ------
    ValueError
        If the two do not cover the same number of captures.
    """
    if len(first) != len(second):
        raise ValueError(f"a paired comparison needs the same captures, not {len(first)} and {len(second)}")
    pair = [[metric.partial(group) for group in groups] for groups in groups_of([first, second], MINIMUM_GROUPS)]
    values = evaluate(metric, first), evaluate(metric, second)
    drawn = _draws(metric, pair, resamples, seed)
    differences = drawn[:, 0] - drawn[:, 1]
    low, high = _interval(differences, confidence)
    few: tuple[float, ...] = ()
    if len(pair[0]) < MINIMUM_GROUPS:
        few = tuple(metric.value(left) - metric.value(right) for left, right in zip(*pair, strict=True))
    return Difference(
        value=values[0] - values[1],
        low=low,
        high=high,
        n=min(_samples(metric, first, values[0]), _samples(metric, second, values[1])),
        groups=len(pair[0]),
        per_group=few,
        p_value=math.nan if math.isnan(low) else _p_value(differences),
    )


def paired_draws(
    metric: type[Metric], series: Sequence[Sequence[Outcome]], *, resamples: int = 2000, seed: int = 0
) -> FloatArray:
    """Values of several detectors in resamples of the same captures.

    Parameters
    ----------
    metric : type of Metric
    series : sequence of sequences of Outcome
        One for each detector, and in it one for each capture, the captures in the same order.
    resamples : int
    seed : int

    Returns
    -------
    (resamples, detectors) array
        Each row is of one draw of groups, the same for all detectors; no rows where there are too few groups.
    """
    partials = [[metric.partial(group) for group in groups] for groups in groups_of(list(series), MINIMUM_GROUPS)]
    return _draws(metric, partials, resamples, seed)


def subset(outcome: Outcome, frames: BoolArray) -> Outcome:
    """Outcome of the marked ones (scored frames,) among its frames."""
    rows = np.flatnonzero(frames)
    position = np.empty(len(outcome.group), np.int64)
    position[rows] = np.arange(len(rows))
    return taken(outcome, rows, np.flatnonzero(frames[outcome.error_frame]), position)


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


def clopper_pearson(successes: float, trials: float, confidence: float = 0.95) -> tuple[float, float]:
    """Exact interval of a proportion of independent trials (Clopper and Pearson, Biometrika 26, 1934).

    For trials that are independent; :func:`clustered_proportion` is for those that come in groups.

    Parameters
    ----------
    successes, trials : float
        Whole numbers; or effective ones, for which the interval between those of whole numbers is given.
    confidence : float

    Returns
    -------
    low, high : float
        0...1 where there is no trial.

    Raises
    ------
    ValueError
        If there are more successes than trials.

    Examples
    --------
    >>> low, high = clopper_pearson(0, 10)
    >>> low, round(high, 4)
    (0.0, 0.3085)
    """
    from scipy.special import betaincinv

    if not 0 <= successes <= trials:
        raise ValueError(f"{successes} successes of {trials} trials")
    tail = (1 - confidence) / 2
    failures = trials - successes
    low = float(betaincinv(successes, failures + 1, tail)) if successes else 0.0
    high = float(betaincinv(successes + 1, failures, 1 - tail)) if failures else 1.0
    return low, high


def clustered_proportion(successes: IntArray, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Interval of a proportion whose trials come in independent groups and are correlated inside them.

    The exact interval of an effective number of trials: the given number over the design effect, by which correlation
    raises the variance (Korn and Graubard, Survey Methodology 24, 1998). The effect is taken as the number of
    successes that a success has in its group, itself included, on average: ``sum(s^2) / sum(s)``. It is never below
    the ratio of variances and equal to it for rare successes. One more success is counted that shares its group with
    ``trials`` of them. So a few successes, each alone, do not pass for a proof of independence; and without any
    success the groups alone are counted, as if all trials of a group ended alike.

    Parameters
    ----------
    successes : (groups,) int array
        Successes of each group.
    trials : int
        Trials of each group.
    confidence : float

    Returns
    -------
    low, high : float
        0...1 where there is no group.

    Raises
    ------
    ValueError
        If there are more successes than trials.

    Examples
    --------
    Forty alarms in a thousand frames of twenty cells: each in a frame of its own, or ten in each of four frames.

    >>> apart, together = np.zeros(1000, int), np.zeros(1000, int)
    >>> apart[:40], together[:4] = 1, 10
    >>> [tuple(round(end, 4) for end in clustered_proportion(alarms, 20)) for alarms in (apart, together)]
    [(0.0013, 0.0029), (0.0005, 0.0052)]
    """
    total = float(np.sum(successes))
    effect = (float(np.sum(np.square(successes))) + trials) / (total + 1)
    return clopper_pearson(total / effect, len(successes) * trials / effect, confidence)


def samples_needed(quantile: float, confidence: float = 0.95) -> int:
    """Smallest number of samples whose order statistics can bracket a quantile on both sides.

    The largest of n samples lies below the quantile q with probability q^n, the smallest above it with (1 - q)^n. A
    distribution-free interval with equal tails exists once both are at most (1 - confidence) / 2 (David and Nagaraja,
    Order Statistics, 2003, section 7.1), so n = log((1 - confidence) / 2) / log(max(q, 1 - q)), rounded up.

    Examples
    --------
    >>> [samples_needed(q) for q in (0.90, 0.95, 0.99)]
    [36, 72, 368]
    """
    return math.ceil(math.log((1 - confidence) / 2) / math.log(max(quantile, 1 - quantile)))


def _samples(metric: type[Metric], outcomes: Sequence[Outcome], value: float) -> int:
    if metric.merge == "stack":
        return sum(len(metric.partial(outcome)) for outcome in outcomes)
    return 0 if math.isnan(value) else sum(len(outcome.group) for outcome in outcomes)


def _draws(metric: type[Metric], series: list[list[FloatArray]], resamples: int, seed: int) -> FloatArray:
    """Metric (resamples, detectors) of drawn groups, the same draw for all detectors; none if groups are too few."""
    groups = len(series[0])
    if groups < MINIMUM_GROUPS:
        return np.empty((0, len(series)))
    counts = _counts(groups, resamples, seed)
    return np.stack([metric.resampled(partials, counts) for partials in series], axis=1)


@lru_cache(maxsize=64)
def _counts(groups: int, resamples: int, seed: int) -> FloatArray:
    """How often each group (resamples, groups) is drawn; as many draws as groups.

    Whole numbers, as floats: products of float matrices are many times faster.
    """
    rng = np.random.default_rng(seed)
    drawn = rng.integers(groups, size=(resamples, groups))
    cell = drawn + groups * np.arange(resamples)[:, None]
    return np.bincount(cell.ravel(), minlength=resamples * groups).reshape(resamples, groups).astype(np.float64)


def _interval(draws: FloatArray, confidence: float) -> tuple[float, float]:
    defined = draws[np.isfinite(draws)]
    if len(defined) == 0 or len(defined) < DEFINED_SHARE * len(draws):
        return math.nan, math.nan
    tail = (1 - confidence) / 2
    low, high = np.quantile(defined, [tail, 1 - tail])
    return float(low), float(high)


def _p_value(differences: FloatArray) -> float:
    """Two-sided significance level of resampled differences against 0."""
    defined = differences[np.isfinite(differences)]
    tail = min(np.sum(defined <= 0), np.sum(defined >= 0))
    return float(min(1.0, 2 * (tail + 1) / (len(defined) + 1)))
