"""Curves without a threshold of several captures together, with intervals over scenes.

Conventions
-----------
* Counts are those of :mod:`uwbbench.measure.accuracy.ranked`: added up over captures before anything is divided.
* Intervals are those of :mod:`uwbbench.measure.accuracy.intervals`, scenes being the units: of recall and precision
  at a threshold, of false alarms, and of average precision, which is worked out again without each scene.
* A curve is thinned to what a chart can show: steps of equal length in recall and false alarms; both ends are kept.
* Captures whose candidates were ordered by different columns are not put together.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uwbbench.api.arrays import FloatArray, IntArray
from uwbbench.measure.accuracy import intervals
from uwbbench.measure.accuracy.intervals import INNER_UNITS, Interval
from uwbbench.measure.accuracy.ranked import RankedCounts, pooled, without_each
from uwbbench.measure.accuracy.rules import rules_on
from uwbbench.run.folder.folder import RunFolder
from uwbbench.run.folder.journal import Entry

MOST_POINTS = 100

FEW_ALARMS = 10.0
"""False alarms a minute at which detectors are compared."""

CurveKey = tuple[str, str, str]
"""Dataset, source and detector."""


@dataclass(frozen=True)
class RankedCurve:
    """What one detector would find at every threshold of its score, on captures of one dataset.

    Attributes
    ----------
    order : str
        Column that orders the candidates.
    captures, scenes : int
    average_precision : Interval
        NaN where the truth is not exhaustive.
    score : (points,) array
        Thresholds, falling; the last may be minus infinity.
    recall, precision, false_alarms_per_minute : Interval of (points,) arrays
    few_alarms_recall : float
        Largest recall at no more than :data:`FEW_ALARMS` false alarms a minute; NaN where these are undefined.
    setting : mapping of str to Interval
        Recall, precision and false alarms a minute of the detector as it is set.
    exhaustive : bool
    """

    order: str
    captures: int
    scenes: int
    average_precision: Interval
    score: FloatArray
    recall: Interval
    precision: Interval
    false_alarms_per_minute: Interval
    few_alarms_recall: float
    setting: dict[str, Interval]
    exhaustive: bool

    def to_dict(self) -> dict[str, Any]:
        """Plain values; undefined ones are NaN."""
        names = ("average_precision", "recall", "precision", "false_alarms_per_minute")
        return {
            "order": self.order,
            "captures": self.captures,
            "scenes": self.scenes,
            "exhaustive": self.exhaustive,
            "score": self.score,
            "few_alarms_recall": self.few_alarms_recall,
            **{name: _ends(getattr(self, name)) for name in names},
            "setting": {name: _ends(interval) for name, interval in self.setting.items()},
        }


def _ends(interval: Interval) -> dict[str, Any]:
    return {"value": interval.value, "low": interval.low, "high": interval.high}


def curves_of(folder: RunFolder, units: Sequence[Entry], confidence: float) -> dict[CurveKey, RankedCurve]:
    """Curves of a run, of what was stored for the gate and region of its scores.

    Parameters
    ----------
    folder : RunFolder
    units : sequence of Entry
        Accuracy units that were scored.
    confidence : float
        Of the intervals.
    """
    groups: dict[CurveKey, list[tuple[RankedCounts, str]]] = defaultdict(list)
    rules = folder.rules if units else []
    for entry in units:
        counts = folder.curve(entry.unit, rules_on(rules, entry.dataset)[0])
        if counts is not None:
            groups[entry.dataset, entry.facts["source"], entry.detector].append(
                (counts, folder.scene(entry.dataset, entry.capture))
            )
    made = {key: ranked_curve(parts, confidence) for key, parts in sorted(groups.items())}
    return {key: curve for key, curve in made.items() if curve is not None}


def ranked_curve(parts: Sequence[tuple[RankedCounts, Hashable]], confidence: float) -> RankedCurve | None:
    """Curve of several captures; None where there are none, or they do not have one order.

    Parameters
    ----------
    parts : sequence of (RankedCounts, scene)
        One for each capture, with the scene that it is of; captures of one scene repeat one another.
    confidence : float
        Of the intervals.
    """
    if not parts or len({part.order for part, _ in parts if part.order}) > 1:
        return None
    members = defaultdict[Hashable, list[RankedCounts]](list)
    for part, scene in parts:
        members[scene].append(part)
    scenes = [repeats[0] if len(repeats) == 1 else pooled(repeats) for repeats in members.values()]
    whole = pooled(scenes)
    rows = _thinned(whole)
    score = whole.score[rows]
    tp, fp = (np.stack([_reached(part, name, score) for part in scenes], axis=-1) for name in ("tp", "fp"))
    there, minutes = np.array([part.there for part in scenes]), np.array([part.duration_s / 60 for part in scenes])
    set_tp, set_fp = (np.array([getattr(part, name) for part in scenes]) for name in ("set_tp", "set_fp"))
    about = there, minutes, whole.exhaustive, confidence
    left = [] if len(scenes) == 1 else without_each(scenes)
    area = intervals.of_left_out(
        whole.average_precision,
        left or [math.nan],
        there if left else [0.0],
        enough=len(scenes) >= INNER_UNITS,
        scale="logit",
        confidence=confidence,
    )
    return RankedCurve(
        order=whole.order,
        captures=len(parts),
        scenes=len(scenes),
        average_precision=area,
        score=score,
        **_intervals(tp, fp, *about),
        few_alarms_recall=_recall_at(whole, FEW_ALARMS),
        setting=_intervals(set_tp, set_fp, *about),
        exhaustive=whole.exhaustive,
    )


def _intervals(
    tp: IntArray, fp: IntArray, there: IntArray, minutes: FloatArray, exhaustive: bool, confidence: float
) -> dict[str, Interval]:
    """Recall, precision and false alarms a minute of counts (..., captures)."""
    found = intervals.share(tp, np.broadcast_to(there, tp.shape), confidence=confidence)
    true = intervals.share(tp, tp + fp, confidence=confidence)
    alarms = intervals.ratio(fp, np.broadcast_to(minutes, fp.shape), confidence=confidence)
    if not exhaustive:
        true, alarms = (Interval(*(np.full_like(end, math.nan) for end in one)) for one in (true, alarms))
    return {"recall": found, "precision": true, "false_alarms_per_minute": alarms}


def _recall_at(whole: RankedCounts, rate: float) -> float:
    reached = whole.recall[whole.false_alarms_per_minute <= rate]
    return float(np.max(reached, initial=0.0)) if whole.exhaustive else math.nan


def _reached(part: RankedCounts, name: str, score: FloatArray) -> IntArray:
    """Count (thresholds,) of a capture at thresholds of any capture."""
    counts = np.concatenate([[0], np.cumsum(getattr(part, name))])
    return np.asarray(counts[np.searchsorted(-part.score, -score, side="right")])


def _thinned(whole: RankedCounts) -> IntArray:
    """Steps that a chart shows."""
    steps = len(whole.score)
    if steps <= MOST_POINTS:
        return np.arange(steps)
    way = np.zeros(steps)
    for counts in (whole.tp, whole.fp):
        grown = np.cumsum(np.abs(counts))
        way += np.sqrt(grown / max(grown[-1], 1))  # denser where there are few false alarms yet
    rows = np.searchsorted(way, np.linspace(way[0], way[-1], MOST_POINTS))
    return np.unique(np.concatenate([[0], rows, [steps - 1]])).astype(np.int64)
