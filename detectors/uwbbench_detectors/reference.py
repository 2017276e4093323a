"""Detectors that detect nothing: measures of the harness, of chance, and of the best score there is."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from uwbbench.api import (
    Block,
    Detections,
    FloatArray,
    IntArray,
    Params,
    Radar,
    Stage,
    Trajectory,
    Truth,
    ports,
    receiver_pose,
    to_world,
)

_PRODUCED = ports("detections", "range_m", "azimuth_rad", "amplitude", "x_m", "y_m")


def _placed(block: Block, radar: Radar, rows: IntArray, range_m: FloatArray, azimuth_rad: FloatArray) -> Block:
    """Block with detections of amplitude 1 at a range and azimuth from the frames ``rows``."""
    receiver_m, boresight_rad = receiver_pose(
        block.frames.position_m[rows],
        block.frames.yaw_rad[rows],
        np.asarray(radar.mount_position_m),
        radar.mount_yaw_rad,
    )
    points_m = to_world(range_m, azimuth_rad, receiver_m, boresight_rad)
    detections = Detections(
        block.frames.index[rows],
        range_m=range_m,
        azimuth_rad=azimuth_rad,
        amplitude=np.ones(len(rows)),
        x_m=points_m[:, 0],
        y_m=points_m[:, 1],
    )
    return block.replace(detections=detections)


class Nothing(Stage[Params]):
    """Never detects anything: what it costs is the harness's own time."""

    produces = _PRODUCED
    fidelity = "reference"

    def open(self, radar: Radar) -> None:
        """Prepare the answer, which is always the same."""
        super().open(radar)
        self._no_detections = Detections.empty().with_columns(range_m=(), azimuth_rad=(), amplitude=(), x_m=(), y_m=())

    def step(self, block: Block) -> Block:
        """Block without detections."""
        return block.replace(detections=self._no_detections)


class ConstantParams(Params):
    """Where the one detection lies."""

    range_m: float = Field(1.0, ge=0, description="Range of every detection.")


class Constant(Stage[ConstantParams]):
    """One detection a frame, always at the same range on boresight: the score of not looking."""

    produces = _PRODUCED
    fidelity = "reference"

    def step(self, block: Block) -> Block:
        """Block with one detection for each valid frame."""
        rows = np.flatnonzero(block.frames.valid)
        return _placed(block, self.radar, rows, np.full(len(rows), self.params.range_m), np.zeros(len(rows)))


class Oracle(Stage[Params]):
    """Every visible object at its true range and azimuth: the score that no detector can pass.

    Left out are walls and other structure, frames in which an object is unlabelled, and objects that are occluded or
    behind the receiver.
    """

    produces = _PRODUCED
    needs = ports("truth")
    fidelity = "reference"

    def show_truth(self, truth: Truth, trajectory: Trajectory) -> None:
        """Work out what is seen from each frame."""
        sight = truth.seen_from(self.radar, trajectory)
        sought = np.array([not obstacle.structure for obstacle in truth.objects], dtype=bool)
        with np.errstate(invalid="ignore"):
            ahead = np.abs(sight.azimuth_rad) <= np.pi / 2
        self._visible = np.isfinite(sight.range_m) & ahead & ~sight.occluded & sought
        self._sight = sight

    def step(self, block: Block) -> Block:
        """Block with one detection for each visible object of each valid frame."""
        frame = block.frames.index
        rows, objects = np.nonzero(self._visible[frame] & block.frames.valid[:, None])
        seen = frame[rows], objects
        return _placed(block, self.radar, rows, self._sight.range_m[seen], self._sight.azimuth_rad[seen])
