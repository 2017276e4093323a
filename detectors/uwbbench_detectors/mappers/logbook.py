"""A filter that keeps what it was given, so that a smoother can look at the whole run again."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from uwbbench.api import FloatArray, IntArray, Poses, wrap_angle
from uwbbench_detectors.mappers.ekf import Ekf, Model
from uwbbench_detectors.mappers.motion import Motion, MotionParams
from uwbbench_detectors.mappers.smoothing import Problem, Sightings, Solution

LEAST_VARIANCE = 1e-10
"""Of a movement: that of a robot that stands still has none, which no factor can have."""

LONGEST_M, LONGEST_RAD = 0.5, 0.5
"""A leg that is longer than this, or turns more, ends in a node though nothing was seen there."""


class Leg:
    """Odometry since a pose, with what scale errors and noise do to it.

    Attributes
    ----------
    moved : (3,) array
        In the frame of that pose.
    by_scales : (3, 2) array
        Its derivatives by the scale errors.
    noise : (3, 3) array
        Its covariance without them.
    way_m, turn_rad : float
        How far it went and turned, whichever way.
    """

    def __init__(self) -> None:
        self.moved, self.by_scales, self.noise = np.zeros(3), np.zeros((3, 2)), np.zeros((3, 3))
        self.way_m = self.turn_rad = 0.0

    def add(self, motion: Motion, moved: FloatArray) -> None:
        """Go on by a step (3,) of odometry."""
        self.moved, by_head, noise = motion.predicted(np.append(self.moved, [0.0, 0.0]), moved)
        by_pose = by_head[:, :3]
        self.by_scales = by_pose @ self.by_scales + by_head[:, 3:]
        self.noise = by_pose @ self.noise @ by_pose.T + noise
        self.way_m += math.hypot(moved[0], moved[1])
        self.turn_rad += abs(float(moved[2]))


class Logbook(Ekf):
    """The filter, with a log of its odometry and of which landmark was seen when; memory grows with the run.

    Steps in which a landmark is seen, the first and the last, and some between those that are far apart are *nodes*:
    poses that a graph asks for. The others hang on the node before them.

    Parameters
    ----------
    pose : (3,) array
        Where the run starts.
    motion : MotionParams
    """

    def __init__(self, pose: FloatArray, motion: MotionParams) -> None:
        super().__init__(pose, motion)
        self._index: int | None = None
        self._leg = Leg()
        self._nodes: list[FloatArray] = []
        self._legs: list[Leg] = []
        self._steps: list[tuple[int, int, FloatArray, FloatArray]] = []
        self._sightings: list[tuple[int, int, FloatArray, FloatArray]] = []
        self._merged: dict[int, int] = {}

    def begin_step(self, index: int) -> None:
        """Close the step before and begin the next one, of this number."""
        self._end_step()
        self._index = index

    def predict(self, moved: FloatArray) -> None:
        """As the filter does, and log it."""
        super().predict(moved)
        self._leg.add(self.motion, moved)

    def doubt(self, covariance: FloatArray) -> None:
        """As the filter does, and log it."""
        super().doubt(covariance)
        self._leg.noise = self._leg.noise + covariance

    def update(self, model: Model, handle: int, measured: FloatArray, noise: FloatArray, **how: Any) -> float:
        """As the filter does, and log it.

        Parameters
        ----------
        model : Model
        handle : int
        measured : (k,) array
        noise : (k, k) array
        **how
            As of the filter.
        """
        self._log(handle, measured, noise)
        return super().update(model, handle, measured, noise, **how)

    def add(self, model: Model, measured: FloatArray, noise: FloatArray, number: int | None = None) -> int:
        """As the filter does, and log it.

        Parameters
        ----------
        model, measured, noise, number
            As of the filter.
        """
        handle = super().add(model, measured, noise, number)
        self._log(handle, measured, noise)
        return handle

    def merge(self, kept: int, dropped: int, noise: FloatArray) -> None:
        """As the filter does, and log it.

        Parameters
        ----------
        kept, dropped : int
            Handles.
        noise : (2, 2) array
            Which the graph leaves out: there the two are one.
        """
        super().merge(kept, dropped, noise)
        self._merged[dropped] = kept

    def close(self, handles: IntArray, places_m: FloatArray, huber: float) -> Problem:
        """End the run and ask for its poses, and the places of some landmarks.

        Parameters
        ----------
        handles : (k,) int array
            Of the landmarks; sightings of others are left out.
        places_m : (k, 2) array
            Where the filter has them.
        huber : float
            As of a :class:`~uwbbench_detectors.mappers.smoothing.Problem`.
        """
        self._end_step(last=True)
        number = {handle: place for place, handle in enumerate(handles.tolist())}
        rows = [(node, self._kept(handle), *how) for node, handle, *how in self._sightings]
        rows = [(node, number[handle], *how) for node, handle, *how in rows if handle in number]
        return Problem(
            poses=np.array(self._nodes),
            landmarks=places_m,
            moved=np.array([leg.moved for leg in self._legs]).reshape(-1, 3),
            by_scales=np.array([leg.by_scales for leg in self._legs]).reshape(-1, 3, 2),
            noise=np.array([leg.noise + LEAST_VARIANCE * np.eye(3) for leg in self._legs]).reshape(-1, 3, 3),
            scale_sd=np.sqrt(self.motion.start_variance[3:] + LEAST_VARIANCE),
            sightings=Sightings(
                np.array([row[0] for row in rows], np.int64),
                np.array([row[1] for row in rows], np.int64),
                np.array([row[2] for row in rows]).reshape(-1, 2),
                np.array([row[3] for row in rows]).reshape(-1, 2),
            ),
            huber=huber,
        )

    def trajectory(self, solution: Solution) -> Poses:
        """Poses of all steps, those between two nodes along odometry.

        Scale errors are those of the solution; what is then left at the next node is spread evenly over the steps, and
        the covariance goes over from one node to the next.

        Parameters
        ----------
        solution : Solution
            Of the problem.
        """
        index = np.array([step[0] for step in self._steps])
        node = np.array([step[1] for step in self._steps])
        moved = (
            np.array([step[2] for step in self._steps]) + np.array([step[3] for step in self._steps]) @ solution.scales
        )
        poses = _after(solution.poses[node], moved)
        at = np.flatnonzero(np.diff(node, prepend=-1))
        following = np.minimum(node + 1, len(at) - 1)
        share = (np.arange(len(node)) - at[node]) / np.maximum(at[following] - at[node], 1)
        if self._legs:
            ends = np.array([leg.moved + leg.by_scales @ solution.scales for leg in self._legs])
            left = solution.poses[1:] - _after(solution.poses[:-1], ends)
            left[:, 2] = wrap_angle(left[:, 2])
            poses += share[:, None] * np.append(left, np.zeros((1, 3)), axis=0)[node]
        poses[:, 2] = wrap_angle(poses[:, 2])
        covariance = solution.covariance
        between = share[:, None, None]
        return Poses(index, poses, (1 - between) * covariance[node] + between * covariance[following])

    def _end_step(self, *, last: bool = False) -> None:
        if self._index is None:
            return
        seen = bool(self._sightings) and self._sightings[-1][0] == len(self._nodes)
        long = self._leg.way_m > LONGEST_M or self._leg.turn_rad > LONGEST_RAD
        if seen or long or last or not self._nodes:
            if self._nodes:
                self._legs.append(self._leg)
            self._nodes.append(self.pose)
            self._leg = Leg()
        self._steps.append((self._index, len(self._nodes) - 1, self._leg.moved, self._leg.by_scales))
        self._index = None

    def _log(self, handle: int, measured: FloatArray, noise: FloatArray) -> None:
        self._sightings.append((len(self._nodes), handle, measured, np.sqrt(np.diag(noise))))

    def _kept(self, handle: int) -> int:
        """What a landmark was merged into in the end."""
        while handle in self._merged:
            handle = self._merged[handle]
        return handle


def _after(poses: FloatArray, moved: FloatArray) -> FloatArray:
    """Poses (n, 3) after movements (n, 3) in their own frames; angles not wrapped."""
    cosine, sine = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    forward, leftward, turned = moved.T
    ahead = np.column_stack([cosine * forward - sine * leftward, sine * forward + cosine * leftward, turned])
    return np.asarray(poses + ahead)
