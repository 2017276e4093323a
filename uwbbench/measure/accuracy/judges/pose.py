"""Judge of poses: the scoring ``pose``, of a mapper on a run.

Conventions
-----------
* The filtering table is of the poses as they were handed out on the way, the mapping table of the smoothed trajectory,
  where the mapper has one. Each pose is held against the true one of its step; steps without a pose are counted
  (``unprocessed``), no more.
* Two motions put the estimate into the frame of the truth (:mod:`uwbbench.measure.accuracy.trajectories`): the best one
  for all positions, and the one that puts the first pose on its true one. Errors against the second grow from the start
  on, as a robot that drives by its poses feels them; a map may be used in either.
* The normalised squared error is that with the start fixed, as the covariance is that of a filter that knows it.
* Gate and region play no part.
"""

from __future__ import annotations

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.detections import Detections
from uwbbench.api.geometry import wrap_angle
from uwbbench.api.mapper import Poses
from uwbbench.api.outcomes import PoseOutcome
from uwbbench.config.rules import Table
from uwbbench.measure.accuracy.judges.run import counted, trajectory_of, verdict
from uwbbench.measure.accuracy.rules import ScoringRules
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.trajectories import (
    aligned,
    nearest_errors,
    pairs,
    relative_errors,
    squared_errors,
    start_fixed,
)
from uwbbench.measure.accuracy.verdict import Verdict


def judge_pose(detections: Detections, scene: Scene, rules: ScoringRules, table: Table) -> Verdict:  # noqa: ARG001
    """Judge the poses of a run; errors are those of the function that asks this judge.

    Parameters
    ----------
    detections, scene, rules, table
        As :func:`~uwbbench.measure.accuracy.judge.judge` has them; the detections with what a mapper made of them.
    """
    assert detections.mapped is not None  # noqa: S101 - the function that asks has made sure
    poses, truth = trajectory_of(detections.mapped, scene, table)
    best, start = aligned(poses.pose, truth), start_fixed(poses.pose, truth)
    by_best, by_start = best.of_poses(poses.pose), start.of_poses(poses.pose)
    first, second = pairs(truth)
    moved_m, turned_rad = relative_errors(poses.pose, truth, first, second)
    track = scene.header.trajectory
    outcome = PoseOutcome(
        **counted(scene, len(poses)),
        step=poses.index,
        aligned_m=np.hypot(*(by_best - truth)[:, :2].T),
        start_m=np.hypot(*(by_start - truth)[:, :2].T),
        heading_rad=wrap_angle(by_best[:, 2] - truth[:, 2]),
        nees=_nees(poses, truth),
        nearest_m=nearest_errors(by_start[:, :2], track.position_m[:, :2]),
        pair_frame=first,
        moved_m=moved_m,
        turned_rad=turned_rad,
    )
    return verdict(outcome, detections, scene)


def _nees(poses: Poses, truth: FloatArray) -> FloatArray:
    """Normalised squared error (n,) of each pose, in the frame that the mapper works in."""
    if poses.covariance is None:
        return np.full(len(poses), np.nan)
    return squared_errors(poses.pose, start_fixed(truth, poses.pose).of_poses(truth), poses.covariance)
