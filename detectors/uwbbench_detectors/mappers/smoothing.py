"""Poses and landmarks of a whole run by least squares on a factor graph; gtsam is imported here alone."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from uwbbench.api import BoolArray, ConfigError, FloatArray, IntArray

START_SD = 1e-6
"""Standard deviation of the first pose, in metres and radians: the map is in its frame, but no variance may be zero."""


@dataclass(frozen=True)
class Sightings:
    """Landmarks as they were seen, one row a sighting.

    Attributes
    ----------
    node, landmark : (n,) int array
        From which pose which landmark was seen.
    measured : (n, 2) array
        Range in metres and bearing in radians, from the robot's origin and its forward direction.
    sd : (n, 2) array
        Standard deviations of both.
    """

    node: IntArray
    landmark: IntArray
    measured: FloatArray
    sd: FloatArray


@dataclass(frozen=True)
class Problem:
    """What is known of a run, and a first guess of what is asked for.

    Attributes
    ----------
    poses : (n, 3) array
        Guess; the first is where the map begins, and exact.
    landmarks : (k, 2) array
        Guess of the places of landmarks.
    moved : (n - 1, 3) array
        Odometry between a pose and the next, in the frame of the earlier one.
    by_scales : (n - 1, 3, 2) array
        Its derivatives by the scale errors of distance and of turns.
    noise : (n - 1, 3, 3) array
        Its covariance without what the scales cause.
    scale_sd : (2,) array
        Standard deviations of the scale errors of distance and of turns, each one number a run.
    sightings : Sightings
    huber : float
        Sightings count with their square up to so many standard deviations, beyond that in proportion.
    """

    poses: FloatArray
    landmarks: FloatArray
    moved: FloatArray
    by_scales: FloatArray
    noise: FloatArray
    scale_sd: FloatArray
    sightings: Sightings
    huber: float


@dataclass(frozen=True)
class Solution:
    """The most probable poses and landmarks.

    Attributes
    ----------
    poses : (n, 3) array
    covariance : (n, 3, 3) array
        Of x, y and yaw.
    landmarks : (k, 2) array
    joint : (2 k, 2 k) array
        Covariance of all landmarks.
    scales : (2,) array
        Errors of distance and of turns: the true movement is one plus them times odometry's.
    """

    poses: FloatArray
    covariance: FloatArray
    landmarks: FloatArray
    joint: FloatArray
    scales: FloatArray


def load_gtsam() -> Any:
    """The library.

    Raises
    ------
    ConfigError
        If it is not installed.
    """
    try:
        import gtsam
    except ImportError:
        raise ConfigError(
            "slam.graph smooths with gtsam, which is not installed: pip install 'uwbbench[slam]'"
        ) from None
    return gtsam


def smooth(problem: Problem) -> Solution:
    """Solve by Levenberg-Marquardt, with the covariances of the linearised problem (Dellaert and Kaess 2017).

    A motion factor is pose j as seen from pose i, minus odometry and what the two scale errors add to it, which are
    unknowns as well. Sightings are range and bearing with Huber's loss.

    Parameters
    ----------
    problem : Problem

    Raises
    ------
    ConfigError
        If gtsam is not installed.
    """
    gtsam = load_gtsam()
    pose, landmark = gtsam.symbol_shorthand.X, gtsam.symbol_shorthand.L
    scales = gtsam.symbol_shorthand.S(0)
    graph, guess = gtsam.NonlinearFactorGraph(), gtsam.Values()
    sigmas = gtsam.noiseModel.Diagonal.Sigmas
    graph.add(gtsam.PriorFactorPose2(pose(0), gtsam.Pose2(*problem.poses[0]), sigmas(np.full(3, START_SD))))
    graph.add(gtsam.PriorFactorVector(scales, np.zeros(2), sigmas(problem.scale_sd)))
    guess.insert(scales, np.zeros(2))
    for node, place in enumerate(problem.poses):
        guess.insert(pose(node), gtsam.Pose2(*place))
    for number, position_m in enumerate(problem.landmarks):
        guess.insert(landmark(number), position_m)
    for node, step in enumerate(zip(problem.moved, problem.by_scales, problem.noise, strict=True)):
        graph.add(_motion(gtsam, (pose(node), pose(node + 1), scales), *step))
    loss = gtsam.noiseModel.mEstimator.Huber.Create(problem.huber)
    seen = problem.sightings
    for node, number, measured, sd in zip(
        seen.node.tolist(), seen.landmark.tolist(), seen.measured, seen.sd, strict=True
    ):
        noise = gtsam.noiseModel.Robust.Create(loss, sigmas(sd[::-1]))  # gtsam has the bearing first
        bearing = gtsam.Rot2(measured[1])
        graph.add(gtsam.BearingRangeFactor2D(pose(node), landmark(number), bearing, measured[0], noise))
    values = gtsam.LevenbergMarquardtOptimizer(graph, guess).optimize()
    marginals = gtsam.Marginals(graph, values)
    found = [values.atPose2(pose(node)) for node in range(len(problem.poses))]
    poses = np.array([(place.x(), place.y(), place.theta()) for place in found])
    own = np.array([marginals.marginalCovariance(pose(node)) for node in range(len(found))])
    turn = np.zeros((len(found), 3, 3))
    turn[:, :2, :2] = [place.rotation().matrix() for place in found]  # gtsam's errors are in the frame of the pose
    turn[:, 2, 2] = 1.0
    count = len(problem.landmarks)
    joint = np.zeros((0, 0))
    if count:
        joint = marginals.jointMarginalCovariance([landmark(number) for number in range(count)]).fullMatrix()
    places = np.array([values.atPoint2(landmark(number)) for number in range(count)]).reshape(-1, 2)
    return Solution(poses, turn @ own @ turn.transpose(0, 2, 1), places, joint, values.atVector(scales))


def _motion(gtsam: Any, keys: tuple[int, int, int], moved: FloatArray, by_scales: FloatArray, noise: FloatArray) -> Any:
    """Factor between two poses and the scale errors, whose ``keys`` these are."""
    first, second, scales = keys

    def error(_: Any, values: Any, jacobians: Any) -> FloatArray:
        step = values.atPose2(first).between(values.atPose2(second))
        seen = np.array([step.x(), step.y(), step.theta()])
        residual = seen - moved - by_scales @ values.atVector(scales)
        residual[2] = np.remainder(residual[2] + np.pi, 2 * np.pi) - np.pi
        if jacobians is not None:
            jacobians[0] = np.array([[-1.0, 0.0, seen[1]], [0.0, -1.0, -seen[0]], [0.0, 0.0, -1.0]])
            jacobians[1] = np.eye(3)
            jacobians[1][:2, :2] = step.rotation().matrix()
            jacobians[2] = -by_scales
        return np.asarray(residual)

    return gtsam.CustomFactor(gtsam.noiseModel.Gaussian.Covariance(noise), list(keys), error)


def close_loops(problem: Problem, gate: float) -> tuple[Solution, IntArray]:
    """Smooth, take landmarks for one that lie within the gate of each other, and smooth again, until none do.

    Two landmarks are one if each is the nearest of the other by their squared distance in standard deviations, of the
    joint marginal, and that is within the gate. Those that were seen from one pose are two.

    Parameters
    ----------
    problem : Problem
    gate : float
        Of the chi-square distribution with two degrees of freedom.

    Returns
    -------
    Solution
        With the landmarks that are left.
    (k,) int array
        Which of them each landmark of the problem is.
    """
    became = np.arange(len(problem.landmarks))
    while True:
        solution = smooth(problem)
        seen = problem.sightings
        name = _merged(solution, _together(seen, len(problem.landmarks)), gate)
        kept, number = np.unique(name, return_inverse=True)
        if len(kept) == len(name):
            return solution, became
        became = number[became]
        problem = replace(
            problem,
            poses=np.concatenate([problem.poses[:1], solution.poses[1:]]),
            landmarks=solution.landmarks[kept],
            sightings=replace(seen, landmark=number[seen.landmark]),
        )


def _together(seen: Sightings, count: int) -> BoolArray:
    """Whether two landmarks (count, count) were seen from one pose."""
    visible = np.zeros((int(seen.node.max(initial=-1)) + 1, count), np.float64)
    visible[seen.node, seen.landmark] = 1.0
    return visible.T @ visible > 0


def _merged(solution: Solution, apart: BoolArray, gate: float) -> IntArray:
    """Of each landmark the one that it is taken for: itself, or an earlier one."""
    count = len(solution.landmarks)
    name = np.arange(count)
    if count < 2:
        return name
    between = solution.landmarks[:, None] - solution.landmarks
    blocks = solution.joint.reshape(count, 2, count, 2).transpose(0, 2, 1, 3)
    own = blocks[name, name]
    covariance = own[:, None] + own[None] - blocks - blocks.transpose(0, 1, 3, 2)
    covariance[name, name] = np.eye(2)
    distance = np.einsum("ijk,ijk->ij", between, np.linalg.solve(covariance, between[..., None])[..., 0])
    distance[apart | np.eye(count, dtype=np.bool_)] = np.inf
    nearest = distance.argmin(axis=1)
    mutual = (nearest[nearest] == name) & (distance[name, nearest] < gate)
    return np.where(mutual, np.minimum(name, nearest), name)
