"""Judge of maps: the scoring ``map``, of a mapper on a run.

Conventions
-----------
* The map at the end is put into the frame of the truth by the motion that fits the trajectory best, the smoothed one
  where there is one (:mod:`uwbbench.measure.accuracy.trajectories`); and judged again with the start fixed instead.
* *Outlines*: points of the map against those of what any receiver could have seen in the region, structure included
  (:mod:`uwbbench.measure.accuracy.surfaces`), each to the nearest of the other.
* *Landmarks*: point landmarks are matched one-to-one with objects that are no structure, do not move and were seen, as
  many as possible within :data:`GATE_M`. Errors are distances from the outline, 0 inside. What is left is false, beside
  an object that another landmark has a duplicate too; beside an object that was never seen it is neither. A map without
  any point landmark that holds something else is not asked for them.
* *Overlap*: cells that either takes up, with a ring of one cell around.
* The gate of the scoring plays no part.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uwbbench.api.arrays import FloatArray
from uwbbench.api.detections import Detections
from uwbbench.api.errors import ScoringError
from uwbbench.api.geometry import nearest_on_outline
from uwbbench.api.mapper import Map
from uwbbench.api.outcomes import MapOutcome
from uwbbench.config.rules import Table
from uwbbench.measure.accuracy.judges.run import counted, trajectory_of, verdict
from uwbbench.measure.accuracy.matching import match
from uwbbench.measure.accuracy.rules import ScoringRules
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.surfaces import Surface, cells, distances, points_of, seen
from uwbbench.measure.accuracy.trajectories import Motion, aligned, start_fixed
from uwbbench.measure.accuracy.verdict import Verdict

GATE_M = 0.30
"""Largest error of a landmark that is true."""


def judge_map(detections: Detections, scene: Scene, rules: ScoringRules, table: Table) -> Verdict:  # noqa: ARG001
    """Judge the map of a run; errors are those of the function that asks this judge.

    Parameters
    ----------
    detections, scene, rules, table
        As :func:`~uwbbench.measure.accuracy.judge.judge` has them; the table is always ``filtering``.

    Raises
    ------
    ScoringError
        If the capture has no ground truth, or the map is not finite.
    """
    mapped = detections.mapped
    assert mapped is not None  # noqa: S101 - the function that asks has made sure
    if scene.header.truth is None:
        raise ScoringError(f"run '{scene.header.name}' has no ground truth but its poses; score it by 'pose'")
    poses, truth = trajectory_of(mapped, scene, "mapping")
    points_m, landmarks_m = points_of(mapped.map), mapped.map.landmarks.of("point").position_m
    if not (np.isfinite(points_m).all() and np.isfinite(landmarks_m).all()):
        raise ScoringError("the map is not finite")
    surface, asked = seen(scene.header, rules.region), _makes_landmarks(mapped.map)

    def judged(motion: Motion) -> MapOutcome:
        return _outcome(scene, surface, motion.of_points(points_m), motion.of_points(landmarks_m), asked=asked)

    best = judged(aligned(poses.pose, truth))
    outcome = dataclasses.replace(best, start=judged(start_fixed(poses.pose, truth)))
    return verdict(outcome, detections, scene, int(outcome.duplicates.sum()))


def _makes_landmarks(found: Map) -> bool:
    """Whether a map has point landmarks; or has nothing at all, and so may have missed them."""
    other = len(found.landmarks) + len(found.segments_m) + len(found.points_m) + (found.grid is not None)
    return len(found.landmarks.of("point")) > 0 or not other


def _outcome(
    scene: Scene, surface: Surface, points_m: FloatArray, landmarks_m: FloatArray, *, asked: bool
) -> MapOutcome:
    """What a map that was moved into the frame of the truth has in common with it."""
    facts = counted(scene, 1) | {"duplicates": np.zeros(1, np.int64)}
    if asked:
        facts |= _landmarks(scene, surface, landmarks_m)
    own, true = cells(points_m), cells(surface.points_m)
    shared = len(np.intersect1d(own, true, assume_unique=True))
    return MapOutcome(
        **facts,
        shared_cells=np.array([shared]),
        covered_cells=np.array([len(own) + len(true) - shared]),
        map_frame=np.zeros(len(points_m), np.int64),
        map_m=distances(points_m, surface.points_m),
        true_frame=np.zeros(len(surface.points_m), np.int64),
        true_m=distances(surface.points_m, points_m),
    )


def _landmarks(scene: Scene, surface: Surface, landmarks_m: FloatArray) -> dict[str, NDArray[Any]]:
    """Counts and errors of landmarks (n, 2)."""
    still = [place for place, item in enumerate(scene.truth.objects) if not item.structure and not item.moves]
    there = np.isin(still, surface.owner)
    error_m = np.full((len(landmarks_m), len(still)), np.nan)
    for column, place in enumerate(still):
        outline_m = np.asarray(scene.truth.objects[place].outline_m, float)[:, :2]
        error_m[:, column] = np.hypot(*(nearest_on_outline(landmarks_m, outline_m) - landmarks_m).T)
    rows, columns = match(np.where(there, error_m, np.nan), GATE_M)
    matched, found = np.zeros(len(landmarks_m), bool), np.zeros(len(still), bool)
    matched[rows], found[columns] = True, True
    own_m = np.full(len(landmarks_m), np.nan)
    own_m[rows] = error_m[rows, columns]
    near = error_m <= GATE_M
    duplicate = ~matched & (near & found).any(axis=1)
    aside = ~matched & ~(near & there).any(axis=1) & near.any(axis=1)
    false = int((~matched & ~aside).sum()) if scene.truth.exhaustive else 0
    return {
        "tp": np.array([len(rows)]),
        "fp": np.array([false]),
        "fn": np.array([int(there.sum()) - len(rows)]),
        "error_frame": np.zeros(len(landmarks_m), np.int64),
        "error_m": own_m,
        "matched": matched,
        "duplicates": np.array([int(duplicate.sum())]),
    }
