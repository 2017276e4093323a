"""Trajectories in the plane against the true one: how they are laid over each other, and what is left.

Conventions
-----------
* Poses are rows x, y, yaw, in metres and radians; row i of both trajectories is of the same moment.
* A *motion* turns and shifts the plane, and does not scale it. Two put an estimate into the frame of the truth: the one
  that fits all positions best, and the one that puts the first pose on its true one.
* Alignment is that of Umeyama (IEEE TPAMI 13(4), 1991) and Horn without scale, in the plane, where it has a closed form
  and never mirrors. Programs that align planar trajectories in space may turn the plane over, and fail on a line.
* Relative errors are those of Sturm et al. (IROS 2012): ``(inverse(T_i) T_j)^-1 (inverse(E_i) E_j)`` for pairs that are
  as far apart as asked for in *true* travel, so that drifting odometry does not choose its own pairs.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uwbbench.api.arrays import FloatArray, IntArray
from uwbbench.api.drive import relative
from uwbbench.api.geometry import wrap_angle

TRAVEL_M = 1.0
"""True travel between the two poses of a pair."""

TOLERANCE = 0.1
"""Share by which the travel of a pair may be longer or shorter."""

MOST_ITERATIONS = 30
"""Of the alignment by nearest points; as many as Open3D's default."""

CONFIDENCE = 0.95


class Motion(NamedTuple):
    """A turn about the origin, then a shift.

    Parameters
    ----------
    turn_rad : float
    shift_m : (2,) array
    """

    turn_rad: float
    shift_m: FloatArray

    @property
    def matrix(self) -> FloatArray:
        """Of the turn (2, 2)."""
        cosine, sine = math.cos(self.turn_rad), math.sin(self.turn_rad)
        return np.array([[cosine, -sine], [sine, cosine]])

    def of_points(self, points_m: FloatArray) -> FloatArray:
        """Points (n, 2) moved."""
        return np.asarray(points_m @ self.matrix.T + self.shift_m)

    def of_poses(self, poses: FloatArray) -> FloatArray:
        """Poses (n, 3) moved."""
        return np.column_stack([self.of_points(poses[:, :2]), poses[:, 2] + self.turn_rad])


def start_fixed(estimate: FloatArray, truth: FloatArray) -> Motion:
    """Motion that puts the first pose on its true one.

    Parameters
    ----------
    estimate, truth : (n, 3) array
    """
    turn_rad = float(truth[0, 2] - estimate[0, 2])
    turned = Motion(turn_rad, np.zeros(2)).of_points(estimate[:1, :2])
    return Motion(turn_rad, truth[0, :2] - turned[0])


def aligned(estimate: FloatArray, truth: FloatArray) -> Motion:
    """Motion that leaves the smallest sum of squared distances between positions.

    Where all positions are one, no turn is better than another: it is that of the first pose.

    Parameters
    ----------
    estimate, truth : (n, 3) array
    """
    middle, true_middle = estimate[:, :2].mean(axis=0), truth[:, :2].mean(axis=0)
    own, true = estimate[:, :2] - middle, truth[:, :2] - true_middle
    along = float((own * true).sum())
    across = float((own[:, 0] * true[:, 1] - own[:, 1] * true[:, 0]).sum())
    least = 1e-12 * math.sqrt(float((own**2).sum()) * float((true**2).sum()))
    known = math.hypot(along, across) > least
    turn_rad = math.atan2(across, along) if known else float(truth[0, 2] - estimate[0, 2])
    turn = Motion(turn_rad, np.zeros(2))
    return Motion(turn_rad, true_middle - turn.of_points(middle[None])[0])


def pairs(truth: FloatArray, travel_m: float = TRAVEL_M, tolerance: float = TOLERANCE) -> tuple[IntArray, IntArray]:
    """First and second row (pairs,) of pairs of poses that are so far apart in true travel.

    Each pose is paired with the later one that is nearest to it in that; the first of equal ones.

    Parameters
    ----------
    truth : (n, 3) array
    travel_m : float
    tolerance : float
        Share by which it may be missed; a pose that none comes so near to is in no pair.
    """
    rows = len(truth)
    if rows < 2:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    travelled_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(truth[:, :2], axis=0).T))])
    first = np.arange(rows - 1)
    beyond = np.searchsorted(travelled_m, travelled_m[first] + travel_m)
    beyond = np.clip(beyond, first + 1, rows - 1)
    before = np.searchsorted(travelled_m, travelled_m[np.maximum(beyond - 1, 0)])  # the first that is as far
    before = np.clip(before, first + 1, rows - 1)
    off_m = [np.abs(travelled_m[place] - travelled_m[first] - travel_m) for place in (before, beyond)]
    second = np.where(off_m[0] <= off_m[1], before, beyond)
    kept = np.minimum(*off_m) <= tolerance * travel_m
    return first[kept].astype(np.int64), second[kept].astype(np.int64)


def relative_errors(
    estimate: FloatArray, truth: FloatArray, first: IntArray, second: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Error of the motion between the poses of pairs: distance (pairs,) and signed angle (pairs,).

    Parameters
    ----------
    estimate, truth : (n, 3) array
    first, second : (pairs,) int array
        Rows of the poses of each pair.
    """
    moves = [relative(poses[first], poses[second]) for poses in (truth, estimate)]
    error = relative(*moves)
    return np.hypot(error[:, 0], error[:, 1]), error[:, 2]


def squared_errors(estimate: FloatArray, truth: FloatArray, covariance: FloatArray) -> FloatArray:
    """Normalised estimation error squared ``e' P^-1 e`` of each pose (n,) (Bar-Shalom et al., 2001, section 5.4).

    Of a filter that knows its errors it is chi-square distributed with three degrees of freedom: 3 on average. NaN
    where the covariance is not positive definite, as that of the start, which is known.

    Parameters
    ----------
    estimate : (n, 3) array
    truth : (n, 3) array
        In the frame of the estimate.
    covariance : (n, 3, 3) array
    """
    error = estimate - truth
    error[:, 2] = wrap_angle(error[:, 2])
    found = np.full(len(error), np.nan)
    known = np.flatnonzero(np.isfinite(covariance).all(axis=(1, 2)))
    values = np.linalg.eigvalsh(covariance[known])
    known = known[values[:, 0] > 1e-12 * values[:, -1]]
    weighted = np.linalg.solve(covariance[known], error[known, :, None])[:, :, 0]
    found[known] = (error[known] * weighted).sum(axis=1)
    return found


def squared_error_band(runs: int = 1, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Band that the mean of so many normalised squared errors lies in, for a filter that knows its errors.

    Of one moment in each of several runs; the mean over a run as well scatters less.

    Parameters
    ----------
    runs : int
    confidence : float

    Examples
    --------
    >>> [tuple(round(end, 2) for end in squared_error_band(runs)) for runs in (1, 10)]
    [(0.22, 9.35), (1.68, 4.7)]
    """
    from scipy.special import gammaincinv

    low, high = (2 * float(gammaincinv(1.5 * runs, (1 + sign * confidence) / 2)) / runs for sign in (-1, 1))
    return low, high


def nearest_errors(positions_m: FloatArray, true_m: FloatArray) -> FloatArray:
    """Errors along x and y (n, 2) against *some* true position, as the published script of LP_SLAM takes them.

    Iterated closest points lay the positions over the true ones, without regard to when they were taken; what is left
    is measured to the true position that was nearest before that. Errors along the path are hardly seen.

    Parameters
    ----------
    positions_m, true_m : (n, 2) array
        Both in the frame of the truth, with the start fixed.
    """
    from scipy.spatial import cKDTree

    tree, moved_m = cKDTree(true_m), positions_m
    nearest = np.asarray(tree.query(positions_m)[1])
    partner, last = nearest, np.zeros(0, np.int64)
    for _ in range(MOST_ITERATIONS):
        if np.array_equal(partner, last):
            break
        motion = aligned(_level(positions_m), _level(true_m[partner]))
        moved_m, last = motion.of_points(positions_m), partner
        partner = np.asarray(tree.query(moved_m)[1])
    return np.asarray(moved_m - true_m[nearest])


def _level(points_m: FloatArray) -> FloatArray:
    """Points (n, 2) as poses without a heading."""
    return np.column_stack([points_m, np.zeros(len(points_m))])
