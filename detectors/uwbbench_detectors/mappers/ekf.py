"""An extended Kalman filter over a robot's pose, the scales of its odometry, and landmarks of several kinds.

The state is x, y, yaw, two scale errors, and two numbers for each landmark. What a landmark looks like from a pose says
a :class:`Model`, one for each kind.

A step costs what is near. Landmarks farther away than ``near_m`` rest: what a prediction or an update means to them is
gathered in three small matrices and carried out when the robot leaves its neighbourhood. The result is that of the
filter over everything, not an approximation (Guivant and Nebot, Optimization of the simultaneous localization and
map-building algorithm for real-time implementation, IEEE T-RA 17(3), 2001).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from uwbbench.api import LANDMARK_KINDS, FloatArray, IntArray, LandmarkKind, Landmarks, wrap_one_angle
from uwbbench_detectors.mappers.motion import HEAD, Motion, MotionParams
from uwbbench_detectors.mappers.rest import Rest, places_of

_laid = np.ascontiguousarray  # the inner loops are compiled for this layout alone


class Model(Protocol):
    """How landmarks of one kind are seen; ``k`` numbers are measured of each."""

    @property
    def kind(self) -> LandmarkKind:
        """Which kind."""

    def expected(self, pose: FloatArray, marks: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What would be measured of landmarks (m, 2) from a pose (3,).

        Returns
        -------
        (m, k) array, (m, k, 3) array, (m, k, 2) array
            And its derivatives by the pose and by the landmark.
        """

    def differences(self, measured: FloatArray, expected: FloatArray) -> FloatArray:
        """Measured (k,) minus expected (m, k), angles wrapped."""

    def placed(self, pose: FloatArray, measured: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Where a landmark stands of which this (k,) is measured from a pose (3,).

        Returns
        -------
        (2,) array, (2, 3) array, (2, k) array
            And its derivatives by the pose and by what is measured.
        """


@dataclass
class _Mark:
    """What is known of a landmark besides its place."""

    number: int
    kind: LandmarkKind
    support: int


class Ekf:
    """The filter.

    Landmarks are addressed by handles, which never return.

    Parameters
    ----------
    pose : (3,) array
        Where the run starts; certain, as everything is measured from there.
    motion : MotionParams
    near_m : float
        Landmarks within this distance of the robot take part in each update at once. Lines and anchors always do.
    reach_m : float
        How far the robot sees: the neighbourhood is left when the robot has moved by ``near_m - reach_m``.
    """

    def __init__(self, pose: FloatArray, motion: MotionParams, near_m: float = 8.0, reach_m: float = 5.0) -> None:
        from uwbbench_detectors.mappers import gaussian  # compiled

        self._gaussian = gaussian
        self.motion = Motion(motion)
        self._mean = np.concatenate([np.asarray(pose, np.float64), [0.0, 0.0]])
        self._covariance = np.diag(self.motion.start_variance)
        self._near: list[int] = []  # handles of the landmarks behind the head, in order
        self._starts: dict[int, int] = {}  # where each of them begins
        self._kinds: dict[LandmarkKind, tuple[list[int], IntArray]] = {}  # of those asked for since they changed
        self._marks: dict[int, _Mark] = {}
        self._next = 0
        self._near_m, self._leave_m = near_m, near_m - reach_m
        self._center_m = self._mean[:2].copy()
        self._rest = Rest()

    def __len__(self) -> int:
        return len(self._marks)

    @property
    def pose(self) -> FloatArray:
        """Pose (3,) as it is known now."""
        return self._mean[:3].copy()

    @property
    def pose_covariance(self) -> FloatArray:
        """Covariance (3, 3) of the pose."""
        return self._covariance[:3, :3].copy()

    @property
    def scales(self) -> FloatArray:
        """By which share odometry is short of distances and of turns (2,)."""
        return self._mean[3:HEAD].copy()

    def place(self, handle: int) -> FloatArray:
        """The two numbers (2,) of a landmark that is near."""
        start = self._at(handle)
        return self._mean[start : start + 2].copy()

    def support(self, handle: int) -> int:
        """Observations that a landmark is made of."""
        return self._marks[handle].support

    def near(self, kind: LandmarkKind) -> list[int]:
        """Handles of the landmarks of one kind that are near."""
        return list(self._near_of(kind)[0])

    def predict(self, moved: FloatArray) -> None:
        """Move by a step (3,) of odometry, in the robot's frame before it."""
        self._mean[:3], by_head, noise = self.motion.predicted(self._mean[:HEAD], moved)
        self._gaussian.move(self._covariance, by_head, noise)
        self._rest.predict(by_head)
        if math.dist(self._mean[:2], self._center_m) > self._leave_m:
            self._move_on()

    def doubt(self, covariance: FloatArray) -> None:
        """Add to the covariance (3, 3) of the pose, after something that the motion model does not know."""
        self._covariance[:3, :3] += covariance

    def expected(self, model: Model, handle: int) -> tuple[FloatArray, FloatArray]:
        """What would be measured of a near landmark now.

        Returns
        -------
        (k,) array, (k,) array
            And standard deviations, as far as pose and landmark are not known.
        """
        start = self._at(handle)
        measured, by_pose, by_mark = model.expected(self._mean[:3], self._mean[None, start : start + 2])
        rows = np.array([0, 1, 2, start, start + 1])
        by_both = np.concatenate([by_pose[0], by_mark[0]], axis=1)
        spread = by_both @ self._covariance[np.ix_(rows, rows)] @ by_both.T
        return measured[0], np.sqrt(np.diag(spread))

    def distances(
        self, model: Model, measured: FloatArray, noise: FloatArray, handles: list[int] | None = None
    ) -> tuple[list[int], FloatArray]:
        """How well near landmarks of the model's kind explain a measurement.

        Parameters
        ----------
        model : Model
        measured : (k,) array
        noise : (k, k) array
            Its covariance.
        handles : list of int, optional
            Of near landmarks; all of the kind by default.

        Returns
        -------
        list of int, (m,) array
            Handles, and squared Mahalanobis distances of the measurement from what is expected of each.
        """
        if handles is None:
            handles, starts = self._near_of(model.kind)
        else:
            starts = np.array([self._at(handle) for handle in handles], np.int64)
        if not handles:
            return [], np.zeros(0)
        marks = self._mean[starts[:, None] + np.arange(2)]
        expected, by_pose, by_mark = model.expected(self._mean[:3], marks)
        off = model.differences(measured, expected)
        return handles, self._gaussian.squared_distances(
            self._covariance, starts, _laid(by_pose), _laid(by_mark), _laid(off), _laid(noise)
        )

    def update(
        self, model: Model, handle: int, measured: FloatArray, noise: FloatArray, *, trusted: bool = True
    ) -> float:
        """Take in a measurement of a landmark that is known to be this one.

        Parameters
        ----------
        model : Model
        handle : int
        measured : (k,) array
        noise : (k, k) array
        trusted : bool
            Whether the measurement may move the robot and the other landmarks. If not, the landmark alone learns from
            it, and the covariance says so (Schmidt, Advances in Control Systems 3, 1966).

        Returns
        -------
        float
            Squared Mahalanobis distance of the measurement from what was expected: chi-square with k degrees of
            freedom in a filter that is right about itself.
        """
        start = self._at(handle)
        expected, by_pose, by_mark = model.expected(self._mean[:3], self._mean[None, start : start + 2])
        off = model.differences(measured, expected)[0]
        self._marks[handle].support += 1
        rows = np.array([0, 1, 2, start, start + 1])
        learning = None if trusted else (start, start + 2)
        return self._correct(rows, np.concatenate([by_pose[0], by_mark[0]], axis=1), off, noise, learning)

    def add(self, model: Model, measured: FloatArray, noise: FloatArray, number: int | None = None) -> int:
        """Begin a landmark where a measurement places it.

        Parameters
        ----------
        model : Model
        measured : (k,) array
        noise : (k, k) array
        number : int, optional
            By which the map calls it; its handle by default.

        Returns
        -------
        int
            Its handle.
        """
        mark, by_pose, by_measured = model.placed(self._mean[:3], measured)
        size = len(self._mean)
        grown = np.empty((size + 2, size + 2))
        grown[:size, :size] = self._covariance
        grown[size:, :size] = by_pose @ self._covariance[:3]
        grown[:size, size:] = grown[size:, :size].T
        grown[size:, size:] = by_pose @ self._covariance[:3, :3] @ by_pose.T + by_measured @ noise @ by_measured.T
        self._covariance = grown
        self._mean = np.concatenate([self._mean, mark])
        self._rest.add(by_pose)
        handle = self._next
        self._next += 1
        self._near.append(handle)
        self._starts[handle] = size
        self._kinds.pop(model.kind, None)
        self._marks[handle] = _Mark(handle if number is None else number, model.kind, 1)
        return handle

    def remove(self, handle: int) -> None:
        """Forget a landmark, but not what it has said of the others."""
        del self._marks[handle]
        if handle not in self._starts:
            return  # it rests, and goes when the others are brought up to date
        start = self._at(handle)
        rows = [start, start + 1]
        self._mean = np.delete(self._mean, rows)
        self._covariance = np.ascontiguousarray(np.delete(np.delete(self._covariance, rows, axis=0), rows, axis=1))
        self._rest.remove(rows)
        self._set_near([other for other in self._near if other != handle])

    def apart(self, one: int, other: int) -> float:
        """Squared Mahalanobis distance of two near landmarks of one kind from being at one place."""
        rows, difference, by_both = self._difference(one, other)
        known = self._covariance[np.ix_(rows, rows)]
        return float(difference @ np.linalg.solve(by_both @ known @ by_both.T, difference))

    def merge(self, kept: int, dropped: int, noise: FloatArray) -> None:
        """Take two near landmarks of one kind for the same one.

        Parameters
        ----------
        kept, dropped : int
            Handles.
        noise : (2, 2) array
            Covariance of how far two places of one landmark may be apart.
        """
        rows, difference, by_both = self._difference(kept, dropped)
        self._correct(rows, by_both, -difference, noise)
        self._marks[kept].support += self._marks[dropped].support
        self.remove(dropped)

    def landmarks(self, least_support: int = 1, handles: list[int] | None = None) -> Landmarks:
        """Landmarks, near or far, by their handles.

        Parameters
        ----------
        least_support : int
            Observations that each is made of, at least.
        handles : list of int, optional
            All by default.
        """
        self._settle()
        wanted = sorted(self._marks if handles is None else handles)
        kept = [handle for handle in wanted if self._marks[handle].support >= least_support]
        if not kept:
            return Landmarks.none()
        marks = [self._marks[handle] for handle in kept]
        starts = np.array([self._rest.at(handle) for handle in kept])
        places = self._rest.mean[starts[:, None] + np.arange(2)]
        rows = starts[:, None] + np.arange(2)
        return Landmarks(
            identity=np.array([mark.number for mark in marks]),
            kind=np.array([LANDMARK_KINDS.index(mark.kind) for mark in marks]),
            a=places[:, 0],
            b=places[:, 1],
            covariance=self._rest.covariance[rows[:, :, None], rows[:, None, :]],
            support=np.array([mark.support for mark in marks]),
        )

    def _at(self, handle: int) -> int:
        """First of the two places of a near landmark in the near state."""
        return self._starts[handle]

    def _near_of(self, kind: LandmarkKind) -> tuple[list[int], IntArray]:
        """Handles of the near landmarks of a kind, and where they begin in the near state; not to be changed."""
        if kind not in self._kinds:
            handles = [handle for handle in self._near if self._marks[handle].kind == kind]
            self._kinds[kind] = handles, np.array([self._starts[handle] for handle in handles], np.int64)
        return self._kinds[kind]

    def _set_near(self, handles: list[int]) -> None:
        self._near = handles
        self._kinds = {}
        self._starts = {handle: HEAD + 2 * place for place, handle in enumerate(handles)}

    def _difference(self, one: int, other: int) -> tuple[IntArray, FloatArray, FloatArray]:
        """Places (4,) of two landmarks, their difference (2,), and its derivative (2, 4)."""
        first, second = self._at(one), self._at(other)
        rows = np.array([first, first + 1, second, second + 1])
        difference = self._mean[first : first + 2] - self._mean[second : second + 2]
        if self._marks[one].kind == "line":
            difference[1] = wrap_one_angle(difference[1])
        return rows, difference, np.hstack([np.eye(2), -np.eye(2)])

    def _correct(
        self,
        rows: IntArray,
        seen: FloatArray,
        off: FloatArray,
        noise: FloatArray,
        learning: tuple[int, int] | None = None,
    ) -> float:
        """Update with what depends on a few values of the near state alone.

        Parameters
        ----------
        rows : (r,) int array
            Places of these values.
        seen : (k, r) array
            Derivative H by them.
        off : (k,) array
            Innovation.
        noise : (k, k) array
            Covariance R.
        learning : int and int, optional
            First place of the near state that is corrected, and the one behind the last; everything if left out.

        Returns
        -------
        float
            Squared Mahalanobis distance of the innovation.
        """
        everything = 0, len(self._mean)
        weight, gain = self._gaussian.correct(
            self._mean, self._covariance, rows, _laid(seen), _laid(off), _laid(noise), learning or everything
        )
        self._mean[2] = wrap_one_angle(self._mean[2])
        self._rest.correct(seen, weight if learning is None else None, off, gain.T, rows)
        return float(off @ weight @ off)

    def _settle(self) -> None:
        """Bring the landmarks that rest up to date."""
        self._rest.settle(self._mean, self._covariance, self._near, set(self._marks))

    def _move_on(self) -> None:
        """Choose anew which landmarks are near."""
        self._settle()
        rest = self._rest
        self._center_m = self._mean[:2].copy()
        places = rest.mean[HEAD:].reshape(-1, 2)
        near = np.hypot(*(places - self._center_m).T) <= self._near_m
        always = np.array([self._marks[handle].kind != "point" for handle in rest.handles], bool)
        chosen = near | always
        self._set_near([rest.handles[place] for place in np.flatnonzero(chosen)])
        resting = [rest.handles[place] for place in np.flatnonzero(~chosen)]
        columns = places_of(rest.handles, self._near)
        rest.enter(columns, resting)
        self._mean = rest.mean[columns]
        self._covariance = np.ascontiguousarray(rest.covariance[np.ix_(columns, columns)])
