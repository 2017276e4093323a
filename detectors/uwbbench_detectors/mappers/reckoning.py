"""Dead reckoning: the movement of each step into a filter, and what is done where odometry cannot be true."""

from __future__ import annotations

import math
from collections.abc import Callable

from uwbbench.api import Step
from uwbbench_detectors.mappers.ekf import Ekf


class Reckoning:
    """Moves a filter by odometry, step by step.

    A jump, faster than a robot moves, is either the odometry's, which was reset, or the robot's, which was carried
    away. It is taken for no movement, with a covariance that bears out both, and a note says so.

    Parameters
    ----------
    ekf : Ekf
    note : callable
        Takes a text for the reader of the results.
    """

    def __init__(self, ekf: Ekf, note: Callable[[str], None]) -> None:
        self._ekf, self._note = ekf, note
        self._time_s: float | None = None

    def move(self, step: Step) -> bool:
        """Predict by a step; False if odometry has jumped."""
        motion = self._ekf.motion
        elapsed_s = 0.0 if self._time_s is None else step.time_s - self._time_s
        first, self._time_s = self._time_s is None, step.time_s
        if first or not motion.jumped(step.moved, elapsed_s):
            self._ekf.predict(step.moved)
            return True
        far_m, turn_deg = math.hypot(step.moved[0], step.moved[1]), math.degrees(step.moved[2])
        self._ekf.doubt(motion.doubt(step.moved))
        self._note(
            f"odometry jumped by {far_m:.2f} m and {turn_deg:.0f} degrees at {step.time_s:.2f} s: taken for no "
            "movement, with as much added to the standard deviation of the pose"
        )
        return False
