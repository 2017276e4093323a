"""Delays and ranges of the taps of a frame, for targets straight ahead of the receiver."""

from __future__ import annotations

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.block import Block
from uwbbench.api.geometry import SPEED_OF_LIGHT_M_S, excess_path
from uwbbench.api.radar import Radar


def delay_of_range(radar: Radar, range_m: FloatArray) -> FloatArray:
    """Delay, as the capture counts it, of a target at a range (n,) on boresight."""
    ahead = np.stack([range_m, np.zeros_like(range_m), np.zeros_like(range_m)], axis=-1)
    flown_m = excess_path(ahead, radar.baseline_m)
    if radar.first_tap_delay_s is not None:
        flown_m = flown_m + radar.baseline_length_m
    return np.asarray(flown_m / SPEED_OF_LIGHT_M_S)


def zero_tap(block: Block, radar: Radar) -> tuple[FloatArray, str]:
    """Tap (frames,) from which delays count, and where that is known from."""
    frames = block.frames
    if radar.first_tap_delay_s is not None:
        return np.full(len(frames), -radar.first_tap_delay_s / radar.sample_interval_s), "transmission"
    if block.first_path is not None:
        return block.first_path, "the detector's first path"
    if frames.first_path_index is not None:
        return frames.first_path_index, "the reported first path"
    return np.argmax(frames.amplitude, axis=1).astype(float), "the strongest tap"
