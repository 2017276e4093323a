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
from typing import ClassVar, Literal

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.metric import Kind, Metric, Outcome
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

    @classmethod
    def most(cls, partial: FloatArray) -> float:
        """Largest absolute error."""
        return float(np.abs(partial).max(initial=0.0))


class MeanAbsoluteError(_ErrorMetric):
    """Mean of the absolute errors.

    Examples
    --------
    >>> MeanAbsoluteError.value(np.array([0.1, -0.3])), MeanAbsoluteError.value(np.array([]))
    (0.2, nan)
    """

    title: ClassVar[str] = "MAE"
    default: ClassVar[bool] = True
    kind: ClassVar[Kind] = "ratio"
    order: ClassVar[int] = 40
    headline: ClassVar[int | None] = 3

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Mean absolute error."""
        return float(np.mean(np.abs(partial))) if len(partial) else math.nan

    @classmethod
    def parts(cls, partial: FloatArray) -> tuple[float, float]:
        """Sum and number of the absolute errors."""
        return float(np.abs(partial).sum()), float(len(partial))


class _OfMatches(_ErrorMetric):
    """Of true positives alone."""

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Signed errors (n,) of the matched detections."""
        return _ErrorMetric.partial(matched_only(outcome))


class MatchedMeanAbsoluteError(_OfMatches, MeanAbsoluteError):
    """Mean of the absolute errors of true positives alone: read it with the recall, or a detector wins by missing."""

    title: ClassVar[str] = "MAE of matches"
    order: ClassVar[int] = 200
    brief: ClassVar[bool] = False
    headline: ClassVar[int | None] = None


class _Percentile(_ErrorMetric):
    """Percentile of the absolute errors."""

    @staticmethod
    def at(quantile: float, errors_m: FloatArray) -> float:
        """Quantile of the absolute errors, NaN below the sample floor."""
        if len(errors_m) < samples_needed(quantile):
            return math.nan
        return float(np.quantile(np.abs(errors_m), quantile))


class Percentile90(_Percentile):
    """Absolute error that nine of ten detections stay below; needs 36 samples.

    Examples
    --------
    >>> Percentile90.value(np.arange(101) / 100), Percentile90.value(np.zeros(35))
    (0.9, nan)
    """

    title: ClassVar[str] = "P90"
    default: ClassVar[bool] = True
    kind: ClassVar[Kind] = "quantile"
    level: ClassVar[float] = 0.90
    order: ClassVar[int] = 50
    brief: ClassVar[bool] = False
    minimum_samples: ClassVar[int] = samples_needed(0.90)

    @staticmethod
    def value(partial: FloatArray) -> float:
        """90th percentile."""
        return _Percentile.at(0.90, partial)


class Percentile95(_Percentile):
    """Absolute error that nineteen of twenty detections stay below; needs 72 samples."""

    title: ClassVar[str] = "P95"
    default: ClassVar[bool] = True
    kind: ClassVar[Kind] = "quantile"
    level: ClassVar[float] = 0.95
    order: ClassVar[int] = 60
    headline: ClassVar[int | None] = 4
    minimum_samples: ClassVar[int] = samples_needed(0.95)

    @staticmethod
    def value(partial: FloatArray) -> float:
        """95th percentile."""
        return _Percentile.at(0.95, partial)


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
    kind: ClassVar[Kind] = "positive"
    order: ClassVar[int] = 70
    brief: ClassVar[bool] = False

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Population standard deviation of the absolute errors."""
        return float(np.std(np.abs(partial))) if len(partial) else math.nan


class Bias(_ErrorMetric):
    """Mean of the signed errors: positive where ranges are found too long.

    With :class:`Scatter` it takes the root mean square error apart: ``rmse^2 = bias^2 + scatter^2``.

    Examples
    --------
    >>> Bias.value(np.array([0.1, -0.3])).__round__(12)
    -0.1
    """

    title: ClassVar[str] = "bias"
    default: ClassVar[bool] = True
    kind: ClassVar[Kind] = "mean"
    order: ClassVar[int] = 42
    beside: ClassVar[str] = "mae"
    better: ClassVar[Literal["higher", "lower", "zero"]] = "zero"

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Mean signed error."""
        return float(np.mean(partial)) if len(partial) else math.nan

    @classmethod
    def parts(cls, partial: FloatArray) -> tuple[float, float]:
        """Sum and number of the signed errors."""
        return float(partial.sum()), float(len(partial))


class MatchedBias(_OfMatches, Bias):
    """Mean of the signed errors of true positives alone: what a wrong zero of delay leaves, free of false ones."""

    title: ClassVar[str] = "bias of matches"
    order: ClassVar[int] = 201
    beside: ClassVar[str] = "matched_mae"
    brief: ClassVar[bool] = False


class Scatter(_ErrorMetric):
    """Spread of the signed errors around the bias, which no offset takes away: the population's (divided by n).

    The column ``sd`` of arXiv 2512.01018 is the spread of the absolute errors instead.

    Examples
    --------
    >>> Scatter.value(np.array([0.1, -0.3])).__round__(12), Scatter.value(np.array([0.2, 0.2]))
    (0.2, 0.0)
    """

    title: ClassVar[str] = "scatter"
    default: ClassVar[bool] = True
    kind: ClassVar[Kind] = "positive"
    order: ClassVar[int] = 44
    beside: ClassVar[str] = "mae"

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Population standard deviation of the signed errors."""
        return float(np.std(partial)) if len(partial) else math.nan


class MatchedScatter(_OfMatches, Scatter):
    """Spread of the signed errors of true positives alone, around their bias."""

    title: ClassVar[str] = "scatter of matches"
    order: ClassVar[int] = 202
    beside: ClassVar[str] = "matched_mae"
    brief: ClassVar[bool] = False
