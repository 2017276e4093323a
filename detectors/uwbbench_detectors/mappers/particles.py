"""Poses that a robot may have, each with its own idea of how wrong odometry is."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import FloatArray, IntArray, wrap_angle
from uwbbench_detectors.mappers.motion import Motion, MotionParams

MEMORY = 0.98
"""How much of its scale errors a particle keeps when it is drawn again."""


class Particles:
    """Weighted poses, moved by odometry with errors drawn for each.

    The scale errors of odometry are the same during a run, so each particle has its own from the start, and those that
    fit are drawn again. They are then moved a little towards their mean and spread anew, by the kernel that leaves mean
    and variance as they are: else all particles soon had the same.

    Parameters
    ----------
    count : int
    motion : MotionParams
    rng : Generator

    Attributes
    ----------
    pose : (3, count) array
        x, y and yaw, from the start pose.
    scale : (2, count) array
        By which share odometry is short of distances and of turns.
    log_weight : (count,) array

    References
    ----------
    Doucet, de Freitas, Murphy, Russell, Rao-Blackwellised particle filtering for dynamic Bayesian networks, UAI 2000;
    Liu and West, Combined parameter and state estimation in simulation-based filtering, in: Sequential Monte Carlo
    Methods in Practice, 2001, section 10.3 (scales); Kitagawa, Journal of Computational and Graphical Statistics 5(1),
    1996 (systematic resampling).
    """

    def __init__(self, count: int, motion: MotionParams, rng: np.random.Generator) -> None:
        self._motion, self._params, self._rng = Motion(motion), motion, rng
        self.pose = np.zeros((3, count))
        spread = np.array([[motion.distance_scale_sd], [motion.turn_scale_sd]])
        self.scale = spread * rng.standard_normal((2, count))
        self.log_weight = np.zeros(count)

    def move(self, moved: FloatArray, elapsed_s: float) -> bool:
        """Go on by a step (3,) of odometry; whether it was a jump, after which poses are spread as widely as it was."""
        forward, leftward, turned = moved.tolist()
        way = math.hypot(forward, leftward)
        if way == 0 and turned == 0:
            return False
        p = self._params
        jumped = self._motion.jumped(moved, elapsed_s)
        drawn = self._rng.standard_normal((3, self.pose.shape[1]))
        if jumped:
            self.pose += np.sqrt(np.diag(self._motion.doubt(moved)))[:, None] * drawn
        stretch = 1 + self.scale[0]
        ahead = (forward / way, leftward / way) if way else (1.0, 0.0)
        along, across = math.sqrt(way) * p.along_sd_m * drawn[0], math.sqrt(way) * p.across_sd_m * drawn[1]
        own_x = stretch * forward + ahead[0] * along - ahead[1] * across
        own_y = stretch * leftward + ahead[1] * along + ahead[0] * across
        cosine, sine = np.cos(self.pose[2]), np.sin(self.pose[2])
        heading_sd = math.hypot(
            math.radians(p.heading_sd_deg) * math.sqrt(way), math.radians(p.turn_sd_deg) * math.sqrt(abs(turned))
        )
        self.pose[0] += cosine * own_x - sine * own_y
        self.pose[1] += sine * own_x + cosine * own_y
        self.pose[2] += (1 + self.scale[1]) * turned + heading_sd * drawn[2]
        return jumped

    @property
    def weight(self) -> FloatArray:
        """Weights (count,), which add up to 1."""
        weight = np.exp(self.log_weight - self.log_weight.max())
        return np.asarray(weight / weight.sum())

    @property
    def best(self) -> int:
        """Particle of greatest weight."""
        return int(np.argmax(self.log_weight))

    def resample(self, weight: FloatArray) -> IntArray:
        """Draw particles anew by their weights (count,), evenly spaced; which ones (count,)."""
        count = len(weight)
        places = (self._rng.random() + np.arange(count)) / count
        chosen = np.minimum(np.searchsorted(np.cumsum(weight), places), count - 1)
        mean = self.scale @ weight
        spread = np.sqrt(((self.scale - mean[:, None]) ** 2) @ weight)
        kept = MEMORY * self.scale[:, chosen] + (1 - MEMORY) * mean[:, None]
        drawn = self._rng.standard_normal((2, count))
        self.pose = self.pose[:, chosen]
        self.scale = kept + math.sqrt(1 - MEMORY**2) * spread[:, None] * drawn
        self.log_weight = np.zeros(count)
        return chosen

    def estimate(self, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean (3,) and covariance (3, 3) of the poses under weights (count,)."""
        x, y, yaw = self.pose
        middle = math.atan2(float(np.sin(yaw) @ weight), float(np.cos(yaw) @ weight))
        off = np.stack([x, y, wrap_angle(yaw - middle)])
        mean = off @ weight
        off -= mean[:, None]
        mean[2] += middle
        return mean, (off * weight) @ off.T
