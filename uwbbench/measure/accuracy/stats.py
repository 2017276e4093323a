"""How sure a number is: intervals, comparisons of detectors, and how many samples a percentile needs.

Conventions
-----------
* A metric is merged before it is evaluated: the value of several captures is that of all their frames together, not
  the mean of the captures' values.
* The unit of evidence is a scene or set-up: captures that repeat one another are put together first. How intervals come
  from units, and from how many, is said in :mod:`uwbbench.measure.accuracy.intervals`; which kind of interval a metric
  has, the metric says (:attr:`uwbbench.api.metric.Metric.kind`).
* With one to three scenes, the ends of an estimate describe these recordings only (``within``): four blocks of each
  capture are compared with one another, never capture with capture. They rank nobody.
* Where runs are judged as a whole, each run is a unit, whatever scene it is of; fewer than ten have no interval.
* Nothing is drawn: the same outcomes give the same interval.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.metric import Metric, Outcome
from uwbbench.measure.accuracy.boards import Contrast, board, contrast
from uwbbench.measure.accuracy.evidence import LEAST_RUNS, Evidence, interval_of, least_units, left_out, merge
from uwbbench.measure.accuracy.groups import taken
from uwbbench.measure.accuracy.intervals import CONFIDENCE, INNER_UNITS, exact


@dataclass(frozen=True)
class Estimate:
    """A number and how sure it is.

    Attributes
    ----------
    value : float
        The metric of all outcomes together; NaN where it is undefined.
    low, high : float
        Ends of the interval; NaN where there is none, inf where the data do not reach the end.
    n : int
        Samples behind the value: errors for a metric that stacks them, scored frames for one that counts (none where
        that metric is undefined).
    groups : int
        Scenes behind it.
    per_group : tuple of float
        Value of each scene where there are too few of them for an inner interval.
    outer_low, outer_high : float
        Ends of the outer interval, which is given at any number of scenes; NaN where there is none.
    within : bool
        Whether ``low`` and ``high`` describe these recordings only.
    """

    value: float
    low: float
    high: float
    n: int
    groups: int
    per_group: tuple[float, ...] = ()
    outer_low: float = math.nan
    outer_high: float = math.nan
    within: bool = False


@dataclass(frozen=True)
class Difference(Estimate):
    """A difference of two detectors on the same captures.

    Attributes
    ----------
    p_value : float
        Two-sided, for the hypothesis that they do not differ; NaN within recordings, and where it is undefined. Adjust
        it with :func:`uwbbench.measure.accuracy.boards.holm` where several detectors are compared.
    error, degrees : float
        Standard error, and its degrees of freedom.
    """

    p_value: float = math.nan
    error: float = math.nan
    degrees: float = math.nan

    @classmethod
    def of(cls, found: Contrast, confidence: float = CONFIDENCE, **about: Any) -> Difference:
        """Difference with its interval.

        Parameters
        ----------
        found : Contrast
            Of single numbers.
        confidence : float
        **about
            Further attributes: ``n``, ``groups``, ``per_group`` and ``within``.
        """
        low, high = (float(end) for end in found.ends(confidence))
        p_value = math.nan if about.get("within") else float(found.p_value)
        error, freedom = float(found.error), float(found.degrees)
        return cls(float(found.value), low, high, p_value=p_value, error=error, degrees=freedom, **about)

    @property
    def contrast(self) -> Contrast:
        """The same as arrays."""
        return Contrast(*(np.asarray(part) for part in (self.value, self.error, self.degrees, self.p_value)))


def evaluate(metric: type[Metric], outcomes: Sequence[Outcome]) -> float:
    """Value of a metric over all outcomes together; NaN where there are none."""
    if not outcomes:
        return math.nan
    return metric.value(merge(metric, [metric.partial(outcome) for outcome in outcomes]))


def estimated(
    metric: type[Metric],
    outcomes: Sequence[Outcome],
    scenes: Sequence[Hashable] = (),
    *,
    confidence: float = CONFIDENCE,
) -> Estimate:
    """Value of a metric with its intervals.

    Parameters
    ----------
    metric : type of Metric
    outcomes : sequence of Outcome
        One for each capture.
    scenes : sequence
        What each capture is of; captures of one scene repeat one another. Empty: each is of a scene of its own.
    confidence : float
        Coverage of the intervals.

    Returns
    -------
    Estimate
    """
    evidence = Evidence.of(metric, [outcomes], scenes)
    (parts,) = evidence.units
    (value,) = evidence.values(metric)
    found = interval_of(metric, parts, value, confidence)
    inner = found
    if evidence.blocks:
        inner = interval_of(metric, evidence.blocks[0], value, confidence, evidence.recordings)
    return Estimate(
        value,
        float(inner.low),
        float(inner.high),
        samples_behind(metric, outcomes, value),
        len(parts),
        tuple(metric.value(part) for part in parts) if len(parts) < INNER_UNITS else (),
        float(found.outer_low),
        float(found.outer_high),
        bool(evidence.blocks),
    )


def paired_difference(
    metric: type[Metric],
    first: Sequence[Outcome],
    second: Sequence[Outcome],
    scenes: Sequence[Hashable] = (),
    *,
    confidence: float = CONFIDENCE,
) -> Difference:
    """Difference of two detectors, first minus second, on the same captures.

    Parameters
    ----------
    metric : type of Metric
    first, second : sequence of Outcome
        One for each capture, the captures in the same order.
    scenes : sequence
        As in :func:`estimated`.
    confidence : float
        Coverage of the interval.

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
    evidence = Evidence.of(metric, [first, second], scenes)
    values = evidence.values(metric)
    within = bool(evidence.blocks)
    sides = [left_out(metric, parts, evidence.recordings) for parts in evidence.blocks or evidence.units]
    (left, weight), (other_left, other_weight) = sides
    found = contrast(values[0] - values[1], left - other_left, (weight, other_weight), blocks=evidence.recordings)
    if metric.of.of_run and len(evidence.units[0]) < LEAST_RUNS:
        found = found._replace(error=np.array(math.nan), p_value=np.array(math.nan))
    pairs = zip(*evidence.units, strict=True)
    few = len(evidence.units[0]) < INNER_UNITS
    return Difference.of(
        found,
        confidence,
        n=min(samples_behind(metric, one, value) for one, value in zip((first, second), values, strict=True)),
        groups=len(evidence.units[0]),
        per_group=tuple(metric.value(one) - metric.value(other) for one, other in pairs) if few else (),
        within=within,
    )


def paired_board(
    metric: type[Metric],
    series: Sequence[Sequence[Outcome]],
    scenes: Sequence[Hashable] = (),
    *,
    confidence: float = CONFIDENCE,
) -> dict[tuple[int, int], Difference]:
    """Differences of all pairs of detectors on the same captures: those of :func:`paired_difference`, all at once.

    Parameters
    ----------
    metric : type of Metric
    series : sequence of sequences of Outcome
        One for each detector, and in it one for each capture, the captures in the same order.
    scenes : sequence
        As in :func:`estimated`.
    confidence : float

    Returns
    -------
    dict
        By the places of both detectors, the smaller first.
    """
    pairs = [(one, other) for one in range(len(series)) for other in range(one + 1, len(series))]
    evidence = Evidence.of(metric, series, scenes)
    if evidence.blocks or len(evidence.units[0]) < INNER_UNITS:
        return {
            (one, other): paired_difference(metric, series[one], series[other], scenes, confidence=confidence)
            for one, other in pairs
        }
    values = np.array(evidence.values(metric))
    sides = [left_out(metric, parts, None) for parts in evidence.units]
    found = board(values, np.stack([left for left, _ in sides]), np.stack([weight for _, weight in sides]))
    n = [samples_behind(metric, outcomes, value) for outcomes, value in zip(series, values.tolist(), strict=True)]
    groups = len(evidence.units[0])
    return {
        pair: Difference.of(
            Contrast(*(part[pair] for part in found)), confidence, n=min(n[place] for place in pair), groups=groups
        )
        for pair in pairs
    }


def drawn(
    metric: type[Metric], series: Sequence[Sequence[Outcome]], scenes: Sequence[Hashable], *, draws: int, seed: int
) -> FloatArray:
    """Values that several detectors may have on other scenes, drawn together from their joint t distribution.

    Its covariance is that of the jackknife over scenes: what makes a scene hard for all does not tell them apart.

    Parameters
    ----------
    metric : type of Metric
    series : sequence of sequences of Outcome
        One for each detector, and in it one for each capture, the captures in the same order.
    scenes : sequence
        As in :func:`estimated`.
    draws : int
    seed : int

    Returns
    -------
    (draws, detectors) array
        No rows where there are too few scenes to rank.
    """
    evidence = Evidence.of(metric, series, scenes)
    units = len(evidence.units[0])
    if units < least_units(metric):
        return np.empty((0, len(series)))
    values = np.array(evidence.values(metric))
    left = np.stack([left_out(metric, parts, None)[0] for parts in evidence.units])
    off = (left - values[:, None]) * math.sqrt((left.shape[1] - 1) / left.shape[1])
    rng = np.random.default_rng(seed)
    wide = np.sqrt((units - 1) / rng.chisquare(units - 1, size=(draws, 1)))
    return np.asarray(values + wide * (rng.normal(size=(draws, left.shape[1])) @ off.T))


def subset(outcome: Outcome, frames: BoolArray) -> Outcome:
    """Outcome of the marked ones (scored frames,) among its frames."""
    return taken(outcome, np.flatnonzero(frames))


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
    if not 0 <= successes <= trials:
        raise ValueError(f"{successes} successes of {trials} trials")
    if not trials:
        return 0.0, 1.0
    low, high = exact(np.asarray(successes / trials), np.asarray(trials), confidence)
    return float(low), float(high)


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


def samples_behind(metric: type[Metric], outcomes: Sequence[Outcome], value: float) -> int:
    """Samples behind a value: those that a metric stacks; scored frames of one that counts, none if it is undefined.

    Parameters
    ----------
    metric : type of Metric
    outcomes : sequence of Outcome
    value : float
        Of all outcomes together.
    """
    if metric.merge == "stack":
        return sum(len(metric.partial(outcome)) for outcome in outcomes)
    return 0 if math.isnan(value) else sum(len(outcome.group) for outcome in outcomes)
