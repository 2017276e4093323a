"""The best and the worst capture of each dataset, to be looked at: what was there, and what each detector found.

Conventions
-----------
* The detector that leads the dataset's first leaderboard decides: its best and its worst capture by the metric that
  ranks. Equal ones: the first by name.
* A detection is *near* if it lies within the gate of a visible obstacle.
* Runs that are judged as a whole have none.
* Long captures are thinned to what a picture can show; the counts are those of all frames and detections.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.capture import CaptureHeader
from uwbbench.api.detections import Detections
from uwbbench.measure.accuracy.metrics.choice import MetricChoice
from uwbbench.measure.accuracy.rules import outcome_of, rules_on
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.scoring import ScoringRules
from uwbbench.measure.accuracy.stats import evaluate
from uwbbench.results.ground_truth import Outline, TrueRange, outlines, true_ranges
from uwbbench.results.results import Scored
from uwbbench.run.folder.folder import RunFolder
from uwbbench.run.folder.journal import Entry

MOST_POINTS = 600
MOST_DATASETS = 6


@dataclass(frozen=True)
class Marks:
    """Detections of one detector on one capture.

    Attributes
    ----------
    detector : str
    time_s, range_m, x_m, y_m : (shown,) array
        Positions are NaN where the detector gives none.
    near : (shown,) bool array
    count : int
        Detections, of which every so many-th is shown.
    """

    detector: str
    time_s: FloatArray
    range_m: FloatArray
    x_m: FloatArray
    y_m: FloatArray
    near: BoolArray
    count: int

    @property
    def placed(self) -> bool:
        """Whether any detection has a place in the world."""
        return bool(np.isfinite(self.x_m).any())


@dataclass(frozen=True)
class Case:
    """A capture to be looked at.

    Attributes
    ----------
    which : {"best", "worst", "only"}
    dataset, capture, capture_id : str
    leader : str
        The detector whose best or worst capture it is.
    scoring, metric : str
        By which scoring and metric.
    score : float
    header : CaptureHeader
    time_s : (shown,) array
        Time of the shown frames, since the first.
    ranges : list of TrueRange
        Of each obstacle in the shown frames.
    path_m : (shown, 2) array
    outlines : list of Outline
    marks : list of Marks
    """

    which: Literal["best", "worst", "only"]
    dataset: str
    capture: str
    capture_id: str
    leader: str
    scoring: str
    metric: str
    score: float
    header: CaptureHeader
    time_s: FloatArray
    ranges: list[TrueRange]
    path_m: FloatArray
    outlines: list[Outline]
    marks: list[Marks]


def cases(
    folder: RunFolder,
    entries: Sequence[Entry],
    scored: Sequence[Scored],
    leaders: dict[tuple[str, str], str],
    metrics: MetricChoice,
) -> Iterator[Case]:
    """Best and worst capture of each dataset.

    Parameters
    ----------
    folder : RunFolder
    entries : sequence of Entry
        Accuracy entries that were done.
    scored : sequence of Scored
    leaders : dict
        Leading detector of each dataset and source.
    metrics : MetricChoice
        Of the run.
    """
    for (dataset, source), leader in list(leaders.items())[:MOST_DATASETS]:
        rule = rules_on(folder.rules, dataset)[0]
        if outcome_of(rule.scoring).of_run:  # a picture of it is a map
            continue
        chosen = [
            one
            for one in scored
            if (one.dataset, one.source, one.detector) == (dataset, source, leader)
            and (one.scoring, one.table) == (rule.scoring, "filtering")
        ]
        board = metrics.of(rule.scoring)
        names = [board.ranking(exhaustive=one.outcome.exhaustive) for one in chosen]
        rows = [
            (name, evaluate(board[name], [one.outcome]), one.capture) for name, one in zip(names, chosen, strict=True)
        ]
        ranked = [row for row in rows if not math.isnan(row[1])]
        ranked.sort(key=lambda row: (-metrics[row[0]].merit(row[1]), row[2]))
        if not ranked:
            continue
        picks: list[tuple[Literal["best", "worst", "only"], tuple[str, float, str]]]
        picks = [("best", ranked[0]), ("worst", ranked[-1])] if len(ranked) > 1 else [("only", ranked[0])]
        for which, (metric, score, capture) in picks:
            of_capture = [e for e in entries if (e.dataset, e.capture) == (dataset, capture)]
            about = {"dataset": dataset, "capture": capture, "leader": leader, "which": which}
            about |= {"metric": metric, "scoring": rule.scoring}
            yield _case(folder, of_capture, rule, score, about)


def _case(folder: RunFolder, entries: Sequence[Entry], rule: ScoringRules, score: float, about: dict[str, Any]) -> Case:
    capture_id = entries[0].capture_id
    header = folder.header(capture_id)
    shown = _thinned(len(header))
    since_s = header.trajectory.timestamp_s - header.trajectory.timestamp_s[:1]
    marks = []
    for entry in entries:
        detections = folder.detections(entry.unit)
        if detections.mapped is not None:  # its rows are of several receivers
            continue
        scene = Scene.of(detections, header)
        marks.append(_marks(entry.detector, detections, since_s, scene, rule))
    return Case(
        **about,
        capture_id=capture_id,
        score=score,
        header=header,
        time_s=since_s[shown],
        ranges=true_ranges(header, rule.region, shown),
        path_m=header.trajectory.position_m[shown, :2],
        outlines=outlines(header, shown),
        marks=marks,
    )


def _marks(detector: str, detections: Detections, since_s: FloatArray, scene: Scene, rule: ScoringRules) -> Marks:
    rows = _thinned(len(detections))
    error_m = np.abs(scene.errors_m(detections, "filtering"))
    near = np.any((error_m <= rule.gate_m) & scene.visible(rule.region)[detections.frame], axis=1)
    none = np.full(len(rows), np.nan)
    return Marks(
        detector=detector,
        time_s=since_s[detections.frame[rows]],
        range_m=detections.range_m[rows] if "range_m" in detections else none,
        x_m=detections["x_m"][rows] if "x_m" in detections else none,
        y_m=detections["y_m"][rows] if "y_m" in detections else none,
        near=near[rows],
        count=len(detections),
    )


def _thinned(count: int) -> IntArray:
    return np.arange(0, count, max(1, -(-count // MOST_POINTS)), dtype=np.int64)
