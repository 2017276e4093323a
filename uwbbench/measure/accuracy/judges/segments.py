"""Judge of segments: the scoring ``segment``.

Conventions
-----------
* A detection is the interval from ``range_start_m`` to ``range_stop_m``; rows without one are ignored. It is near an
  object whose range lies in it, or no farther from it than the gate (inclusive).
* A segment that is near labelled objects is in the region if and only if one of them is; any other is in it if its
  own ``range_m`` is, or its middle where that is not known.
* Segments and visible obstacles are matched one-to-one: as many pairs that are near as possible, and of these the
  ones whose ``range_m`` are closest in sum. Other segments are false, except those near structure; the error of a
  matched segment is its ``range_m`` minus the true range, any other has none.
* *Overlap*: an obstacle takes up its range, a gate to either side. Per frame, the length that segments and visible
  obstacles have in common, and the length that either covers, both within the region; segments set aside as structure
  count in neither.
"""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.detections import Detections
from uwbbench.api.errors import ScoringError
from uwbbench.api.outcomes import SegmentOutcome
from uwbbench.config.rules import Table
from uwbbench.measure.accuracy.judges.counts import Counts
from uwbbench.measure.accuracy.judges.retained import beside, strongest
from uwbbench.measure.accuracy.matching import match_frames
from uwbbench.measure.accuracy.rules import ScoringRules
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.verdict import Verdict


def judge_segments(detections: Detections, scene: Scene, rules: ScoringRules, table: Table) -> Verdict:  # noqa: ARG001
    """Judge every segment; errors are those of the function that asks this judge.

    Parameters
    ----------
    detections, scene, rules, table
        As :func:`~uwbbench.measure.accuracy.judge.judge` has them; the table is always ``filtering``.
    """
    visible = scene.visible(rules.region) & scene.scored[:, None]
    rows = _segments(detections.take(scene.scored[detections.frame]))
    rows = rows.take(beside(rows, near_segments(rows, scene, rules), scene, rules))
    kept = strongest(rows, rules)
    near = near_segments(kept, scene, rules)
    error_m = kept.range_m[:, None] - scene.sight.range_m[kept.frame]
    partner = match_frames(kept.frame, np.where(near & visible[kept.frame], np.abs(error_m), np.nan), math.inf)
    matched = partner >= 0
    wall = ~matched & (near & ~scene.obstacle).any(axis=1)
    stray = ~matched & ~wall
    signed_m = np.full(len(kept), np.nan)
    signed_m[matched] = error_m[matched, partner[matched]]
    found = np.zeros_like(visible)
    found[kept.frame[matched], partner[matched]] = True

    duplicate = stray & (near & found[kept.frame]).any(axis=1)
    counts = Counts(scene, kept, visible, matched, wall, duplicate, found)
    index = counts.index
    shared_m, covered_m = _overlap(kept.take(~wall), visible, scene, rules)
    outcome = SegmentOutcome(
        **counts.facts(counts.there - counts.of(matched), signed_m),
        shared_m=shared_m[index],
        covered_m=covered_m[index],
    )
    return counts.verdict(outcome, math.nan)


def near_segments(detections: Detections, scene: Scene, rules: ScoringRules) -> BoolArray:
    """Labelled objects (n, objects) that lie in each segment, or no farther from it than the gate.

    Parameters
    ----------
    detections : Detections
        With ``range_start_m`` and ``range_stop_m``.
    scene : Scene
    rules : ScoringRules
    """
    range_m = scene.sight.range_m[detections.frame]
    behind = range_m >= detections["range_start_m"][:, None] - rules.gate_m
    before = range_m <= detections["range_stop_m"][:, None] + rules.gate_m
    return np.asarray(behind & before & scene.labelled[detections.frame])


def _segments(detections: Detections) -> Detections:
    """Rows that are segments, each with a ``range_m``."""
    if len(detections) and not {"range_start_m", "range_stop_m"} <= set(detections.names):
        raise ScoringError(
            "the detections have no range_start_m and range_stop_m: they are no segments, as a stage makes them with "
            "'start_tap' and 'stop_tap' before the stage 'range'; score them by 'frame', 'peak', 'object' or 'latest'"
        )
    start_m, stop_m, range_m = (detections[name] for name in ("range_start_m", "range_stop_m", "range_m"))
    whole = detections.with_columns(range_m=np.where(np.isnan(range_m), (start_m + stop_m) / 2, range_m))
    return whole.take(np.isfinite(start_m) & np.isfinite(stop_m))


def _overlap(
    segments: Detections, visible: BoolArray, scene: Scene, rules: ScoringRules
) -> tuple[FloatArray, FloatArray]:
    """Length in each frame that segments and obstacles have in common, and that either covers, in the region."""
    frames = len(visible)
    low, high = rules.region.limits_m(scene.header.radar)
    frame, column = np.nonzero(visible)
    range_m = scene.sight.range_m[frame, column]
    true = frame, range_m - rules.gate_m, range_m + rules.gate_m
    said = segments.frame, segments["range_start_m"], segments["range_stop_m"]
    either = tuple(np.concatenate(pair) for pair in zip(true, said, strict=True))
    lengths_m = [
        _covered(rows, np.clip(start, low, high), np.clip(stop, low, high), frames)
        for rows, start, stop in (true, said, either)
    ]
    return np.maximum(lengths_m[0] + lengths_m[1] - lengths_m[2], 0.0), lengths_m[2]


def _covered(frame: IntArray, start_m: FloatArray, stop_m: FloatArray, frames: int) -> FloatArray:
    """Length (frames,) that the intervals of each frame cover together."""
    length_m = np.zeros(frames)
    if not len(frame):
        return length_m
    apart_m = 2 * (np.abs(stop_m).max() + 1)  # so that intervals of different frames never meet
    order = np.lexsort((start_m, frame))
    frame, start_m, stop_m = (
        frame[order],
        start_m[order] + frame[order] * apart_m,
        stop_m[order] + frame[order] * apart_m,
    )
    reached = np.concatenate([start_m[:1], np.maximum.accumulate(stop_m)[:-1]])
    np.add.at(length_m, frame, np.maximum(stop_m - np.maximum(start_m, reached), 0.0))
    return length_m
