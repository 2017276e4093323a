"""How far off the detections are.

Conventions
-----------
* The error of a detection is found minus true, in metres: a range difference after filtering, a distance to the
  outline (never negative) after mapping, where the bias therefore equals the mean absolute error.
* All retained detections count, matched or not, as arXiv 2512.01018 does: its 95th percentiles above one metre cannot
  come from matched detections only. :func:`matched_only` restricts an outcome to matched ones; read such a number with
  the recall beside it, or a detector wins by missing.
* A detection that belongs to no object has the error NaN and is left out.
* Without samples a number is NaN; a percentile also where there are fewer than an interval for it needs
  (:func:`uwbbench.measure.accuracy.stats.samples_needed`: 36 for P90, 72 for P95).
* Percentiles interpolate linearly between order statistics (numpy's default; Hyndman and Fan's definition 7).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import ClassVar, Literal

import numpy as np

from uwbbench.api.arrays import FloatArray, IntArray
from uwbbench.api.metric import Metric, Outcome
from uwbbench.measure.accuracy.stats import samples_needed


def matched_only(outcome: Outcome) -> Outcome:
    """Outcome whose errors are those of the matched detections; the counts stay."""
    rows = outcome.matched
    return dataclasses.replace(
        outcome,
        error_frame=outcome.error_frame[rows],
        error_m=outcome.error_m[rows],
        matched=outcome.matched[rows],
    )


class _ErrorMetric(Metric):
    """A number made of the errors of all retained detections."""

    unit: ClassVar[str] = "m"
    merge: ClassVar[Literal["sum", "stack"]] = "stack"
    better: ClassVar[Literal["higher", "lower", "zero"]] = "lower"

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Signed errors (n,) of the detections that have one."""
        return np.asarray(outcome.error_m[np.isfinite(outcome.error_m)])


class MeanAbsoluteError(_ErrorMetric):
    """Mean of the absolute errors.

    Examples
    --------
    >>> MeanAbsoluteError.value(np.array([0.1, -0.3])), MeanAbsoluteError.value(np.array([]))
    (0.2, nan)
    """

    title: ClassVar[str] = "MAE"
    default: ClassVar[bool] = True
    order: ClassVar[int] = 40
    headline: ClassVar[int | None] = 3

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Mean absolute error."""
        return float(np.mean(np.abs(partial))) if len(partial) else math.nan

    @classmethod
    def resampled(cls, partials: Sequence[FloatArray], counts: FloatArray) -> FloatArray:
        """Mean absolute errors of many resamples, from the sums of the groups."""
        return _mean(counts, [np.abs(part).sum() for part in partials], partials)


class MatchedMeanAbsoluteError(MeanAbsoluteError):
    """Mean of the absolute errors of true positives alone: read it with the recall, or a detector wins by missing."""

    title: ClassVar[str] = "MAE of matches"
    order: ClassVar[int] = 200
    brief: ClassVar[bool] = False
    headline: ClassVar[int | None] = None

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Signed errors (n,) of the matched detections."""
        return _ErrorMetric.partial(matched_only(outcome))


class _Percentile(_ErrorMetric):
    """Percentile of the absolute errors."""

    @staticmethod
    def at(quantile: float, errors_m: FloatArray) -> float:
        """Quantile of the absolute errors, NaN below the sample floor."""
        if len(errors_m) < samples_needed(quantile):
            return math.nan
        return float(np.quantile(np.abs(errors_m), quantile))

    @staticmethod
    def drawn_at(quantile: float, partials: Sequence[FloatArray], counts: FloatArray) -> FloatArray:
        """Quantile (resamples,) of drawn groups: the same numbers as :meth:`at`, with one sort for all draws."""
        sizes = np.array([len(part) for part in partials])
        errors_m = np.abs(np.concatenate(partials))
        order = np.argsort(errors_m)
        errors_m, owner = errors_m[order], np.repeat(np.arange(len(partials)), sizes)[order]
        samples = counts @ sizes.astype(np.float64)
        quantiles_m = np.full(len(counts), math.nan)
        enough = samples >= samples_needed(quantile)
        if enough.any():
            place = quantile * (samples[enough] - 1)
            below = np.floor(place)
            above = np.minimum(below + 1, samples[enough] - 1)
            low_m, high_m = errors_m[_positions(owner, counts[enough], np.stack([below, above]))]
            quantiles_m[enough] = low_m + (place - below) * (high_m - low_m)
        return quantiles_m


def _positions(owner: IntArray, counts: FloatArray, ranks: FloatArray) -> IntArray:
    """Positions, among sorted samples, of those of some ranks (ranks, resamples) in each resample.

    Each sample counts as often as the group that owns it was drawn. The samples are taken in blocks, so that only one
    block of each resample is counted sample by sample.
    """
    size = max(1, math.isqrt(len(owner)))
    blocks = -(-len(owner) // size)
    cell = owner * blocks + np.arange(len(owner)) // size
    held = np.bincount(cell, minlength=counts.shape[1] * blocks).reshape(-1, blocks)
    # Single precision holds whole numbers up to 2^24, and is twice as fast.
    exact = np.float32 if counts.shape[1] * len(owner) < 2**24 else np.float64
    reached = counts.astype(exact) @ np.cumsum(held, axis=1).astype(exact)
    positions = np.empty(ranks.shape, np.int64)
    for row, rank in zip(positions, ranks, strict=True):
        block = np.sum(reached <= rank[:, None].astype(exact), axis=1)
        before = np.take_along_axis(reached, np.maximum(block - 1, 0)[:, None], axis=1)
        places = np.minimum(block[:, None] * size + np.arange(size), len(owner) - 1)
        within = np.cumsum(np.take_along_axis(counts, owner[places], axis=1), axis=1)
        row[:] = block * size + np.sum(np.where(block[:, None] > 0, before, 0) + within <= rank[:, None], axis=1)
    return positions


class Percentile90(_Percentile):
    """Absolute error that nine of ten detections stay below; needs 36 samples.

    Examples
    --------
    >>> Percentile90.value(np.arange(101) / 100), Percentile90.value(np.zeros(35))
    (0.9, nan)
    """

    title: ClassVar[str] = "P90"
    default: ClassVar[bool] = True
    order: ClassVar[int] = 50
    minimum_samples: ClassVar[int] = samples_needed(0.90)

    @staticmethod
    def value(partial: FloatArray) -> float:
        """90th percentile."""
        return _Percentile.at(0.90, partial)

    @classmethod
    def resampled(cls, partials: Sequence[FloatArray], counts: FloatArray) -> FloatArray:
        """90th percentiles of many resamples."""
        return _Percentile.drawn_at(0.90, partials, counts)


class Percentile95(_Percentile):
    """Absolute error that nineteen of twenty detections stay below; needs 72 samples."""

    title: ClassVar[str] = "P95"
    default: ClassVar[bool] = True
    order: ClassVar[int] = 60
    headline: ClassVar[int | None] = 4
    minimum_samples: ClassVar[int] = samples_needed(0.95)

    @staticmethod
    def value(partial: FloatArray) -> float:
        """95th percentile."""
        return _Percentile.at(0.95, partial)

    @classmethod
    def resampled(cls, partials: Sequence[FloatArray], counts: FloatArray) -> FloatArray:
        """95th percentiles of many resamples."""
        return _Percentile.drawn_at(0.95, partials, counts)


class StandardDeviation(_ErrorMetric):
    """Spread of the absolute errors around their mean: the population's (divided by n), in two passes.

    The table of arXiv 2512.01018 prints it beside the mean absolute error. It is not the spread of the signed errors.

    Examples
    --------
    >>> StandardDeviation.value(np.array([0.1, -0.3])).__round__(12)
    0.1
    """

    title: ClassVar[str] = "SD"
    default: ClassVar[bool] = True
    order: ClassVar[int] = 70

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Population standard deviation of the absolute errors."""
        return float(np.std(np.abs(partial))) if len(partial) else math.nan

    @classmethod
    def resampled(cls, partials: Sequence[FloatArray], counts: FloatArray) -> FloatArray:
        """Standard deviations of many resamples, from the groups' sums about the mean of all."""
        total = sum(len(part) for part in partials)
        centre = sum(np.abs(part).sum() for part in partials) / total if total else 0.0
        off = [np.abs(part) - centre for part in partials]  # about the mean, or the squares would swallow the spread
        mean = _mean(counts, [part.sum() for part in off], partials)
        square = _mean(counts, [np.square(part).sum() for part in off], partials)
        return np.sqrt(np.maximum(square - np.square(mean), 0.0))


class Bias(_ErrorMetric):
    """Mean of the signed errors: positive where ranges are found too long.

    Examples
    --------
    >>> Bias.value(np.array([0.1, -0.3])).__round__(12)
    -0.1
    """

    order: ClassVar[int] = 90
    better: ClassVar[Literal["higher", "lower", "zero"]] = "zero"

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Mean signed error."""
        return float(np.mean(partial)) if len(partial) else math.nan

    @classmethod
    def resampled(cls, partials: Sequence[FloatArray], counts: FloatArray) -> FloatArray:
        """Mean signed errors of many resamples, from the sums of the groups."""
        return _mean(counts, [part.sum() for part in partials], partials)


def _mean(counts: FloatArray, sums: Sequence[float], partials: Sequence[FloatArray]) -> FloatArray:
    """Mean (resamples,) of drawn groups with the given sums; NaN where a draw holds no sample."""
    samples = (counts @ np.array([len(part) for part in partials])).astype(float)
    samples[samples == 0] = math.nan
    return np.asarray(counts @ np.array(sums) / samples)
