"""Judge of presence: the scoring ``presence``, which asks of each frame whether anything is there.

Conventions
-----------
* A frame is *present* if an obstacle is visible in the region. The detector says so with any row that it retains: one
  without a range speaks of the frame as a whole, one with a range must lie in the region.
* One frame is one chance: true, false, missed, or rightly empty. The gate plays no part, and no frame has an error.
* The probability of a frame is the largest ``probability`` of its rows, before the filters where the candidates are
  known; a frame without a row has 0. Where rows have none, what is made of it is undefined.
* Classes are those of the columns ``class_probability_NAME``. A frame is of the class that is the name, or the
  material, of its nearest visible obstacle; of ``empty`` where none is visible. The detector says the class of largest
  probability; of a frame without a row, ``empty``.
"""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.detections import Detections
from uwbbench.api.outcomes import PresenceOutcome
from uwbbench.config.rules import Table
from uwbbench.measure.accuracy.rules import ScoringRules
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.verdict import Verdict

CLASS = "class_probability_"
"""What columns of class probabilities begin with."""
EMPTY = "empty"
"""Class of a frame in which nothing is."""


def judge_presence(detections: Detections, scene: Scene, rules: ScoringRules, table: Table) -> Verdict:  # noqa: ARG001
    """Judge every frame; errors are those of the function that asks this judge.

    Parameters
    ----------
    detections, scene, rules, table
        As :func:`~uwbbench.measure.accuracy.judge.judge` has them; the table is always ``filtering``.
    """
    frames, exhaustive = len(scene.header), scene.truth.exhaustive
    visible = scene.visible(rules.region)
    present = np.asarray(visible.any(axis=1))
    kept = _one_each(_asked(detections, scene, rules))
    said = np.zeros(frames, bool)
    said[kept.frame] = True
    before_filters = detections.candidates
    rows = detections if before_filters is None else before_filters
    rows = _asked(rows, scene, rules)
    classes = tuple(name.removeprefix(CLASS) for name in rows.names if name.startswith(CLASS))
    index = np.flatnonzero(scene.scored)
    true = present[kept.frame]
    outcome = PresenceOutcome(
        group=scene.group()[index],
        tp=(present & said)[index].astype(np.int64),
        fp=(~present & said & exhaustive)[index].astype(np.int64),
        fn=(present & ~said)[index].astype(np.int64),
        error_frame=np.searchsorted(index, kept.frame),
        error_m=np.full(len(kept), np.nan),
        matched=true,
        duration_s=len(index) / scene.header.radar.frame_rate_hz,
        exhaustive=exhaustive,
        present=present[index],
        probability=_probability(rows, frames)[index],
        classes=classes,
        true_class=_true_class(classes, visible, scene)[index],
        said_class=_said_class(classes, rows, frames)[index],
    )
    return Verdict(
        outcome=outcome,
        true_empty=int(np.sum(~(present | said)[index])),
        duplicates=0,
        structure=0,
        unmatched=0 if exhaustive else int(np.sum(~true)),
        chance_recall=math.nan,
        retained=kept,
        stray=~true,
        found=visible & said[:, None],
    )


def _asked(detections: Detections, scene: Scene, rules: ScoringRules) -> Detections:
    """Rows of scored frames that speak of the frame as a whole, or of a place in the region."""
    low, high = rules.region.limits_m(scene.header.radar)
    range_m = detections.range_m
    place = np.isnan(range_m) | ((range_m >= low) & (range_m <= high))
    return detections.take(scene.scored[detections.frame] & place)


def _one_each(detections: Detections) -> Detections:
    """Most probable row of each frame, the first of equal ones."""
    order = np.lexsort((-np.nan_to_num(detections["probability"]), detections.frame))
    _, first = np.unique(detections.frame[order], return_index=True)
    return detections.take(order[first])


def _probability(rows: Detections, frames: int) -> FloatArray:
    """Probability (frames,) that each frame holds an obstacle."""
    if "probability" not in rows.names:
        return np.full(frames, np.nan)
    probability = np.zeros(frames)
    np.maximum.at(probability, rows.frame, np.nan_to_num(rows["probability"]))
    return probability


def _true_class(classes: tuple[str, ...], visible: BoolArray, scene: Scene) -> IntArray:
    """Class (frames,) of the nearest visible obstacle of each frame."""
    of_object = [
        next((classes.index(name) for name in (item.name, item.material) if name in classes), -1)
        for item in scene.truth.objects
    ]
    empty = classes.index(EMPTY) if EMPTY in classes else -1
    if not of_object:
        return np.full(len(visible), empty)
    nearest = np.argmin(np.where(visible, scene.sight.range_m, np.inf), axis=1)
    return np.where(visible.any(axis=1), np.array(of_object)[nearest], empty)


def _said_class(classes: tuple[str, ...], rows: Detections, frames: int) -> IntArray:
    """Class (frames,) that the detector holds most probable."""
    said = np.full(frames, classes.index(EMPTY) if EMPTY in classes else -1)
    rows = _one_each(rows)
    if classes and len(rows):
        said[rows.frame] = np.argmax(np.stack([rows[CLASS + name] for name in classes], axis=1), axis=1)
    return said
