"""Landmarks that are straight lines: distance and direction of the normal from the robot.

A line is ``(rho, alpha)``: all points ``p`` with ``p . n(alpha) = rho``, where ``n(alpha) = (cos alpha, sin alpha)``.
``(-rho, alpha + pi)`` is the same line; where ``rho`` is positive the normal points from the origin to the line.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from uwbbench.api import FloatArray, LandmarkKind, wrap_angle


class LineModel:
    """Lines as a robot sees them: how far it is to the foot of its perpendicular, and in which direction that lies."""

    kind: ClassVar[LandmarkKind] = "line"

    def expected(self, pose: FloatArray, marks: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance and direction (m, 2) of lines (m, 2), and derivatives by pose (m, 2, 3) and line (m, 2, 2).

        ``rho' = rho - x cos alpha - y sin alpha`` and ``alpha' = alpha - yaw``. A robot that stands beyond the line, as
        seen from the origin, sees it the other way round: ``(-rho', alpha' + pi)``.
        """
        across = normal(marks[:, 1])
        beside = np.stack([-across[:, 1], across[:, 0]], axis=1)
        distance_m = marks[:, 0] - across @ pose[:2]
        beyond = distance_m < 0
        sign = np.where(beyond, -1.0, 1.0)
        measured = np.stack([sign * distance_m, wrap_angle(marks[:, 1] - pose[2] + np.pi * beyond)], axis=1)
        by_pose = np.zeros((len(marks), 2, 3))
        by_pose[:, 0, :2] = -sign[:, None] * across
        by_pose[:, 1, 2] = -1.0
        by_mark = np.zeros((len(marks), 2, 2))
        by_mark[:, 0, 0], by_mark[:, 0, 1] = sign, -sign * (beside @ pose[:2])
        by_mark[:, 1, 1] = 1.0
        return measured, by_pose, by_mark

    def differences(self, measured: FloatArray, expected: FloatArray) -> FloatArray:
        """Measured (2,) minus expected (m, 2), directions wrapped."""
        off = measured - expected
        off[:, 1] = wrap_angle(off[:, 1])
        return np.asarray(off)

    def placed(self, pose: FloatArray, measured: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Line (2,) at a distance and direction, and its derivatives by the pose (2, 3) and by both (2, 2).

        Its distance from the origin is negative where that lies beyond the line.
        """
        alpha_rad = float(wrap_angle(measured[1] + pose[2]))
        across = normal(alpha_rad)
        swing = across[0] * pose[1] - across[1] * pose[0]
        by_pose = np.array([[across[0], across[1], swing], [0.0, 0.0, 1.0]])
        by_measured = np.array([[1.0, swing], [0.0, 1.0]])
        return np.array([measured[0] + across @ pose[:2], alpha_rad]), by_pose, by_measured


def facing(line: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A line (2,) with its normal pointing towards it, and the signs (2,) that its two numbers change with."""
    if line[0] >= 0:
        return line, np.ones(2)
    return np.array([-line[0], float(wrap_angle(line[1] + np.pi))]), np.array([-1.0, 1.0])


def normal(alpha_rad: FloatArray | float) -> FloatArray:
    """Unit vectors (..., 2) in the directions (...)."""
    return np.stack([np.cos(alpha_rad), np.sin(alpha_rad)], axis=-1)


def along(line: FloatArray, points_m: FloatArray) -> FloatArray:
    """Places (n,) of points (n, 2) along a line (2,), from the foot of the origin, leftward as one looks at it."""
    return np.asarray(points_m @ np.array([-np.sin(line[1]), np.cos(line[1])]))


def piece(line: FloatArray, start_m: float, stop_m: float) -> FloatArray:
    """Ends (2, 2) of a piece of a line between two places along it, as :func:`along` counts them.

    Parameters
    ----------
    line : (2,) array
    start_m, stop_m : float
    """
    across = normal(line[1])
    places = np.array([[start_m], [stop_m]])
    return np.asarray(line[0] * across + places * np.array([-across[1], across[0]]))
