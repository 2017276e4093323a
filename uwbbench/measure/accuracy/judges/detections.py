"""Judge of detections, frame by frame: the scorings ``frame``, ``peak``, ``object`` and ``latest``."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray
from uwbbench.api.detections import Detections
from uwbbench.api.errors import ScoringError
from uwbbench.api.metric import Outcome
from uwbbench.config.rules import Table
from uwbbench.measure.accuracy.age import latest_answers
from uwbbench.measure.accuracy.judges.counts import Counts
from uwbbench.measure.accuracy.judges.retained import chance_recall, in_region, strongest
from uwbbench.measure.accuracy.matching import match_frames
from uwbbench.measure.accuracy.rules import ScoringRules
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.verdict import Verdict


def judge_detections(detections: Detections, scene: Scene, rules: ScoringRules, table: Table) -> Verdict:
    """Judge every detection of a table, for the function of the same arguments that asks this judge.

    Parameters
    ----------
    detections : Detections
    scene : Scene
    rules : ScoringRules
    table : {"filtering", "mapping"}
    """
    if rules.scoring == "latest":
        detections = latest_answers(detections)
    exhaustive = scene.truth.exhaustive
    visible = scene.visible(rules.region)
    clustered = detections.take(detections["cluster"] >= 0) if table == "mapping" else detections
    kept = strongest(in_region(clustered, scene, rules, table), rules)
    error_m = scene.errors_m(kept, table, rules.surface)
    near = np.abs(error_m) <= rules.gate_m
    seen = visible[kept.frame]

    signed_m = _nearest(error_m, seen)
    signed_m = np.where(np.isnan(signed_m), _nearest(error_m, np.broadcast_to(scene.obstacle, near.shape)), signed_m)
    wall = duplicate = np.zeros(len(kept), bool)
    found = np.zeros_like(visible)
    if rules.scoring == "object":
        partner = match_frames(kept.frame, np.where(seen, np.abs(error_m), np.nan), rules.gate_m)
        matched = partner >= 0
        signed_m[matched] = error_m[matched, partner[matched]]
        wall = ~matched & (near & ~scene.obstacle).any(axis=1)
        signed_m[wall] = np.nan
        found[kept.frame[matched], partner[matched]] = True
        duplicate = ~matched & ~wall & (near & found[kept.frame]).any(axis=1)
    else:
        matched = np.asarray((near & seen).any(axis=1))
        row, column = np.nonzero(near & seen)
        found[kept.frame[row], column] = True
    counts = Counts(scene, kept, visible, matched, wall, duplicate, found)
    if not exhaustive:
        signed_m[~matched] = np.nan
    there, tp = counts.there, counts.of(matched)
    if rules.scoring == "object":
        fn = there - tp
    else:
        missed = (there > 0) & ((counts.retained if exhaustive else tp) == 0)
        if rules.scoring == "peak":
            missed &= _has_true_candidate(detections, missed, scene, rules, table)
        fn = missed.astype(np.int64)
    chance = chance_recall(counts.retained, scene, rules) if table == "filtering" else math.nan
    return counts.verdict(Outcome(**counts.facts(fn, signed_m)), chance)


def _nearest(error_m: FloatArray, among: BoolArray) -> FloatArray:
    """Error of smallest magnitude (n,) among the chosen objects (n, objects); NaN where there is none."""
    chosen = np.where(among, error_m, np.nan)
    chosen = np.concatenate([chosen, np.full((len(chosen), 1), np.nan)], axis=1)
    column = np.argmin(np.where(np.isnan(chosen), np.inf, np.abs(chosen)), axis=1)
    smallest: FloatArray = chosen[np.arange(len(chosen)), column]
    return smallest


def _has_true_candidate(
    detections: Detections, asked: BoolArray, scene: Scene, rules: ScoringRules, table: Table
) -> BoolArray:
    """Those of the frames (frames,) asked for where a peak before the filters lies in a visible obstacle's gate."""
    candidates = detections.candidates
    if candidates is None:
        raise ScoringError(
            "peak scoring asks what the filters removed, and these detections do not carry the peaks before the "
            "filters; take them from detector.run(capture, candidates=True), or use the scoring 'frame' or 'object'"
        )
    needed = "range_m" if table == "filtering" else "x_m"
    if len(candidates) and needed not in candidates:
        raise ScoringError(f"peak scoring: the peaks before the filters have no {needed}")
    candidates = candidates.take(asked[candidates.frame])
    near = np.abs(scene.errors_m(candidates, table, rules.surface)) <= rules.gate_m
    true = (near & scene.visible(rules.region)[candidates.frame]).any(axis=1)
    return np.isin(np.arange(len(scene.header)), candidates.frame[true])
