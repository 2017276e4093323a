"""How a robot moves between two steps, as its odometry says, and how far that is to be believed."""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from uwbbench.api import FloatArray, Params, wrap_one_angle

HEAD = 5
"""Leading values of a state: x, y, yaw, and by how much odometry is short of distances and of turns."""


class MotionParams(Params):
    """Errors of odometry: what changes from metre to metre, and what is the same during a whole run."""

    along_sd_m: float = Field(0.005, ge=0, description="Standard deviation of the way along, after one metre.")
    across_sd_m: float = Field(0.005, ge=0, description="Standard deviation of the way across, after one metre.")
    heading_sd_deg: float = Field(1.0, ge=0, description="Standard deviation of the heading, after one metre.")
    turn_sd_deg: float = Field(0.5, ge=0, description="Standard deviation of the heading, after one radian turned.")
    distance_scale_sd: float = Field(
        0.03, ge=0, lt=1, description="Standard deviation of the scale of distances, the same during a run; estimated."
    )
    turn_scale_sd: float = Field(0.03, ge=0, lt=1, description="The same for turns.")
    fastest_m_s: float = Field(3.0, gt=0, description="Odometry that moves faster has jumped.")


class Motion:
    """Model of odometry whose scale errors are part of the state.

    A wheel whose radius is not what was assumed stretches every step of a run by the same share, and a wrong track
    width every turn. Noise that is drawn anew at each step cannot stand for them: their errors grow with the way, not
    with its square root, so that a filter without them believes itself too much. A robot that stands still, and
    whose odometry says so, loses nothing.

    Parameters
    ----------
    params : MotionParams
    """

    def __init__(self, params: MotionParams) -> None:
        self._params = params
        self._heading_var = math.radians(params.heading_sd_deg) ** 2
        self._turn_var = math.radians(params.turn_sd_deg) ** 2

    @property
    def start_variance(self) -> FloatArray:
        """Variances (5,) of the head of a state where a run starts: its pose is what everything is measured from."""
        p = self._params
        return np.array([0.0, 0.0, 0.0, p.distance_scale_sd**2, p.turn_scale_sd**2])

    def predicted(self, head: FloatArray, moved: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Pose after a step of odometry.

        Parameters
        ----------
        head : (5,) array
            Pose and scale errors before it.
        moved : (3,) array
            In the robot's frame before it.

        Returns
        -------
        pose : (3,) array
        by_head : (3, 5) array
            Derivative of the pose.
        noise : (3, 3) array
            Covariance that the step adds.
        """
        p = self._params
        forward, leftward, turned = float(moved[0]), float(moved[1]), float(moved[2])
        stretch, turn = 1 + float(head[3]), 1 + float(head[4])
        cosine, sine = math.cos(head[2]), math.sin(head[2])
        x, y = cosine * forward - sine * leftward, sine * forward + cosine * leftward
        pose = np.array([head[0] + stretch * x, head[1] + stretch * y, wrap_one_angle(head[2] + turn * turned)])
        by_head = np.array(
            [[1.0, 0.0, -stretch * y, x, 0.0], [0.0, 1.0, stretch * x, y, 0.0], [0.0, 0.0, 1.0, 0.0, turned]]
        )
        way = math.hypot(forward, leftward)
        noise = np.zeros((3, 3))
        if way > 0:
            along, across = way * p.along_sd_m**2, way * p.across_sd_m**2
            ahead, aside = x / way, y / way
            noise[0, 0] = along * ahead**2 + across * aside**2
            noise[1, 1] = along * aside**2 + across * ahead**2
            noise[0, 1] = noise[1, 0] = (along - across) * ahead * aside
        noise[2, 2] = self._heading_var * way + self._turn_var * abs(turned)
        return pose, by_head, noise

    def jumped(self, moved: FloatArray, elapsed_s: float) -> bool:
        """Whether no robot moves as far as this: it was carried away, or its odometry was reset.

        Turns are no sign: a robot that is slow along may spin on the spot.

        Parameters
        ----------
        moved : (3,) array
        elapsed_s : float
            Time that it took.
        """
        return math.hypot(moved[0], moved[1]) > self._params.fastest_m_s * elapsed_s

    @staticmethod
    def doubt(moved: FloatArray) -> FloatArray:
        """Covariance (3, 3) of a pose after a jump ``moved`` (3,) that is as likely the odometry's as the robot's."""
        doubt = np.diag([moved[0] ** 2 + moved[1] ** 2] * 2 + [max(abs(moved[2]), math.radians(10)) ** 2])
        return np.asarray(doubt)
