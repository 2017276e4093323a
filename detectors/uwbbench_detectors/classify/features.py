"""Features of a frame behind its direct path.

With ``a`` the magnitudes from the direct path on, over that of its crest: the 41 values behind it, their decimal
logarithms, and 11 numbers about their shape. The list is chosen, not the source's: Sattiraju et al. (arXiv
1811.12228) classify features of the channel's impulse response, and the part that says which could not be read.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from uwbbench.api import SPEED_OF_LIGHT_M_S, Block, BoolArray, Radar

TAPS = 42
"""Taps looked at, the crest's included; those behind the end of a frame count as zero."""

BANDS = (3, 9, 16, 24, 33, 42)
"""Ends of the bands, in taps behind the crest, whose energy is summed."""

NAMES: tuple[str, ...] = (
    *(f"amplitude {tap}" for tap in range(1, TAPS)),
    *(f"log amplitude {tap}" for tap in range(1, TAPS)),
    "mean excess delay",
    "delay spread",
    "entropy",
    "largest amplitude of the tail",
    "tap of that",
    "median amplitude of the tail",
    *(f"energy of taps {start} to {stop - 1}" for start, stop in pairwise(BANDS)),
)
"""What each feature is; delays in taps."""


def features_of(block: Block) -> tuple[NDArray[np.float32], BoolArray]:
    """Features of every frame, and where there are any.

    Parameters
    ----------
    block : Block
        With ``first_path``.

    Returns
    -------
    (frames, 93) float32 array
    (frames,) bool array
        False where a frame is invalid, or zero at its direct path.
    """
    from uwbbench_detectors.classify.loops import frame_features

    samples = np.ascontiguousarray(block.frames.preamble, dtype=np.complex128)
    return frame_features(samples, block.part("first_path"), block.frames.valid, np.array(BANDS))


def reach_m(radar: Radar) -> float:
    """Range from which an echo arrives in the last tap that is looked at."""
    return SPEED_OF_LIGHT_M_S * radar.sample_interval_s * (TAPS - 1) / 2
