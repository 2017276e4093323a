"""A detector of energy: the strongest tap behind the first path, where it stands out of the frame's median."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from uwbbench.api import Block, Detections, Params, Stage, ports


class EnergyParams(Params):
    """How far behind the first path to look, and what stands out."""

    guard_taps: int = Field(4, ge=0, description="Taps behind the first path that are passed over.")
    above_median_db: float = Field(3.0, description="Height over the median of the frame, in amplitude decibels.")


class Energy(Stage[EnergyParams]):
    """Strongest tap behind the first path."""

    consumes = ports("frames", "first_path")
    produces = ports("detections", "tap", "amplitude")

    def step(self, block: Block) -> Block:
        """Block with at most one detection a frame."""
        amplitude, frames = block.frames.amplitude, block.frames
        first_path = block.part("first_path")
        behind = np.arange(frames.taps) > (first_path + self.params.guard_taps)[:, None]
        tap = np.argmax(np.where(behind, amplitude, -1.0), axis=1)
        height = amplitude[np.arange(len(frames)), tap]
        limit = np.median(amplitude, axis=1) * 10 ** (self.params.above_median_db / 20)
        rows = np.flatnonzero(frames.valid & behind.any(axis=1) & (height > limit))
        found = Detections(frames.index[rows], tap=tap[rows], amplitude=height[rows])
        return block.replace(detections=found)
