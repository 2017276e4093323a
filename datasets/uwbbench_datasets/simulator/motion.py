"""Bodies that move: along waypoints, or swaying where they stand, as a person does who breathes."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import FloatArray, Params
from uwbbench_datasets.simulator.trajectory import Point, in_space

_WAVES = 16
"""Waves that a random drift is made of."""


class Sway(Params):
    """A body that stays where it is, and never quite still: it breathes, and drifts about its place.

    The front moves to and fro along its normal by ``amplitude_m sin(2 pi rate_hz t + phase)``, which is a chest of
    someone at rest (4 to 12 mm and 0.2 to 0.3 Hz are usual). The drift is Gaussian in both axes of the floor, with the
    given standard deviation, and becomes another within ``drift_s``: the correlation after a time ``t`` is
    ``exp(-(t / drift_s)^2 / 2)``.
    """

    kind: Literal["sway"] = "sway"
    amplitude_m: float = Field(0.0075, ge=0, le=0.5, description="Of breathing, along the heading.")
    rate_hz: float = Field(0.25, gt=0, le=20, description="Breaths a second.")
    drift_m: float = Field(0.02, ge=0, le=1, description="Standard deviation of the drift, in each axis.")
    drift_s: float = Field(5.0, gt=0, description="Time over which the drift becomes another.")

    @model_validator(mode="after")
    def _moves(self) -> Sway:
        if self.amplitude_m == 0 and self.drift_m == 0:
            raise ValueError("a body that sways by nothing never moves: give amplitude_m or drift_m, or leave it out")
        return self

    def offset_m(self, time_s: FloatArray, yaw_rad: float, rng: np.random.Generator) -> FloatArray:
        """How far (frames, 3) the body is from its place.

        Parameters
        ----------
        time_s : (frames,) array
        yaw_rad : float
            Heading of its front.
        rng : Generator
            Draws the phase of breathing and the drift.
        """
        breath = self.amplitude_m * np.sin(2 * np.pi * self.rate_hz * time_s + rng.uniform(0, 2 * np.pi))
        turned = rng.normal(size=(2, _WAVES, 1)) * time_s / self.drift_s + rng.uniform(0, 2 * np.pi, (2, _WAVES, 1))
        drift = self.drift_m * np.sqrt(2 / _WAVES) * np.cos(turned).sum(axis=1)
        ahead = np.array([[np.cos(yaw_rad)], [np.sin(yaw_rad)]])
        return np.column_stack([*(drift + ahead * breath), np.zeros(len(time_s))])


class Walk(Params):
    """Straight legs between points at constant speed; the body stands at the first before and at the last after."""

    kind: Literal["waypoints"]
    points_m: list[Point] = Field(min_length=2, description="Where its centre passes.")
    speed_m_s: float = Field(1.0, gt=0, le=50)
    start_s: float = Field(0.0, ge=0, description="Time at which it leaves the first point.")
    sway: Sway | None = Field(None, description="Swaying on top; none if left out.")

    @model_validator(mode="after")
    def _moves(self) -> Walk:
        if all(np.array_equal(in_space(point), in_space(self.points_m[0])) for point in self.points_m):
            raise ValueError("all points_m are one: a body that never moves has a center_m and no motion")
        return self

    def places_m(self, time_s: FloatArray) -> FloatArray:
        """Centre (frames, 3) at times from the start of the run (frames,)."""
        knots = np.stack([in_space(point) for point in self.points_m])
        reached = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1))])
        gone = np.maximum(time_s - self.start_s, 0.0) * self.speed_m_s
        return np.stack([np.interp(gone, reached, knots[:, axis]) for axis in range(3)], axis=1)


Motion = Annotated[Sway | Walk, Field(discriminator="kind")]


def places_m(
    motion: Sway | Walk, center_m: FloatArray, yaw_rad: float, timestamp_s: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Centre (frames, 3) of a body in each frame.

    Parameters
    ----------
    motion : Sway or Walk
    center_m : (3,) array
        Its place, where it sways about one.
    yaw_rad : float
        Its heading, which it keeps.
    timestamp_s : (frames,) array
        Times of the frames; motion counts from the first.
    rng : Generator
        Of the body in this run, the same for all receivers.
    """
    time_s = timestamp_s - timestamp_s[:1]
    if isinstance(motion, Sway):
        return np.asarray(center_m + motion.offset_m(time_s, yaw_rad, rng))
    offset_m = 0.0 if motion.sway is None else motion.sway.offset_m(time_s, yaw_rad, rng)
    return np.asarray(motion.places_m(time_s) + offset_m)
