"""Range of a mirror that faces the radar, for compiled loops."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import FloatArray, compiled, inlined

WITHIN_RAD, BASELINE_X, BASELINE_Y, BASELINE_M, INTERVAL_S, EXCESS_OFFSET_M, SPEED_M_S, BIAS_M = range(8)
SETTINGS = 8
"""Settings, by their places."""


@inlined
def mirror_range(delay_s: float, azimuth_rad: float, at: FloatArray) -> float:
    """Distance of a mirror from the receiver; NaN where the path is shorter than the baseline.

    ``(a + sqrt(a^2 + b)) / 2`` is written as ``b / (sqrt(a^2 + b) - a) / 2`` where a < 0, as it would lose its digits
    where b is small.

    Parameters
    ----------
    delay_s : float
        As the capture counts it.
    azimuth_rad : float
        Direction that it faces, from boresight; NaN: along it.
    at : (SETTINGS,) array
    """
    excess_m = delay_s * at[SPEED_M_S] - at[EXCESS_OFFSET_M]
    if not excess_m >= 0:
        return np.nan
    faces_rad = azimuth_rad if abs(azimuth_rad) > at[WITHIN_RAD] else 0.0
    along_m = math.cos(faces_rad) * at[BASELINE_X] + math.sin(faces_rad) * at[BASELINE_Y]
    beyond = excess_m * (excess_m + 2 * at[BASELINE_M])
    root = math.sqrt(along_m * along_m + beyond)
    if along_m >= 0:
        return float((along_m + root) / 2 - at[BIAS_M])
    return float(beyond / (root - along_m) / 2 - at[BIAS_M])


@compiled
def mirror_ranges(delay_s: FloatArray, azimuth_rad: FloatArray, at: FloatArray) -> FloatArray:
    """Distances (n,) of mirrors from the receiver.

    Parameters
    ----------
    delay_s, azimuth_rad : (n,) arrays
    at : (SETTINGS,) array
    """
    range_m = np.empty(len(delay_s))
    for place in range(len(delay_s)):
        range_m[place] = mirror_range(delay_s[place], azimuth_rad[place], at)
    return range_m
