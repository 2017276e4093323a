"""How well a detector tells frames with an obstacle from empty ones: metrics of the scoring ``presence``.

Conventions
-----------
* All are made of a :class:`~uwbbench.api.outcomes.PresenceOutcome`; a frame is one chance
  (:mod:`uwbbench.measure.accuracy.judges.presence`). Precision, recall and F1 are those of every scoring.
* Frames of all captures are put together before anything is made of them.
* A number that needs frames of both kinds is undefined where one kind is missing; one that needs a probability, where
  the detector gives none.
* Where the truth is not exhaustive an empty frame proves nothing: such a capture adds nothing.
"""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.metric import Kind, Metric, Outcome
from uwbbench.api.outcomes import PresenceOutcome


class _PresenceMetric(Metric):
    of: ClassVar[type[Outcome]] = PresenceOutcome
    needs_exhaustive_truth: ClassVar[bool] = True
    default: ClassVar[bool] = True


class BalancedAccuracy(_PresenceMetric):
    """Mean of the share of present frames that are found and the share of empty frames that are left alone.

    0.5 for whoever always says the same, however rare obstacles are.

    Examples
    --------
    >>> BalancedAccuracy.value(np.array([9.0, 10.0, 5.0, 10.0]))
    0.7
    """

    title: ClassVar[str] = "balanced accuracy"
    order: ClassVar[int] = 34
    headline: ClassVar[int | None] = 0

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """True present frames, present frames, true empty frames, empty frames."""
        of = _presence(outcome)
        if not of.exhaustive:
            return np.zeros(4)
        empty = ~of.present
        return np.array([of.tp.sum(), of.present.sum(), empty.sum() - of.fp.sum(), empty.sum()], float)

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Mean of the two shares."""
        found, present, left, empty = partial.tolist()
        return (found / present + left / empty) / 2 if present and empty else math.nan


class _Ranked(_PresenceMetric):
    """A number made of the order of frames by their probability."""

    merge: ClassVar[Literal["sum", "stack"]] = "stack"

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Probability of each frame, and whether it is present (frames, 2); none without a probability."""
        of = _presence(outcome)
        known = np.isfinite(of.probability) & of.exhaustive
        return np.stack([of.probability[known], of.present[known]], axis=1)


class RocAuc(_Ranked):
    """Probability that a present frame has a larger probability than an empty one, ties counting half.

    The area under the receiver operating characteristic (Hanley and McNeil, Radiology 143(1), 1982), exact for ties.

    Examples
    --------
    >>> RocAuc.value(np.array([[0.9, 1], [0.5, 1], [0.5, 0], [0.1, 0]]))
    0.875
    """

    title: ClassVar[str] = "ROC-AUC"
    order: ClassVar[int] = 36

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Area, by ranks."""
        from scipy.stats import rankdata

        probability, present = partial[:, 0], partial[:, 1] > 0
        ones = int(present.sum())
        zeros = len(present) - ones
        if not ones or not zeros:
            return math.nan
        return float((rankdata(probability)[present].sum() - ones * (ones + 1) / 2) / (ones * zeros))


class AveragePrecision(_Ranked):
    """Area under the steps of precision over recall, as the threshold of the probability falls.

    ``sum (R_k - R_(k-1)) P_k`` over distinct probabilities, without interpolation, as scikit-learn has it.

    Examples
    --------
    >>> round(AveragePrecision.value(np.array([[0.9, 1], [0.5, 1], [0.5, 0], [0.1, 0]])), 6)
    0.833333
    """

    title: ClassVar[str] = "average precision"
    order: ClassVar[int] = 38
    brief: ClassVar[bool] = False

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Area under the steps."""
        if not partial[:, 1].any():
            return math.nan
        threshold, place = np.unique(-partial[:, 0], return_inverse=True)
        ones = np.bincount(place, partial[:, 1], minlength=len(threshold))
        precision = np.cumsum(ones) / np.cumsum(np.bincount(place, minlength=len(threshold)))
        return float(np.sum(ones * precision) / ones.sum())


class ClassAccuracy(_PresenceMetric):
    """Share of the frames whose class is known that the detector puts into it.

    Examples
    --------
    >>> ClassAccuracy.value(np.array([3.0, 4.0]))
    0.75
    """

    title: ClassVar[str] = "class accuracy"
    kind: ClassVar[Kind] = "share"
    order: ClassVar[int] = 40
    brief: ClassVar[bool] = False

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Frames of the right class, and frames whose class is known."""
        of = _presence(outcome)
        known = (of.true_class >= 0) & of.exhaustive
        return np.array([(known & (of.said_class == of.true_class)).sum(), known.sum()], float)

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Share of the right ones."""
        right, known = partial.tolist()
        return float(right / known) if known else math.nan

    @classmethod
    def parts(cls, partial: FloatArray) -> tuple[float, float]:
        """Right ones among all whose class is known."""
        right, known = partial.tolist()
        return right, known


def confusion(outcome: PresenceOutcome) -> dict[str, int]:
    """Frames of each class that the detector puts into each, by ``confusion_TRUE_as_SAID``.

    Parameters
    ----------
    outcome : PresenceOutcome
    """
    return {
        f"confusion_{true}_as_{said}": int(np.sum((outcome.true_class == row) & (outcome.said_class == column)))
        for row, true in enumerate(outcome.classes)
        for column, said in enumerate(outcome.classes)
    }


def _presence(outcome: Outcome) -> PresenceOutcome:
    """Outcome of the scoring that these metrics are of."""
    if not isinstance(outcome, PresenceOutcome):
        raise TypeError(f"a metric of presence takes a PresenceOutcome, not {type(outcome).__name__}")
    return outcome


PRESENCE_METRICS: dict[str, type[Metric]] = {
    "balanced_accuracy": BalancedAccuracy,
    "roc_auc": RocAuc,
    "average_precision": AveragePrecision,
    "class_accuracy": ClassAccuracy,
}
"""By registered name: what scores of presence hold besides those of every scoring."""
