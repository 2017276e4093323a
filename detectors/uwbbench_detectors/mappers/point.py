"""Landmarks that are points: range and bearing from the robot."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from uwbbench.api import FloatArray, LandmarkKind, wrap_angle


class PointModel:
    """Range and bearing of points, both in the robot's frame.

    The bearing is the angle of ``atan2``, so that a point straight behind is as good as any; differences of bearings
    are wrapped.
    """

    kind: ClassVar[LandmarkKind] = "point"

    def expected(self, pose: FloatArray, marks: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Range and bearing (m, 2) of points (m, 2), and derivatives by pose (m, 2, 3) and point (m, 2, 2)."""
        from uwbbench_detectors.mappers.gaussian import sighted  # compiled

        return sighted(pose, marks)

    def differences(self, measured: FloatArray, expected: FloatArray) -> FloatArray:
        """Measured (2,) minus expected (m, 2), bearings wrapped."""
        off = measured - expected
        off[:, 1] = wrap_angle(off[:, 1])
        return np.asarray(off)

    def placed(self, pose: FloatArray, measured: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Point (2,) at a range and bearing, and its derivatives by the pose (2, 3) and by both (2, 2)."""
        heading = pose[2] + measured[1]
        ahead = np.array([math.cos(heading), math.sin(heading)])
        aside = np.array([-ahead[1], ahead[0]])
        offset = measured[0] * ahead
        by_pose = np.column_stack([np.eye(2), measured[0] * aside])
        return pose[:2] + offset, by_pose, np.column_stack([ahead, measured[0] * aside])
