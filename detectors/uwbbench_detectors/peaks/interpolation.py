"""Delay between the taps."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from uwbbench.api import Block, FloatArray, Params, Stage, ports


class InterpolateParams(Params):
    """Which curve goes through the three magnitudes."""

    method: Literal["parabola", "log_parabola"] = Field(
        "log_parabola",
        description="'log_parabola' fits the logarithm of the magnitudes. Without noise the range error of one "
        "raised-cosine pulse at 1 ns is 4.4 cm RMS on whole taps, 0.35 cm with 'parabola', 0.20 cm with "
        "'log_parabola', which is exact for a Gaussian pulse.",
    )


class Interpolate(Stage[InterpolateParams]):
    """Move each detection from its tap to the vertex of the parabola through three magnitudes around it.

    ``shift = (z- - z+) / (2 (z- - 2 z0 + z+))``, at most half a tap. The first and last tap stay as they are, and so
    does a tap that is not higher than its neighbours taken together. Beside a sample that is zero, which has no
    logarithm, ``log_parabola`` falls back to ``parabola``. Only ``tap`` changes: the amplitude of a detection stays
    that of the sample, so that selections and scores mean the same before and behind this stage.

    Without it, ranges sit on a grid of 15 cm (1 ns taps): an error of 3.75 cm on average and 4.4 cm RMS that no
    signal-to-noise ratio removes.

    References
    ----------
    J. O. Smith and X. Serra, "PARSHL", ICMC 1987 (parabola through the logarithm of three magnitudes).
    """

    consumes: ClassVar[frozenset[str]] = ports("frames", "detections", "tap")
    produces: ClassVar[frozenset[str]] = ports("tap")
    rowwise: ClassVar[bool] = True

    def step(self, block: Block) -> Block:
        """Block whose detections lie at fractional taps."""
        amplitude = block.frames.amplitude
        whole = np.rint(block.detections["tap"]).astype(np.int64)
        inside = np.flatnonzero((whole > 0) & (whole < amplitude.shape[1] - 1))
        row, at = block.rows[inside], whole[inside]
        near = (amplitude[row, at - 1], amplitude[row, at], amplitude[row, at + 1])
        tap = block.detections["tap"].copy()
        tap[inside] = at + vertex_shift(*near, method=self.params.method)
        return block.with_columns(tap=tap)


def vertex_shift(
    before: FloatArray,
    crest: FloatArray,
    after: FloatArray,
    method: Literal["parabola", "log_parabola"] = "log_parabola",
) -> FloatArray:
    """Distance in taps from each crest to the vertex of the parabola through three magnitudes.

    Parameters
    ----------
    before, crest, after : (n,) arrays
        Magnitudes at consecutive taps, not negative.
    method : {"parabola", "log_parabola"}

    Returns
    -------
    (n,) array
        Between -0.5 and 0.5; 0 where the crest is zero or the parabola opens upwards.
    """
    # Relative to the crest, so that neither very small nor very large magnitudes under- or overflow.
    unit = np.where(crest > 0, crest, 1.0)
    with np.errstate(over="ignore"):  # beside a magnitude 1e308 times as high, where no vertex is looked for
        fall = np.stack([(before - crest) / unit, (after - crest) / unit])
    if method == "log_parabola":
        positive = (fall > -1).all(axis=0) & (crest > 0)
        fall[:, positive] = np.log1p(fall[:, positive])
    bends = (fall[0] + fall[1] < 0) & (crest > 0)
    left, right = fall[:, bends]
    shift = np.zeros(len(crest))
    shift[bends] = np.clip(0.5 * (left - right) / (left + right), -0.5, 0.5)
    return shift
