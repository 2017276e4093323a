"""Landmarks that are anchors: range and azimuth from one receiver of the robot, or one of the two."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from uwbbench.api import FloatArray, LandmarkKind, compose, wrap_angle
from uwbbench_detectors.mappers.point import PointModel

RANGE, AZIMUTH = 0, 1
"""Places of what a message may say."""

CLOSEST_M = 1e-3
"""An anchor set down nearer to the receiver than this is taken to be here: at distance zero it has no direction."""


class AnchorModel:
    """Range and azimuth of anchors from the boresight of a receiver.

    Parameters
    ----------
    mount : (3,) array
        Place and heading of the receiver in the robot's frame.
    said : tuple of int
        What a message says: ``RANGE``, ``AZIMUTH`` or both, in this order.
    bias_m : float
        By how much ranges are too long.
    """

    kind: ClassVar[LandmarkKind] = "anchor"

    def __init__(self, mount: FloatArray, said: tuple[int, ...], bias_m: float) -> None:
        self._mount, self._said, self._bias_m = mount, list(said), bias_m
        self._angles = [one == AZIMUTH for one in said]
        self._point = PointModel()

    def expected(self, pose: FloatArray, marks: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What is said (m, k) of anchors (m, 2), and derivatives by robot pose (m, k, 3) and anchor (m, k, 2)."""
        receiver, by_robot = self._receiver(pose)
        measured, by_receiver, by_mark = self._point.expected(receiver, marks)
        measured[:, RANGE] += self._bias_m
        return measured[:, self._said], (by_receiver @ by_robot)[:, self._said], by_mark[:, self._said]

    def differences(self, measured: FloatArray, expected: FloatArray) -> FloatArray:
        """Measured (k,) minus expected (m, k), azimuths wrapped."""
        off = measured - expected
        off[:, self._angles] = wrap_angle(off[:, self._angles])
        return np.asarray(off)

    def placed(self, pose: FloatArray, measured: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Anchor (2,) set down at a true range and azimuth, and its derivatives by pose (2, 3) and both (2, 2)."""
        receiver, by_robot = self._receiver(pose)
        place, by_receiver, by_measured = self._point.placed(receiver, measured)
        return place, by_receiver @ by_robot, by_measured

    def _receiver(self, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pose (3,) of the receiver, and its derivative (3, 3) by that of the robot."""
        receiver = compose(pose, self._mount)
        lever = receiver[:2] - pose[:2]
        by_robot = np.eye(3)
        by_robot[0, 2], by_robot[1, 2] = -lever[1], lever[0]
        return receiver, by_robot
