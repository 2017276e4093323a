"""Anchors of a scene: those that stand there, and those that the robot sets down on its way."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import CaptureError, Params, SceneAnchor, Trajectory

Place = Annotated[list[float], Field(min_length=2, max_length=2)]
"""x and y in metres."""


class AnchorModel(Params):
    """One anchor: a radio of known identity."""

    id: int = Field(ge=0, description="Number that its messages carry.")
    position_m: Place | None = Field(None, description="Where it stands from the start.")
    drop_at_m: float | None = Field(None, ge=0, description="Or how far the robot has gone when it sets it down.")
    offset_m: Place = Field(
        default=[0.0, 0.3], description="Where in its own frame the robot believes that it sets it down."
    )
    placing_sd_m: float = Field(0.05, ge=0, description="By how much it misses that, in each axis: standard deviation.")

    @model_validator(mode="after")
    def _one_place(self) -> AnchorModel:
        if (self.position_m is None) == (self.drop_at_m is None):
            raise ValueError(f"anchor {self.id} needs either position_m or drop_at_m")
        robots = self.model_fields_set & {"offset_m", "placing_sd_m"}
        if self.position_m is not None and robots:
            raise ValueError(f"{min(robots)} is for anchors that the robot sets down (drop_at_m)")
        return self

    def anchor(self, trajectory: Trajectory, rng: np.random.Generator) -> SceneAnchor:
        """The anchor in one run.

        Parameters
        ----------
        trajectory : Trajectory
            True poses.
        rng : Generator
            Draws where an anchor that is set down comes to stand.

        Raises
        ------
        CaptureError
            If the way ends before the anchor is set down.
        """
        if self.drop_at_m is None:
            return SceneAnchor(self.id, np.array(self.position_m))
        steps = np.linalg.norm(np.diff(trajectory.position_m[:, :2], axis=0), axis=1)
        gone_m = np.concatenate([[0.0], np.cumsum(steps)])
        if gone_m[-1] < self.drop_at_m - 1e-9:
            where = f"anchor {self.id} is set down after {self.drop_at_m:g} m"
            raise CaptureError(f"{where}, but the robot's way is {gone_m[-1]:g} m long")
        frame = int(np.searchsorted(gone_m, self.drop_at_m - 1e-9))
        offset_m = np.array(self.offset_m)
        x, y = offset_m + self.placing_sd_m * rng.standard_normal(2)
        ahead = np.exp(1j * trajectory.yaw_rad[frame]) * complex(x, y)
        return SceneAnchor(
            self.id, trajectory.position_m[frame, :2] + np.array([ahead.real, ahead.imag]), frame, offset_m
        )


def anchors_of(
    models: Sequence[AnchorModel], trajectory: Trajectory, seed: int, key: tuple[int, ...]
) -> tuple[SceneAnchor, ...]:
    """All anchors in one run, each with a random stream of its own.

    Parameters
    ----------
    models : sequence of AnchorModel
    trajectory : Trajectory
        True poses.
    seed : int
        Of the scene.
    key : tuple of int
        What the streams follow from besides.
    """
    anchors = []
    for model in models:
        stream = np.random.SeedSequence(seed, spawn_key=(*key, model.id))
        anchors.append(model.anchor(trajectory, np.random.Generator(np.random.SFC64(stream))))
    return tuple(anchors)
