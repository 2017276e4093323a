"""A detector without its thresholds: what its candidates would give at every threshold of their score.

Conventions
-----------
* The candidates of one pass, the peaks before the filters, are ordered by a score: the column that the detector names,
  else the first of :data:`SCORES` that they have. A candidate without a score comes last.
* At every threshold the candidates with at least that score are judged as ``object`` judges detections
  (:mod:`uwbbench.measure.accuracy.judge`), all of a frame, in the region: matched one-to-one, structure set aside.
  Equal scores come in together.
* Recall is of all visible obstacles. Average precision is the area under the steps of precision over recall,
  ``sum (R_k - R_(k-1)) P_k``, without interpolation, as scikit-learn has it.
* Scores are stored with 11 significant bits, 0.05 %: counts of captures then add up exactly at every stored threshold,
  and take little room.
* Candidates that speak of frames as a whole, with a probability and without a range, are judged as ``presence`` judges:
  what is counted are frames.
* The *setting* of a detector is what it hands out itself, judged in the same way. It lies on the curve where its
  filters are a threshold of the score alone, and off it where they know more, or less, than the score.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.detections import Detections
from uwbbench.api.outcomes import PresenceOutcome
from uwbbench.measure.accuracy.judge import judge
from uwbbench.measure.accuracy.matching import match
from uwbbench.measure.accuracy.rules import ScoringRules
from uwbbench.measure.accuracy.scene import Scene

SCORES = ("probability", "score_db", "prominence", "amplitude")
"""Columns that order candidates where a detector names none, the first that they have."""

_SIGNIFICANT = 2.0**11


@dataclass(frozen=True)
class RankedCounts:
    """Counts of one detector on one capture, or on several, at every threshold of its score.

    Attributes
    ----------
    score : (steps,) array
        Thresholds, falling and distinct; the last may be minus infinity.
    tp, fp : (steps,) int array
        What each step adds to true and false detections. A match that changes may take false ones away.
    there : int
        Visible obstacles, frames added up.
    duration_s : float
        Time covered by the scored frames.
    order : str
        Column that orders the candidates; empty where there are none.
    set_tp, set_fp : int
        True and false detections of the detector as it is set.
    exhaustive : bool
        False where an unmatched candidate proves nothing: precision and false alarms are then undefined.
    """

    score: FloatArray
    tp: IntArray
    fp: IntArray
    there: int
    duration_s: float
    order: str
    set_tp: int
    set_fp: int
    exhaustive: bool = True

    @property
    def recall(self) -> FloatArray:
        """Recall (steps,) at each threshold; NaN where there is nothing to find."""
        return np.cumsum(self.tp) / (self.there or math.nan)

    @property
    def precision(self) -> FloatArray:
        """Precision (steps,) at each threshold; NaN where only structure came in."""
        tp = np.cumsum(self.tp)
        return _ratios(tp, tp + np.cumsum(self.fp))

    @property
    def false_alarms_per_minute(self) -> FloatArray:
        """False detections in a minute of scored frames (steps,)."""
        return 60 * np.cumsum(self.fp) / (self.duration_s or math.nan)

    @property
    def average_precision(self) -> float:
        """Area under precision over recall; NaN where it is undefined."""
        if not self.exhaustive or not self.there:
            return math.nan
        return float(np.nansum(self.tp * self.precision) / self.there)


def ranked(detections: Detections, scene: Scene, rules: ScoringRules, asked: str = "") -> RankedCounts | None:
    """Counts of the candidates of a capture at every threshold.

    Parameters
    ----------
    detections : Detections
    scene : Scene
        Of the same capture and detections.
    rules : ScoringRules
        Their gate and region.
    asked : str
        Column that the detector names.

    Returns
    -------
    RankedCounts or None
        None where the candidates are not known, or none of the columns is there to order them.
    """
    candidates = None if detections.mapped is not None else detections.candidates
    order = None if candidates is None else order_of(candidates, asked)
    if candidates is None or order is None:
        return None
    if Scene.without_ranges(candidates):
        return _ranked_frames(detections, scene, rules)
    every = dataclasses.replace(rules, scoring="object", strongest=None)
    setting = judge(detections, scene, every, "filtering").outcome
    visible = scene.visible(rules.region)
    judged = judge(candidates, scene, every, "filtering")
    rows = judged.retained
    cost_m = np.abs(scene.errors_m(rows, "filtering"))
    seen_m = np.where(visible[rows.frame] & (cost_m <= rules.gate_m), cost_m, np.nan)
    wall = np.asarray(((cost_m <= rules.gate_m) & ~scene.obstacle).any(axis=1))
    score = _coarse(rows[order])
    tp, fp = _steps(rows.frame, score, seen_m, wall, rules.gate_m)
    threshold, place = np.unique(-score, return_inverse=True)
    return RankedCounts(
        score=-threshold,
        tp=np.bincount(place, tp, minlength=len(threshold)).astype(np.int64),
        fp=np.bincount(place, fp, minlength=len(threshold)).astype(np.int64),
        there=int(visible[scene.scored].sum()),
        duration_s=setting.duration_s,
        order=order,
        set_tp=int(setting.tp.sum()),
        set_fp=int(setting.fp.sum()),
        exhaustive=scene.truth.exhaustive,
    )


def _ranked_frames(detections: Detections, scene: Scene, rules: ScoringRules) -> RankedCounts:
    """Counts of frames by their probability, where candidates speak of frames as a whole."""
    outcome = judge(detections, scene, dataclasses.replace(rules, scoring="presence"), "filtering").outcome
    assert isinstance(outcome, PresenceOutcome)  # noqa: S101 - of this scoring
    threshold, place = np.unique(-_coarse(outcome.probability), return_inverse=True)
    frames, tp = (np.bincount(place, rows, minlength=len(threshold)) for rows in (None, outcome.present))
    return RankedCounts(
        score=-threshold,
        tp=tp.astype(np.int64),
        fp=(frames - tp).astype(np.int64),
        there=int(outcome.present.sum()),
        duration_s=outcome.duration_s,
        order="probability",
        set_tp=int(outcome.tp.sum()),
        set_fp=int(outcome.fp.sum()),
        exhaustive=outcome.exhaustive,
    )


def order_of(candidates: Detections, asked: str = "") -> str | None:
    """Column that orders candidates: the one asked for, else the first usual one; None where there is none.

    Examples
    --------
    >>> order_of(Detections([0], amplitude=[1.0], prominence=[0.2]))
    'prominence'
    """
    if not len(candidates):
        return ""
    return next((name for name in (asked, *SCORES) if name in candidates.columns), None)


def pooled(parts: Sequence[RankedCounts]) -> RankedCounts:
    """Counts of several captures together, exact at every threshold of any of them.

    Parameters
    ----------
    parts : sequence of RankedCounts
        At least one, with scores of one column.
    """
    scores = np.concatenate([part.score for part in parts])
    threshold, place = np.unique(-scores, return_inverse=True)

    def added(name: str) -> IntArray:
        counts = np.concatenate([getattr(part, name) for part in parts])
        return np.bincount(place, counts, minlength=len(threshold)).astype(np.int64)

    return RankedCounts(
        score=-threshold,
        tp=added("tp"),
        fp=added("fp"),
        there=sum(part.there for part in parts),
        duration_s=sum(part.duration_s for part in parts),
        order=next((part.order for part in parts if part.order), ""),
        set_tp=sum(part.set_tp for part in parts),
        set_fp=sum(part.set_fp for part in parts),
        exhaustive=all(part.exhaustive for part in parts),
    )


def without_each(parts: Sequence[RankedCounts]) -> list[float]:
    """Average precision of several captures together, without each of them in turn.

    What a capture adds is taken out of what all add at their common thresholds: they are sorted once.
    """
    whole = pooled(parts)
    areas = []
    for part in parts:
        place = np.searchsorted(-whole.score, -part.score)
        tp, fp = whole.tp.copy(), whole.fp.copy()
        tp[place] -= part.tp
        fp[place] -= part.fp
        rest = [one for one in parts if one is not part]
        there, exhaustive = whole.there - part.there, all(one.exhaustive for one in rest)
        areas.append(dataclasses.replace(whole, tp=tp, fp=fp, there=there, exhaustive=exhaustive).average_precision)
    return areas


def _steps(
    frame: IntArray, score: FloatArray, cost_m: FloatArray, wall: BoolArray, gate_m: float
) -> tuple[IntArray, IntArray]:
    """What each candidate (n,) adds to the true and false ones when candidates come in by falling score.

    Parameters
    ----------
    frame : (n,) int array
    score : (n,) array
    cost_m : (n, objects) array
        Distance to each visible obstacle; NaN beyond the gate.
    wall : (n,) bool array
        Whether structure is near, which is no false detection where it is not matched.
    gate_m : float
    """
    near = ~np.isnan(cost_m)
    tp, fp = np.zeros(len(frame), np.int64), (~wall).astype(np.int64)
    rows = np.flatnonzero(near.any(axis=1))
    if not len(rows):
        return tp, fp
    rows = rows[np.lexsort((-score[rows], frame[rows]))]
    _, first, group = np.unique(frame[rows], return_index=True, return_inverse=True)
    objects = np.logical_or.reduceat(near[rows], first, axis=0).sum(axis=1)
    ends = np.append(first[1:], len(rows))
    crowded = (objects > 1) & (ends - first > 1)
    simple = rows[~crowded[group]]
    tp[simple], fp[simple] = _one_object(frame[simple], np.nanmin(cost_m[simple], axis=1), wall[simple])
    for number in np.flatnonzero(crowded):
        members = rows[first[number] : ends[number]]
        before = np.zeros(2, np.int64)
        for count in range(1, len(members) + 1):
            matched, _ = match(cost_m[members[:count]], gate_m)
            stray = np.delete(members[:count], matched)
            after = np.array([len(matched), int((~wall[stray]).sum())])
            tp[members[count - 1]], fp[members[count - 1]] = after - before
            before = after
    return tp, fp


def _one_object(frame: IntArray, cost_m: FloatArray, wall: BoolArray) -> tuple[IntArray, IntArray]:
    """The same where no frame has candidates near two obstacles: the first is true, then each makes one false.

    The nearest stays matched; the other one of the two is false unless it is near structure.
    """
    start = np.searchsorted(frame, frame)
    place = np.arange(len(frame)) - start
    tp, fp = (place == 0).astype(np.int64), np.zeros(len(frame), np.int64)
    best = start.copy()  # row of the nearest so far, kept at each frame's first row
    for at in range(1, int(place.max(initial=0)) + 1):
        row = np.flatnonzero(place == at)
        held = best[start[row]]
        nearer = cost_m[row] < cost_m[held]
        fp[row] = ~wall[np.where(nearer, held, row)]
        best[start[row]] = np.where(nearer, row, held)
    return tp, fp


def _coarse(score: FloatArray) -> FloatArray:
    """Scores with 11 significant bits; minus infinity where there is none."""
    mantissa, exponent = np.frexp(np.where(np.isnan(score), -np.inf, score))
    return np.asarray(np.ldexp(np.round(mantissa * _SIGNIFICANT) / _SIGNIFICANT, exponent))


def _ratios(part: IntArray, whole: IntArray) -> FloatArray:
    return np.asarray(np.divide(part, whole, out=np.full(len(part), math.nan), where=whole > 0))
