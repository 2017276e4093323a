"""How well a map shows what was there: metrics of the scoring ``map``.

Conventions
-----------
* All are made of a :class:`~uwbbench.api.outcomes.MapOutcome`; :mod:`uwbbench.measure.accuracy.judges.map` says what is
  held against what. Each is a number of a run; of several runs their mean.
* *Accuracy* is the way from the map to what was there, *completeness* the way back, *chamfer* their mean.
* Where the truth is not exhaustive, what a map has besides it proves nothing: completeness and recalls alone are
  defined.
* A map with nothing in it is worth a recall of 0; its distances are undefined.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from uwbbench.api.metric import Kind, Outcome
from uwbbench.api.outcomes import MapOutcome
from uwbbench.measure.accuracy.metrics.run import RunMetric, mean

_Better = Literal["higher", "lower", "zero"]


class _MapMetric(RunMetric):
    of: ClassVar[type[Outcome]] = MapOutcome
    unit: ClassVar[str] = "m"


class _MapShare(_MapMetric):
    """A share, the larger the better."""

    unit: ClassVar[str] = ""
    kind: ClassVar[Kind] = "share"
    better: ClassVar[_Better] = "higher"


class MapCompleteness(_MapMetric):
    """Mean distance of what was there from the nearest point of the map."""

    title: ClassVar[str] = "completeness"
    headline: ClassVar[int | None] = 3
    order: ClassVar[int] = 6

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Mean distance."""
        return mean(_map(outcome).true_m)


class MapAccuracy(_MapMetric):
    """Mean distance of the points of the map from the nearest point that was there."""

    title: ClassVar[str] = "accuracy"
    needs_exhaustive_truth: ClassVar[bool] = True
    order: ClassVar[int] = 4

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Mean distance."""
        of = _map(outcome)
        return mean(of.map_m) if of.exhaustive else math.nan


class Chamfer(_MapMetric):
    """Mean of accuracy and completeness.

    Examples
    --------
    >>> Chamfer.value(np.array([0.1, 0.2])).__round__(3)
    0.15
    """

    title: ClassVar[str] = "chamfer"
    needs_exhaustive_truth: ClassVar[bool] = True
    brief: ClassVar[bool] = True
    headline: ClassVar[int | None] = 0
    order: ClassVar[int] = 2

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Half the sum of both."""
        return (MapAccuracy.number(outcome) + MapCompleteness.number(outcome)) / 2


class ChamferStart(Chamfer):
    """The same with the start of the trajectory fixed, in place of the alignment."""

    title: ClassVar[str] = "chamfer, start fixed"
    brief: ClassVar[bool] = False
    headline: ClassVar[int | None] = None
    order: ClassVar[int] = 8

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Half the sum of both, of the map that was moved otherwise."""
        of = _map(outcome)
        return math.nan if of.start is None else Chamfer.number(replace(of.start, exhaustive=of.exhaustive))


class OutlinePrecision10(_MapShare):
    """Share of the points of the map that lie within 10 cm of what was there."""

    title: ClassVar[str] = "outline precision (10 cm)"
    needs_exhaustive_truth: ClassVar[bool] = True
    order: ClassVar[int] = 10
    within_m: ClassVar[float] = 0.10

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Share of the points of the map."""
        of = _map(outcome)
        return mean(of.map_m <= cls.within_m) if of.exhaustive else math.nan


class OutlinePrecision20(OutlinePrecision10):
    """The same within 20 cm."""

    title: ClassVar[str] = "outline precision (20 cm)"
    order: ClassVar[int] = 13
    within_m: ClassVar[float] = 0.20


class OutlineRecall10(_MapShare):
    """Share of what was there that lies within 10 cm of a point of the map."""

    title: ClassVar[str] = "outline recall (10 cm)"
    order: ClassVar[int] = 11
    within_m: ClassVar[float] = 0.10

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Share of what was there."""
        return mean(_map(outcome).true_m <= cls.within_m)


class OutlineRecall20(OutlineRecall10):
    """The same within 20 cm."""

    title: ClassVar[str] = "outline recall (20 cm)"
    order: ClassVar[int] = 14
    within_m: ClassVar[float] = 0.20


class OutlineF110(_MapShare):
    """Harmonic mean of precision and recall within 10 cm; 0 where nothing of either is near."""

    title: ClassVar[str] = "outline F1 (10 cm)"
    needs_exhaustive_truth: ClassVar[bool] = True
    brief: ClassVar[bool] = True
    headline: ClassVar[int | None] = 1
    order: ClassVar[int] = 12
    within: ClassVar[tuple[type[OutlinePrecision10], type[OutlineRecall10]]] = OutlinePrecision10, OutlineRecall10

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Harmonic mean."""
        of = _map(outcome)
        if not of.exhaustive or not len(of.true_m):
            return math.nan
        precision, recall = (metric.number(of) if len(of.map_m) else 0.0 for metric in cls.within)
        return 2 * precision * recall / (precision + recall) if precision + recall else 0.0


class OutlineF120(OutlineF110):
    """The same within 20 cm."""

    title: ClassVar[str] = "outline F1 (20 cm)"
    headline: ClassVar[int | None] = None
    order: ClassVar[int] = 15
    within: ClassVar[tuple[type[OutlinePrecision10], type[OutlineRecall10]]] = OutlinePrecision20, OutlineRecall20


class LandmarkPrecision(_MapShare):
    """Share of the landmarks of the map that are objects, within 30 cm and one-to-one."""

    title: ClassVar[str] = "landmark precision"
    needs_exhaustive_truth: ClassVar[bool] = True
    order: ClassVar[int] = 20

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """True ones among all."""
        tp, fp, _ = _landmarks(outcome)
        return _ratio(tp, tp + fp) if outcome.exhaustive else math.nan


class LandmarkRecall(_MapShare):
    """Share of the objects that are landmarks of the map."""

    title: ClassVar[str] = "landmark recall"
    order: ClassVar[int] = 21

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Found ones among those that were there."""
        tp, _, fn = _landmarks(outcome)
        return _ratio(tp, tp + fn)


class LandmarkF1(_MapShare):
    """Harmonic mean of both, as counts."""

    title: ClassVar[str] = "landmark F1"
    needs_exhaustive_truth: ClassVar[bool] = True
    brief: ClassVar[bool] = True
    headline: ClassVar[int | None] = 2
    order: ClassVar[int] = 22

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Ratio 2 tp / (2 tp + fp + fn)."""
        tp, fp, fn = _landmarks(outcome)
        return _ratio(2 * tp, 2 * tp + fp + fn) if outcome.exhaustive else math.nan


class LandmarkError(_MapMetric):
    """Mean distance of true landmarks from the outline of their object: read it with the recall."""

    title: ClassVar[str] = "landmark error"
    brief: ClassVar[bool] = True
    order: ClassVar[int] = 24

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Mean distance."""
        return mean(outcome.error_m[outcome.matched & np.isfinite(outcome.error_m)])


class FalseLandmarks(_MapMetric):
    """Landmarks that are no object; those on structure are among them."""

    title: ClassVar[str] = "false landmarks"
    unit: ClassVar[str] = "1/run"
    margin: ClassVar[float] = 0.5
    needs_exhaustive_truth: ClassVar[bool] = True
    brief: ClassVar[bool] = True
    order: ClassVar[int] = 25

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Count; undefined where a map has no landmarks."""
        return _landmarks(outcome)[1] if outcome.exhaustive and any(_landmarks(outcome)) else math.nan


class LandmarkDuplicates(_MapMetric):
    """Landmarks on an object that another landmark has; they are false as well."""

    title: ClassVar[str] = "duplicates"
    unit: ClassVar[str] = "1/run"
    margin: ClassVar[float] = 0.5
    order: ClassVar[int] = 26

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Count; undefined where a map has no landmarks."""
        return float(_map(outcome).duplicates.sum()) if any(_landmarks(outcome)) else math.nan


class MapOverlap(_MapShare):
    """Cells of 10 cm that map and truth share, over those that either has; both widened by one cell.

    Intersection over union. Without the widening that of thin objects is noise.
    """

    title: ClassVar[str] = "overlap"
    needs_exhaustive_truth: ClassVar[bool] = True
    brief: ClassVar[bool] = True
    order: ClassVar[int] = 30

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Shared among all."""
        of = _map(outcome)
        return _ratio(float(of.shared_cells.sum()), float(of.covered_cells.sum())) if of.exhaustive else math.nan


def _landmarks(outcome: Outcome) -> tuple[float, float, float]:
    """True, false and missed landmarks of a run."""
    of = _map(outcome)
    return float(of.tp.sum()), float(of.fp.sum()), float(of.fn.sum())


def _ratio(part: float, whole: float) -> float:
    return part / whole if whole else math.nan


def _map(outcome: Outcome) -> MapOutcome:
    """Outcome of the scoring that these metrics are of."""
    if not isinstance(outcome, MapOutcome):
        raise TypeError(f"a metric of maps takes a MapOutcome, not {type(outcome).__name__}")
    return outcome


MAP_METRICS: dict[str, type[RunMetric]] = {
    "chamfer": Chamfer,
    "map_accuracy": MapAccuracy,
    "map_completeness": MapCompleteness,
    "chamfer_start": ChamferStart,
    "outline_precision_10": OutlinePrecision10,
    "outline_recall_10": OutlineRecall10,
    "outline_f1_10": OutlineF110,
    "outline_precision_20": OutlinePrecision20,
    "outline_recall_20": OutlineRecall20,
    "outline_f1_20": OutlineF120,
    "landmark_precision": LandmarkPrecision,
    "landmark_recall": LandmarkRecall,
    "landmark_f1": LandmarkF1,
    "landmark_error": LandmarkError,
    "false_landmarks": FalseLandmarks,
    "landmark_duplicates": LandmarkDuplicates,
    "map_overlap": MapOverlap,
}
"""By registered name: what scores of maps hold."""
