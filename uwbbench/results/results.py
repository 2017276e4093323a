"""What a run folder says about each detector and capture, judged again from the stored detections."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.capture import CaptureHeader
from uwbbench.api.errors import ScoringError, StoreError
from uwbbench.api.metric import Outcome
from uwbbench.api.truth import Sight
from uwbbench.measure.accuracy.judge import judge, tables_of
from uwbbench.measure.accuracy.metrics.choice import MetricChoice
from uwbbench.measure.accuracy.rules import rules_on
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.scoring import ScoringRules, column_of
from uwbbench.measure.accuracy.stats import Estimate, estimated
from uwbbench.run.folder.folder import RunFolder


@dataclass(frozen=True)
class Scored:
    """One detector on one capture in one scoring and table.

    Attributes
    ----------
    detector, dataset, capture, scoring, table : str
    source : {"measured", "simulated"}
    channel : int or None
    material : str
        Materials of the obstacles of the capture.
    frames, processed : int
        Frames of the capture, and those that the detector looked at; the others were invalid.
    numbers : mapping
        The stored score row.
    outcome : Outcome
    range_m : (scored frames,) array
        True range of the nearest visible obstacle; NaN where there is none, and where a run is judged as a whole.
    scene : str
        Scene or set-up that the capture is of, as captures of one scene repeat one another; empty: one of its own.
    """

    detector: str
    dataset: str
    capture: str
    scoring: str
    table: str
    source: str
    channel: int | None
    material: str
    frames: int
    processed: int
    numbers: Mapping[str, Any]
    outcome: Outcome
    range_m: FloatArray
    scene: str = ""


def scored(folder: RunFolder) -> list[Scored]:
    """Every unit of a run that could be scored, under the rules of the stored scores.

    Raises
    ------
    StoreError
        If the run was killed before its scores were written.
    """
    table = folder.scores()
    if "scoring" not in table:
        return []
    keys = ["detector", "dataset", "capture", "scoring", "table"]
    rows = {tuple(row[key] for key in keys): row for row in table.to_dict("records") if row["status"] == "scored"}
    return list(_scored(folder, rows, folder.rules))


def _scored(folder: RunFolder, rows: Mapping[Any, Any], rules: Sequence[ScoringRules]) -> Iterator[Scored]:
    headers: dict[str, CaptureHeader] = {}
    sights: dict[str, Sight] = {}
    for entry in folder.entries():
        if entry.kind != "accuracy" or entry.status != "done":
            continue
        if entry.capture_id not in headers:
            headers[entry.capture_id] = folder.header(entry.capture_id)
        detections, header = folder.detections(entry.unit), headers[entry.capture_id]
        try:
            scene = Scene.of(detections, header, sights.get(entry.capture_id))
        except ScoringError:  # its reason is in the stored scores
            continue
        sights[entry.capture_id] = scene.sight
        for rule in rules_on(rules, entry.dataset):
            try:
                names = tables_of(detections, rule.scoring)
                tables = {name: judge(detections, scene, rule, name).outcome for name in names}
            except ScoringError:
                continue
            for name, outcome in tables.items():
                key = entry.detector, entry.dataset, entry.capture, rule.scoring, name
                if key not in rows:
                    raise StoreError(f"{folder.path}: its scores are older than its journal; continue it with --resume")
                yield Scored(
                    detector=entry.detector,
                    dataset=entry.dataset,
                    capture=entry.capture,
                    scoring=rule.scoring,
                    table=name,
                    source=header.source,
                    channel=header.radar.channel,
                    material=" + ".join(entry.facts["materials"]) or "none",
                    frames=len(header),
                    processed=len(detections.processed),
                    numbers=rows[key],
                    outcome=outcome,
                    range_m=np.full(len(outcome.group), np.nan) if outcome.of_run else _nearest_m(scene, rule),
                    scene="" if outcome.of_run else folder.scene(entry.dataset, entry.capture),
                )


def _nearest_m(scene: Scene, rule: ScoringRules) -> FloatArray:
    """Range (scored frames,) of the nearest visible obstacle."""
    range_m = np.where(scene.visible(rule.region), scene.sight.range_m, np.inf)
    nearest_m = range_m.min(axis=1, initial=np.inf)[scene.scored]
    return np.where(np.isinf(nearest_m), np.nan, nearest_m)


def estimates_of(metrics: MetricChoice, members: Sequence[Scored], settings: Mapping[str, Any]) -> dict[str, Estimate]:
    """Estimate of each metric over some captures together.

    Parameters
    ----------
    metrics : MetricChoice
        One that is not installed is the mean of the values that were stored for each capture, without an interval.
    members : sequence of Scored
        What one detector did on each capture.
    settings : mapping
        ``confidence`` of the intervals.
    """
    outcomes, known_scenes = [one.outcome for one in members], scenes_of(members)
    scenes = [known_scenes[one.capture] for one in members]
    confidence = settings["confidence"]
    estimates = {name: estimated(metric, outcomes, scenes, confidence=confidence) for name, metric in metrics.items()}
    for name in metrics.absent:
        stored = [one.numbers.get(column_of(name, unit)) for one in members for unit in ("", "m")]
        known = [value for value in stored if isinstance(value, float) and not math.isnan(value)]
        if known:
            estimates[name] = Estimate(float(np.mean(known)), math.nan, math.nan, len(known), estimates[name].groups)
    return estimates


def columns_of(estimates: Mapping[str, Estimate]) -> dict[str, float]:
    """Values, ends of the intervals and counts of samples, as columns of a table."""
    columns: dict[str, float] = {}
    for name, estimate in estimates.items():
        columns |= {
            name: estimate.value,
            f"{name}_low": estimate.low,
            f"{name}_high": estimate.high,
            f"{name}_n": estimate.n,
            f"{name}_outer_low": estimate.outer_low,
            f"{name}_outer_high": estimate.outer_high,
        }
    return columns


def scenes_of(scored: Iterable[Scored]) -> dict[str, str]:
    """Scene of each capture of a board; where runs name it and older ones do not, that of those that do."""
    scenes: dict[str, str] = {}
    for one in scored:
        if scenes.get(one.capture, one.capture) == one.capture:
            scenes[one.capture] = one.scene or one.capture
    return scenes


def errors_in(outcomes: Iterable[Outcome]) -> int:
    """Detections that have an error: those that belong to an object."""
    return sum(int(np.isfinite(outcome.error_m).sum()) for outcome in outcomes)
