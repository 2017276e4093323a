"""The pose that a robot believes in."""

from __future__ import annotations

import dataclasses

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import BoolArray, Capture, FloatArray, Params, Term, rotate_z, wrap_angle


class OdometryParams(Params):
    """How far wheels are to be believed."""

    distance_error: float = Field(0.02, ge=0, lt=1, description="Standard deviation of the scale, drawn once a run.")
    rotation_error: float = Field(0.02, ge=0, lt=1, description="The same for the angle turned.")
    heading_noise_deg: float = Field(0.5, ge=0, description="Random walk of the heading, after one metre.")
    drift: float | None = Field(
        None,
        ge=0,
        lt=1,
        description="All three in one number, for scenes that vary it: that error of distance and rotation, and 50 "
        "degrees times it of heading noise.",
    )

    slips_per_min: float = Field(0.0, ge=0, description="Mean number of slips of a wheel in a minute of driving.")
    slip_m: float = Field(0.05, ge=0, description="Mean distance that a slip is measured and not driven.")
    slip_deg: float = Field(3.0, ge=0, description="Standard deviation of the angle that it is measured to turn.")
    slip_s: float = Field(0.3, gt=0, description="How long a slip lasts.")

    @model_validator(mode="after")
    def _said_once(self) -> OdometryParams:
        if self.drift is not None:
            own = {"distance_error", "rotation_error", "heading_noise_deg"}
            other = next(iter(sorted(self.model_fields_set & own)), None)
            if other is not None:
                raise ValueError(f"drift stands for {other} too; give one of the two")
        return self

    @property
    def errors(self) -> tuple[float, float, float]:
        """Errors of distance and rotation, and the heading noise in radians."""
        if self.drift is not None:
            return self.drift, self.drift, np.radians(50 * self.drift)
        return self.distance_error, self.rotation_error, np.radians(self.heading_noise_deg)


class Odometry(Term[OdometryParams]):
    """Drifting odometry: each step between frames is measured in the robot frame, with errors, and added up.

    A wrong wheel radius stretches all steps of a run, a wrong track width all turns, and slip lets the heading walk
    with the square root of the distance. Where the scene asks for it, a wheel spins now and then while the robot
    drives: for a moment odometry then counts a way ahead and a turn that the robot does not make, with a length
    distributed exponentially. Odometry starts at the true pose. The same for all receivers of the robot.
    """

    shared = True

    def record(self, capture: Capture, rng: np.random.Generator) -> Capture:
        """Add the drifting pose."""
        track, (distance, rotation, heading) = capture.trajectory, self.params.errors
        stretch = 1 + distance * rng.standard_normal()
        turned = 1 + rotation * rng.standard_normal()
        steps = np.diff(track.position_m, axis=0)
        walk = heading * np.sqrt(np.linalg.norm(steps, axis=1))
        turns = turned * wrap_angle(np.diff(track.yaw_rad)) + walk * rng.standard_normal(len(steps))
        slipped_m, slipped_rad = self._slips(track.timestamp_s, np.linalg.norm(steps, axis=1) > 0, rng)
        turns = turns + slipped_rad
        yaw_rad = track.yaw_rad[:1] + np.concatenate([[0.0], np.cumsum(turns)])[: len(track)]
        own = stretch * rotate_z(steps, yaw_rad[:-1] - track.yaw_rad[:-1])
        own += slipped_m[:, None] * np.stack([np.cos(yaw_rad), np.sin(yaw_rad), np.zeros_like(yaw_rad)], axis=1)[:-1]
        position_m = track.position_m[:1] + np.concatenate([np.zeros((1, 3)), np.cumsum(own, axis=0)])[: len(track)]
        return dataclasses.replace(capture, odometry_position_m=position_m, odometry_yaw_rad=yaw_rad)

    def _slips(
        self, timestamp_s: FloatArray, driving: BoolArray, rng: np.random.Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Way ahead and angle (steps,) that odometry counts too much in each step, while the robot drives.

        Parameters
        ----------
        timestamp_s : (frames,) array
        driving : (steps,) bool array
            Whether the robot gains any way in a step, one less than there are frames.
        rng : Generator
            Draws number, times and sizes of slips.
        """
        p = self.params
        ahead_m, turned_rad = np.zeros((2, len(driving)))
        driven_s = np.concatenate([[0.0], np.cumsum(np.diff(timestamp_s) * driving)])
        for start_s in rng.uniform(0, driven_s[-1], rng.poisson(p.slips_per_min * driven_s[-1] / 60)):
            share = np.diff(np.clip((driven_s - start_s) / p.slip_s, 0, 1))
            ahead_m += share * rng.exponential(p.slip_m)
            turned_rad += share * np.radians(p.slip_deg) * rng.standard_normal()
        return ahead_m, turned_rad
