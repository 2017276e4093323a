"""The responses of one frame as one."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from uwbbench.api import Block, FloatArray, Params, Radar, Stage, ports
from uwbbench_detectors.integrate.motion import plain


class FuseResponses(Stage[Params]):
    """Adds STS1 to the preamble, each weighted by its noise; STS2 stays what it is.

    Preamble and STS1 are received by the same antenna within a millisecond, so that behind ``align.template`` an echo
    has the same amplitude and phase in both while their noise is independent. With noise powers p and s the sum
    ``(preamble + w STS1) / (1 + w)`` has the least noise for ``w = p / s``, where it is ``p s / (p + s)``: 3 dB below
    that of the preamble where both are equal, 1.5 dB where that of STS1 is 4 dB higher. w is 1 at most. Noise is the
    power in the last 16 taps, smoothed over frames; a frame counts at most twice what is known, so that an echo that
    passes there does little.

    STS2, of the other antenna, has another phase, from which the direction is found: it is left as a second channel.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames")
    produces: ClassVar[frozenset[str]] = ports("frames")
    needs: ClassVar[frozenset[str]] = ports("sts")

    def open(self, radar: Radar) -> None:
        """Start without knowledge of the noise."""
        super().open(radar)
        from uwbbench_detectors.integrate.fuse_loops import fused

        self._fused = fused
        self.noise: FloatArray = np.zeros((2, 2))

    def step(self, block: Block) -> Block:
        """Block whose preamble is the sum."""
        frames = block.frames
        preamble, sts1 = plain(frames.preamble, np.complex64), plain(frames.sts1, np.complex64)
        made = self._fused(preamble, sts1, plain(frames.valid, np.bool_), self.noise)
        return block.replace(frames=frames.with_preamble(plain(made, np.complex64)))
