"""Echoes of a stretch of the way, and the walls and points that they may come from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uwbbench.api import BoolArray, FloatArray, wrap_angle
from uwbbench_detectors.mappers.line import along, normal

ROUNDS = 30
"""Most refits of a shape to the echoes that agree with it, and most steps of a fit."""


@dataclass(frozen=True)
class Spread:
    """How far ranges and directions are off: standard deviations, or bounds."""

    range_m: float
    heading_rad: float

    def squared(self, farther_m: FloatArray, leftward: FloatArray) -> FloatArray:
        """Sum of the squares of two deviations, each over its spread."""
        return np.asarray((farther_m / self.range_m) ** 2 + (leftward / self.heading_rad) ** 2)


@dataclass(frozen=True)
class Echoes:
    """Echoes in one frame of reference.

    Attributes
    ----------
    receiver_m : (n, 2) array
        Where the receiver was.
    range_m : (n,) array
    heading_rad : (n,) array
        Direction that the echo came from.
    """

    receiver_m: FloatArray
    range_m: FloatArray
    heading_rad: FloatArray

    def __len__(self) -> int:
        return len(self.range_m)

    @classmethod
    def none(cls) -> Echoes:
        """No echo."""
        return cls(np.zeros((0, 2)), np.zeros(0), np.zeros(0))

    @classmethod
    def join(cls, parts: list[Echoes]) -> Echoes:
        """Echoes of several parts."""
        if not parts:
            return cls.none()
        return cls(
            np.concatenate([part.receiver_m for part in parts]),
            np.concatenate([part.range_m for part in parts]),
            np.concatenate([part.heading_rad for part in parts]),
        )

    def take(self, rows: BoolArray) -> Echoes:
        """Some of the echoes."""
        return Echoes(self.receiver_m[rows], self.range_m[rows], self.heading_rad[rows])

    def seen_from(self, pose: FloatArray) -> Echoes:
        """The same echoes in the frame of a pose (3,)."""
        cosine, sine = np.cos(pose[2]), np.sin(pose[2])
        receiver_m = (self.receiver_m - pose[:2]) @ np.array([[cosine, -sine], [sine, cosine]])
        return Echoes(receiver_m, self.range_m, wrap_angle(self.heading_rad - pose[2]))

    @property
    def place_m(self) -> FloatArray:
        """Where each would come from if it came from a point (n, 2)."""
        return np.asarray(self.receiver_m + self.range_m[:, None] * normal(self.heading_rad))

    def off_line(self, line: FloatArray) -> tuple[FloatArray, FloatArray]:
        """By how much echoes are farther away, and from farther left, than those of a wall on a line would be.

        A smooth wall answers from the foot of the receiver's perpendicular: the range is its distance, the direction
        that of its normal.

        Parameters
        ----------
        line : (2,) array
            Distance from the origin and direction of the normal.

        Returns
        -------
        (n,) array, (n,) array
            In metres and radians.
        """
        distance_m = line[0] - self.receiver_m @ normal(line[1])
        return self.range_m - distance_m, wrap_angle(self.heading_rad - line[1])

    def off_point(self, point_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The same for those of a point (2,)."""
        offset = point_m - self.receiver_m
        heading_rad = np.arctan2(offset[:, 1], offset[:, 0])
        return self.range_m - np.hypot(offset[:, 0], offset[:, 1]), wrap_angle(self.heading_rad - heading_rad)


def fit_line(echoes: Echoes, spread: Spread, shared: Spread, start: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The line whose echoes these most likely are, by Gauss-Newton steps from a guess.

    Least sum of squares of ranges and directions, each over its standard deviation: both have errors of their own,
    which a fit to points would mix. At 4.6 m an error of 10 degrees moves a point by 80 cm along the wall, and by 7 cm
    off it, always towards the receiver.

    Parameters
    ----------
    echoes : Echoes
        At least one.
    spread : Spread
        Standard deviations of what each echo is off for itself.
    shared : Spread
        Standard deviations of what all are off alike, which no number of echoes takes away: what else stands near the
        wall turns and delays the echoes of a stretch in the same way.
    start : (2,) array
        Line to start from.

    Returns
    -------
    (2,) array, (2, 2) array
        Line, and the covariance of its two numbers: the inverse of ``J' R^-1 J``, with J the derivatives
        ``[[1, -s], [0, 1]]`` of range and direction, s the place of the receiver along the line.
    """
    line = np.array(start, dtype=np.float64)
    near = spread.range_m**-2
    turn = 1 / (spread.heading_rad**2 + len(echoes) * shared.heading_rad**2)
    precision = np.eye(2)
    for _ in range(ROUNDS):
        farther_m, leftward = echoes.off_line(line)
        swing = along(line, echoes.receiver_m)
        cross = -near * swing.sum()
        precision = np.array([[near * len(echoes), cross], [cross, near * (swing @ swing) + turn * len(echoes)]])
        pull = np.array([near * farther_m.sum(), turn * leftward.sum() - near * (swing @ farther_m)])
        step = np.linalg.solve(precision, pull)
        line = np.array([line[0] + step[0], float(wrap_angle(line[1] + step[1]))])
        if np.abs(step).max() < 1e-10:
            break
    covariance = np.asarray(np.linalg.inv(precision), np.float64)
    covariance[0, 0] += shared.range_m**2
    return line, covariance


def fit_point(echoes: Echoes, spread: Spread, start_m: FloatArray) -> FloatArray:
    """The point whose echoes these most likely are, by Gauss-Newton steps from a guess.

    Parameters
    ----------
    echoes : Echoes
        At least one.
    spread : Spread
        Standard deviations of one echo.
    start_m : (2,) array
    """
    point_m = np.array(start_m, dtype=np.float64)
    for _ in range(ROUNDS):
        offset = point_m - echoes.receiver_m
        reach_m = np.maximum(np.hypot(offset[:, 0], offset[:, 1]), 1e-3)
        farther_m, leftward = echoes.off_point(point_m)
        aside = np.stack([-offset[:, 1], offset[:, 0]], axis=1)
        by_point = np.concatenate(
            [offset / (reach_m * spread.range_m)[:, None], aside / (reach_m**2 * spread.heading_rad)[:, None]]
        )
        step = np.linalg.solve(
            by_point.T @ by_point,
            by_point.T @ np.concatenate([farther_m / spread.range_m, leftward / spread.heading_rad]),
        )
        point_m = point_m + step
        if np.abs(step).max() < 1e-6:
            break
    return point_m
