"""Inner loop of the leading edge."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import FloatArray, IntArray, compiled


@compiled
def fronts(
    amplitude: FloatArray,
    noise: FloatArray,
    first_path: FloatArray,
    row: IntArray,
    tap: IntArray,
    settings: tuple[int, float, float, float],
) -> IntArray:
    """First crests of bodies (n,); -1 where none is bright enough.

    Parameters
    ----------
    amplitude : (frames, taps) array
    noise, first_path : (frames,) arrays
    row, tap : (n,) int arrays
        Frame and tap of each detection.
    settings : (depth, share, minimum, guard)
        Taps before the detection; least amplitude over the largest, and over the noise; taps behind the first path.
    """
    depth, share, minimum, guard = settings
    front = np.full(len(row), -1, np.int64)
    for place in range(len(row)):
        frame, at = amplitude[row[place]], tap[place]
        earliest = max(at - depth, int(math.floor(first_path[row[place]] + guard)) + 1, 0)
        largest = 0.0
        for near in range(earliest, min(at + 2, len(frame))):
            largest = max(largest, frame[near])
        least = max(share * largest, minimum * noise[row[place]])
        for near in range(earliest, min(at + 1, len(frame))):
            if frame[near] >= least and frame[near] > 0:
                while near + 1 < len(frame) and frame[near + 1] > frame[near]:
                    near += 1
                front[place] = near
                break
    return front
