"""Inner loop of the side-lobe mask."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import BoolArray, FloatArray, IntArray, compiled, inlined

PULSE_TAPS, FAR_DB, FALL_DB, LOBE_DB, MARGIN_DB, RESOLVED = range(6)
SETTINGS = 6
"""Settings, by their places."""


@inlined
def side_lobe_db(off_taps: float, off_cosine: float, spread: float, at: FloatArray) -> float:
    """How far below a peak its own side lobes can be, at most, at a distance from it in range and cosine.

    Parameters
    ----------
    off_taps, off_cosine : float
    spread : float
        Resolution of the cosine; infinite or NaN where there is none.
    at : (SETTINGS,) array
    """
    off = abs(off_taps)
    lobe = -3.0103 * (off / at[PULSE_TAPS]) ** 2
    skirt = at[LOBE_DB] - at[FALL_DB] * off
    in_range = float(max(lobe, max(skirt, at[FAR_DB])))
    if not spread > 0:
        return in_range
    ratio = off_cosine / spread
    return in_range - 10 * math.log10(1 + ratio * ratio)


@compiled
def masked(
    taps: FloatArray, scores: FloatArray, cosines: FloatArray, spreads: FloatArray, row: int, count: int, at: FloatArray
) -> bool:
    """Whether a row may be a side lobe of another of its frame.

    Parameters
    ----------
    taps, scores, cosines, spreads : (count,) arrays
    row, count : int
    at : (SETTINGS,) array
    """
    for other in range(count):
        if other == row or not scores[other] > scores[row]:
            continue
        lobe = side_lobe_db(taps[other] - taps[row], cosines[other] - cosines[row], spreads[other], at)
        if scores[row] < scores[other] + lobe + at[MARGIN_DB]:
            return True
    return False


@compiled
def unmasked(
    frame: IntArray, taps: FloatArray, scores: FloatArray, cosines: FloatArray, spreads: FloatArray, at: FloatArray
) -> BoolArray:
    """Which rows can be no side lobe of another row of their frame.

    Parameters
    ----------
    frame : (n,) int array
        Rising.
    taps, scores, cosines, spreads : (n,) arrays
    at : (SETTINGS,) array
    """
    keep = np.empty(len(frame), np.bool_)
    start = 0
    while start < len(frame):
        stop = start
        while stop < len(frame) and frame[stop] == frame[start]:
            stop += 1
        for row in range(start, stop):
            keep[row] = not masked(
                taps[start:stop],
                scores[start:stop],
                cosines[start:stop],
                spreads[start:stop],
                row - start,
                stop - start,
                at,
            )
        start = stop
    return keep
