"""Inner loop of the matched filter."""

from __future__ import annotations

from typing import Any

import numpy as np

from uwbbench.api import compiled


@compiled
def matched(made: Any, pulse: Any, room: Any) -> None:
    """Filter a response by a pulse that is symmetric in time.

    Parameters
    ----------
    made : (2, taps) float32 array
        Changed.
    pulse : (2 n + 1,) float32 array
    room : (taps + 2 n,) float32 array
        Zero at both ends; changed in between.
    """
    taps, terms = made.shape[1], len(pulse)
    half = terms // 2
    for part in range(2):
        target = made[part]
        for tap in range(taps):
            room[half + tap] = target[tap]
            target[tap] = np.float32(0)
        for term in range(terms):
            weight = pulse[term]
            for tap in range(taps):
                target[tap] += weight * room[term + tap]


@compiled
def matched_frames(samples: Any, pulse: Any) -> Any:
    """Consecutive frames of one response behind the filter.

    Parameters
    ----------
    samples : (frames, taps) complex64 array
    pulse : (2 n + 1,) float32 array

    Returns
    -------
    (frames, taps) complex64 array
    """
    frames, taps = samples.shape
    filtered = np.zeros((frames, taps), np.complex64)
    made, room = np.zeros((2, taps), np.float32), np.zeros(taps + len(pulse) - 1, np.float32)
    for frame in range(frames):
        for tap in range(taps):
            made[0, tap], made[1, tap] = samples[frame, tap].real, samples[frame, tap].imag
        matched(made, pulse, room)
        for tap in range(taps):
            filtered[frame, tap] = complex(made[0, tap], made[1, tap])
    return filtered
