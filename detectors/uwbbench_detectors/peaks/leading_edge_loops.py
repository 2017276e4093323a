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
        earliest = max(at - depth, math.floor(first_path[row[place]] + guard) + 1, 0)
        crest = at
        while crest + 1 < len(frame) and frame[crest + 1] > frame[crest]:
            crest += 1
        largest = 0.0
        for near in range(earliest, crest + 1):
            largest = max(largest, frame[near])
        least = max(share * largest, minimum * noise[row[place]])
        for near in range(earliest, crest + 1):
            rises = near == 0 or frame[near] > frame[near - 1]
            if rises and frame[near] >= least and (near + 1 == len(frame) or frame[near] >= frame[near + 1]):
                front[place] = near
                break
    return front
