"""Inner loops of the weighted sum of responses, and of the noise that its weights follow."""

from __future__ import annotations

from typing import Any

import numpy as np

from uwbbench.api import BoolArray, FloatArray, compiled, inlined

TAIL = 16
"""Taps at the end of a frame whose power is taken for noise."""
POWER, LOOKS = range(2)
"""State of a noise power, by its places."""
FORGETS = 0.02
"""Share of a new frame in a settled noise power: 50 frames, of 16 taps each, know it to a twentieth."""
JUMP = 2.0
"""Times the known noise power that one frame counts at most, so that an echo in the tail passes by."""


@inlined
def noise_power(made: Any, noise: FloatArray) -> float:
    """Mean power in the tail of a response, smoothed over frames.

    Parameters
    ----------
    made : (2, taps) float32 array
    noise : (2,) array
        State, changed.

    Returns
    -------
    float
        0 before the first frame with any power there.
    """
    taps = made.shape[1]
    power = 0.0
    for tap in range(max(taps - TAIL, 0), taps):
        power += made[0, tap] * made[0, tap] + made[1, tap] * made[1, tap]
    power /= min(TAIL, taps)
    if power > 0:
        noise[LOOKS] += 1
        if noise[LOOKS] == 1:
            noise[POWER] = power
        else:
            noise[POWER] += max(1 / noise[LOOKS], FORGETS) * (min(power, JUMP * noise[POWER]) - noise[POWER])
    return float(noise[POWER])


@compiled
def weighted(preamble: Any, sts1: Any, noise: FloatArray) -> None:
    """Sum of two responses in which each echo has the amplitude it had, and the noise is least.

    Parameters
    ----------
    preamble, sts1 : (2, taps) float32 array
        The first is changed.
    noise : (2, 2) array
        State of the noise of each, changed.
    """
    of_preamble, of_sts1 = noise_power(preamble, noise[0]), noise_power(sts1, noise[1])
    taps = preamble.shape[1]
    some = False
    for tap in range(taps):
        some |= sts1[0, tap] != 0 or sts1[1, tap] != 0
    if not some or not of_sts1 > 0:
        return
    weight = min(1.0, of_preamble / of_sts1)
    first, second = np.float32(1 / (1 + weight)), np.float32(weight / (1 + weight))
    for part in range(2):
        into, added = preamble[part], sts1[part]
        for tap in range(taps):
            into[tap] = first * into[tap] + second * added[tap]


@compiled
def fused(preamble: Any, sts1: Any, valid: BoolArray, noise: FloatArray) -> Any:
    """Weighted sums of the responses of consecutive frames.

    Parameters
    ----------
    preamble, sts1 : (frames, taps) complex64 array
        Aligned. Frames whose preamble is all zero stay so.
    valid : (frames,) bool array
    noise : (2, 2) array
        Carried from block to block.

    Returns
    -------
    (frames, taps) complex64 array
    """
    frames, taps = preamble.shape
    made = np.zeros((frames, taps), np.complex64)
    one, other = np.zeros((2, taps), np.float32), np.zeros((2, taps), np.float32)
    for frame in range(frames):
        some = False
        for tap in range(taps):
            one[0, tap], one[1, tap] = preamble[frame, tap].real, preamble[frame, tap].imag
            other[0, tap], other[1, tap] = sts1[frame, tap].real, sts1[frame, tap].imag
            some |= one[0, tap] != 0 or one[1, tap] != 0
        if not valid[frame] or not some:
            continue
        weighted(one, other, noise)
        for tap in range(taps):
            made[frame, tap] = complex(one[0, tap], one[1, tap])
    return made
