"""How much was found, and how much of it is true.

Conventions
-----------
* Inputs are the counts of true positives (tp), false positives (fp) and false negatives (fn) of an
  :class:`~uwbbench.api.metric.Outcome`; what counts as which is the scoring's affair.
* Counts of all frames and captures are added before dividing (micro average).
* 0/0 is undefined and NaN, everywhere. No truth and no output: precision, recall and F1 are undefined. No truth and
  some output: precision 0, recall undefined. Some truth and no output: precision undefined, recall 0, F1 0.
* Where the truth is not exhaustive an unmatched detection proves nothing, so such a capture adds nothing to precision,
  F1 and false alarms; it does add to recall.
"""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.metric import Kind, Metric, Outcome


def _ratio(part: float, whole: float) -> float:
    return float(part / whole) if whole > 0 else math.nan


class Precision(Metric):
    """Share of the retained detections that are true: tp / (tp + fp).

    Examples
    --------
    >>> Precision.value(np.array([3.0, 1.0])), Precision.value(np.array([0.0, 2.0]))
    (0.75, 0.0)
    >>> Precision.value(np.array([0.0, 0.0]))
    nan
    """

    title: ClassVar[str] = "precision"
    kind: ClassVar[Kind] = "share"
    needs_exhaustive_truth: ClassVar[bool] = True
    default: ClassVar[bool] = True
    order: ClassVar[int] = 10

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Counts tp, fp."""
        if not outcome.exhaustive:
            return np.zeros(2)
        return np.array([outcome.tp.sum(), outcome.fp.sum()], float)

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Ratio tp / (tp + fp)."""
        tp, fp = partial
        return _ratio(tp, tp + fp)

    @classmethod
    def parts(cls, partial: FloatArray) -> tuple[float, float]:
        """True positives among all positives."""
        tp, fp = partial.tolist()
        return tp, tp + fp


class Recall(Metric):
    """Share of what was there that was found: tp / (tp + fn).

    Examples
    --------
    >>> Recall.value(np.array([3.0, 1.0])), Recall.value(np.array([0.0, 2.0]))
    (0.75, 0.0)
    """

    title: ClassVar[str] = "recall"
    kind: ClassVar[Kind] = "share"
    default: ClassVar[bool] = True
    order: ClassVar[int] = 20
    headline: ClassVar[int | None] = 2

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Counts tp, fn."""
        return np.array([outcome.tp.sum(), outcome.fn.sum()], float)

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Ratio tp / (tp + fn)."""
        tp, fn = partial
        return _ratio(tp, tp + fn)

    @classmethod
    def parts(cls, partial: FloatArray) -> tuple[float, float]:
        """True positives among all that was there."""
        tp, fn = partial.tolist()
        return tp, tp + fn


class F1(Metric):
    """Harmonic mean of precision and recall, as counts: 2 tp / (2 tp + fp + fn).

    The form in counts is also defined, and 0, where precision or recall alone is 0/0.

    Examples
    --------
    >>> F1.value(np.array([2.0, 1.0, 1.0])).__round__(6)
    0.666667
    >>> F1.value(np.array([0.0, 0.0, 4.0]))
    0.0
    """

    title: ClassVar[str] = "F1"
    kind: ClassVar[Kind] = "share"
    needs_exhaustive_truth: ClassVar[bool] = True
    default: ClassVar[bool] = True
    order: ClassVar[int] = 30
    headline: ClassVar[int | None] = 1

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Counts tp, fp, fn."""
        if not outcome.exhaustive:
            return np.zeros(3)
        return np.array([outcome.tp.sum(), outcome.fp.sum(), outcome.fn.sum()], float)

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Ratio 2 tp / (2 tp + fp + fn)."""
        tp, fp, fn = partial
        return _ratio(2 * tp, 2 * tp + fp + fn)

    @classmethod
    def parts(cls, partial: FloatArray) -> tuple[float, float]:
        """Twice the true positives, and all counts."""
        tp, fp, fn = partial.tolist()
        return 2 * tp, 2 * tp + fp + fn


class FalseAlarmsPerMinute(Metric):
    """False positives in a minute of scored frames.

    Examples
    --------
    >>> FalseAlarmsPerMinute.value(np.array([3.0, 90.0]))
    2.0
    """

    title: ClassVar[str] = "false alarms"
    kind: ClassVar[Kind] = "ratio"
    unit: ClassVar[str] = "1/min"
    better: ClassVar[Literal["higher", "lower", "zero"]] = "lower"
    needs_exhaustive_truth: ClassVar[bool] = True
    default: ClassVar[bool] = True
    order: ClassVar[int] = 80
    brief: ClassVar[bool] = False

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Count fp, and the seconds it was counted in."""
        if not outcome.exhaustive:
            return np.zeros(2)
        return np.array([outcome.fp.sum(), outcome.duration_s], float)

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Rate fp / minutes."""
        fp, seconds = partial
        return _ratio(60 * fp, seconds)

    @classmethod
    def parts(cls, partial: FloatArray) -> tuple[float, float]:
        """False positives a minute, and seconds."""
        fp, seconds = partial.tolist()
        return 60 * fp, seconds
