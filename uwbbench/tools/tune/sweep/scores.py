"""Scores of all threshold sets of a sweep, from one verdict on each peak."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uwbbench.api.arrays import FloatArray, IntArray
from uwbbench.api.capture import Capture, CaptureHeader
from uwbbench.api.detections import Detections
from uwbbench.api.errors import ScoringError
from uwbbench.api.truth import Sight, Trajectory
from uwbbench.measure.accuracy.judge import judge
from uwbbench.measure.accuracy.rules import ScoringRules
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.tools.tune.sweep.sweep import Swept

RATIOS = ("f1", "precision", "recall", "rmse_m", "mae_m")
"""What counts and sums are made into, as tables name it."""


@dataclass(frozen=True)
class SetScores:
    """Scores of every threshold set after filtering, over one or several captures.

    Attributes
    ----------
    tp, fp, fn : (sets,) int array
    errors : (sets,) int array
        Retained detections that have an error.
    absolute_m, squared_m2 : (sets,) array
        Sums over the errors of all retained detections, as arXiv 2512.01018 takes them.
    """

    tp: IntArray
    fp: IntArray
    fn: IntArray
    errors: IntArray
    absolute_m: FloatArray
    squared_m2: FloatArray

    @staticmethod
    def merged(parts: Sequence[SetScores]) -> SetScores:
        """Scores over several captures: counts and sums are added before dividing."""
        names = [field.name for field in dataclasses.fields(SetScores)]
        return SetScores(**{name: np.sum([getattr(part, name) for part in parts], axis=0) for name in names})

    @staticmethod
    def stacked(parts: Sequence[SetScores]) -> SetScores:
        """Scores of the sets of all parts, one after the other."""
        names = [field.name for field in dataclasses.fields(SetScores)]
        return SetScores(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})

    @property
    def precision(self) -> FloatArray:
        """``tp / (tp + fp)`` (sets,); NaN where it is 0/0."""
        return _ratio(self.tp, self.tp + self.fp)

    @property
    def recall(self) -> FloatArray:
        """``tp / (tp + fn)`` (sets,); NaN where it is 0/0."""
        return _ratio(self.tp, self.tp + self.fn)

    @property
    def f1(self) -> FloatArray:
        """``2 tp / (2 tp + fp + fn)`` (sets,); NaN where it is 0/0."""
        return _ratio(2 * self.tp, 2 * self.tp + self.fp + self.fn)

    @property
    def mae_m(self) -> FloatArray:
        """Mean absolute error (sets,); NaN without one."""
        return _ratio(self.absolute_m, self.errors)

    @property
    def rmse_m(self) -> FloatArray:
        """Root of the mean squared error (sets,); NaN without one."""
        return np.asarray(np.sqrt(_ratio(self.squared_m2, self.errors)))


def set_scores(swept: Swept, capture: CaptureHeader, rules: ScoringRules) -> SetScores:
    """Scores of all threshold sets on one capture, those of :func:`~uwbbench.measure.accuracy.scoring.score`.

    Where a frame retains one detection, what that detection is (true or false, and whether it saves the frame from
    being a miss) does not depend on the set. So each peak is judged once, as if it were alone in a frame of its own.

    Parameters
    ----------
    swept : Swept
        Of a detector that retains one detection a frame.
    capture : Capture or CaptureHeader
        That it was swept on.
    rules : ScoringRules

    Returns
    -------
    SetScores
        Sums of errors are rounded to 2^-62 of the sum over all peaks.

    Raises
    ------
    ScoringError
        If the detector retains more than one detection a frame, the truth is missing or not exhaustive (precision and
        F1 are then undefined), or the detections lack a range.
    """
    if swept.count != 1:
        raise ScoringError(
            "threshold sets are scored together only where one detection a frame is retained: the verdict on several "
            "depends on each other; score sweep.run(capture).detections(index) for each set instead"
        )
    header = capture.header if isinstance(capture, Capture) else capture
    detections = swept.found
    nothing = Detections.empty(detections.processed)
    if rules.scoring == "peak":
        nothing = nothing.annotated(candidates=detections.candidates)
    scene = Scene.of(nothing, header)
    if not scene.truth.exhaustive:
        raise ScoringError(
            f"capture '{header.name}': its truth is not exhaustive, so that precision and F1 are undefined"
        )
    if len(detections) and "range_m" not in detections:
        raise ScoringError("the detections have no range_m; add the stage 'range' to the detector")
    missed = np.zeros(len(header), np.int64)  # in each frame, where nothing is retained
    missed[scene.scored] = judge(nothing, scene, rules, "filtering").outcome.fn

    apart = scene_of_each(detections, scene)
    alone = detections.with_columns(frame=np.arange(len(detections)))
    single = dataclasses.replace(rules, scoring="object" if rules.scoring == "object" else "frame")
    outcome = judge(alone, apart, single, "filtering").outcome
    counts = np.zeros((len(detections), 4), np.int64)
    scored = np.flatnonzero(apart.scored)
    misses_left = outcome.fn if rules.scoring == "object" else missed[detections.frame[scored]] * outcome.fn
    counts[scored, 0], counts[scored, 1] = outcome.tp, outcome.fp
    counts[scored, 2] = missed[detections.frame[scored]] - misses_left
    has_error = np.isfinite(outcome.error_m)
    row = scored[outcome.error_frame[has_error]]
    counts[row, 3] = 1
    error_m = np.zeros((len(detections), 2))
    error_m[row, 0] = np.abs(outcome.error_m[has_error])
    error_m[row, 1] = error_m[row, 0] ** 2
    unit = 2.0 ** (np.ceil(np.log2(np.maximum(error_m.sum(axis=0), 1e-300))) - 62)
    sums = swept.totals(np.concatenate([counts, np.rint(error_m / unit).astype(np.int64)], axis=1))
    return SetScores(
        tp=sums[:, 0],
        fp=sums[:, 1],
        fn=missed.sum() - sums[:, 2],
        errors=sums[:, 3],
        absolute_m=sums[:, 4] * unit[0],
        squared_m2=sums[:, 5] * unit[1],
    )


def scene_of_each(found: Detections, scene: Scene) -> Scene:
    """Scene in which each detection has a frame of its own: a copy of the frame that it was found in."""
    frame, track, sight = found.frame, scene.header.trajectory, scene.sight
    return dataclasses.replace(
        scene,
        header=dataclasses.replace(
            scene.header,
            trajectory=Trajectory(track.timestamp_s[frame], track.position_m[frame], track.yaw_rad[frame]),
        ),
        sight=Sight(sight.range_m[frame], sight.azimuth_rad[frame], sight.occluded[frame]),
        labelled=scene.labelled[frame],
        scored=scene.scored[frame],
    )


def _ratio(part: IntArray | FloatArray, whole: IntArray) -> FloatArray:
    return np.asarray(np.divide(part, whole, out=np.full(len(whole), np.nan), where=whole > 0))
