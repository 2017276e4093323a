"""The front of a body, before its brightest part."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import SPEED_OF_LIGHT_M_S, Block, Params, Radar, Stage, ports


class LeadingEdgeParams(Params):
    """How deep a body is, and how bright its front."""

    depth_m: float = Field(
        0.45, gt=0, le=20, description="How far before a detection the front may lie; 0.45 m is as deep as a person."
    )
    fraction: float = Field(
        0.1,
        gt=0,
        le=1,
        description="Least energy of the front, as a share of the largest in this depth. 0.1 stays above the side "
        "lobes of the pulse of IEEE 802.15.4 (0.018) and below what an arm or a leg returns.",
    )
    minimum_db: float = Field(
        9.6, description="Least energy of the front over the noise: of 10 000 taps of noise one is above 9.6 dB."
    )
    guard_taps: float = Field(3.0, ge=0, description="The front lies more than this behind the first path.")


class LeadingEdge(Stage[LeadingEdgeParams]):
    """Each detection moved to the first echo of its body.

    A body returns several echoes, from a chest, arms and legs, of which now the one and now the other is the brightest;
    its nearest point is what a range is measured to. The front is the first crest, at most ``depth_m`` before the
    detection, with at least ``fraction`` of the largest energy there and ``minimum_db`` over the noise: delays count
    from crest to crest, and the rise before a crest is the pulse's own. Where no crest is so bright the detection
    stays. Only ``tap`` changes, to a whole one: ``interpolate`` goes behind this stage.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames", "noise", "first_path", "detections", "tap")
    produces: ClassVar[frozenset[str]] = ports("tap")
    rowwise: ClassVar[bool] = True

    def open(self, radar: Radar) -> None:
        """Settle the depth in taps."""
        super().open(radar)
        from uwbbench_detectors.peaks.leading_edge_loops import fronts

        p = self.params
        tap_m = radar.sample_interval_s * SPEED_OF_LIGHT_M_S / 2
        self._fronts = fronts
        self._settings = (
            math.floor(min(p.depth_m / tap_m, radar.taps)),
            math.sqrt(p.fraction),
            10 ** (p.minimum_db / 20),
            p.guard_taps,
        )

    def step(self, block: Block) -> Block:
        """Block whose detections lie at the fronts of their bodies."""
        tap = block.detections["tap"]
        if not len(tap):
            return block
        whole = np.rint(tap).astype(np.int64)
        front = self._fronts(
            block.frames.amplitude, block.part("noise_rms"), block.part("first_path"), block.rows, whole, self._settings
        )
        return block.with_columns(tap=np.where(front < 0, tap, front))
