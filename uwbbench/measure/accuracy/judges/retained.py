"""Which rows count at all, and what as many random ones would find."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api.arrays import BoolArray, IntArray
from uwbbench.api.detections import Detections
from uwbbench.config.rules import Table
from uwbbench.measure.accuracy.rules import ScoringRules
from uwbbench.measure.accuracy.scene import Scene


def in_region(detections: Detections, scene: Scene, rules: ScoringRules, table: Table) -> Detections:
    """Detections of scored frames in the region: those near labelled objects share their objects' place.

    Parameters
    ----------
    detections : Detections
    scene : Scene
    rules : ScoringRules
    table : {"filtering", "mapping"}
    """
    detections = detections.take(scene.scored[detections.frame])
    near = np.abs(scene.errors_m(detections, table, rules.surface)) <= rules.gate_m
    return detections.take(beside(detections, near, scene, rules))


def beside(detections: Detections, near: BoolArray, scene: Scene, rules: ScoringRules) -> BoolArray:
    """Which detections (n,) are in the region: those near labelled objects if one of these is, any other by its range.

    Parameters
    ----------
    detections : Detections
    near : (n, objects) bool array
        Labelled objects that each is near to.
    scene : Scene
    rules : ScoringRules
    """
    low, high = rules.region.limits_m(scene.header.radar)
    with_them = (near & scene.inside(rules.region)[detections.frame]).any(axis=1)
    alone = (detections.range_m >= low) & (detections.range_m <= high)
    return np.where(near.any(axis=1), with_them, alone)


def strongest(detections: Detections, rules: ScoringRules) -> Detections:
    """Detections ordered by frame and falling amplitude, no more in a frame than the rules allow."""
    weakness = np.nan_to_num(-detections["amplitude"], nan=np.inf)
    detections = detections.take(np.lexsort((weakness, detections.frame)))
    most = 1 if rules.scoring in ("frame", "latest") else rules.strongest
    rank = np.arange(len(detections)) - np.searchsorted(detections.frame, detections.frame)
    return detections if most is None else detections.take(rank < most)


def chance_recall(retained: IntArray, scene: Scene, rules: ScoringRules) -> float:
    """Recall of uniformly random ranges in the region, as many in each frame as the detector retained there.

    One random range falls within the gate of an obstacle with probability w / L, w being the part of its gate inside
    the region and L the region's length; at least one of k with 1 - (1 - w / L)^k. In ``frame`` the gates of several
    obstacles unite.

    Parameters
    ----------
    retained : (frames,) int array
    scene : Scene
    rules : ScoringRules
    """
    if rules.scoring == "peak":
        return math.nan
    low, high = rules.region.limits_m(scene.header.radar)
    visible = scene.visible(rules.region)[scene.scored]
    range_m = scene.sight.range_m[scene.scored]
    start = np.where(visible, np.clip(range_m - rules.gate_m, low, high), high)
    stop = np.where(visible, np.clip(range_m + rules.gate_m, low, high), high)
    width = stop - start
    if rules.scoring in ("frame", "latest"):
        order = np.argsort(start, axis=1)
        start, stop = np.take_along_axis(start, order, axis=1), np.take_along_axis(stop, order, axis=1)
        reached = np.maximum.accumulate(np.insert(stop[:, :-1], 0, low, axis=1), axis=1)
        width = np.sum(np.maximum(stop - np.maximum(start, reached), 0.0), axis=1, keepdims=True)
        visible = np.asarray(visible.any(axis=1))[:, None]
    chance = 1 - (1 - width / (high - low)) ** retained[scene.scored][:, None]
    return float(np.mean(chance[visible])) if visible.any() else math.nan
