"""A frame of at most 64 taps, compiled: what :mod:`frame` and :mod:`shape` do, on all taps at once.

Arrays are counted from the first tap of the frame and have room for whole blocks of LANES taps; what lies beyond the
frame, or in the profile before its first tap, is in no set of taps and has no meaning.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from uwbbench.api import FloatArray, inlined
from uwbbench_detectors.compiled import lanes


@inlined
def taps_before(stop: int) -> int:
    """Set of all taps before one."""
    return int(np.int64(-1) if stop >= lanes.LANES else (np.int64(1) << stop) - 1)


@inlined
def measure(samples: Any, row: int, amplitude: FloatArray) -> None:
    """Write the magnitudes of one row of samples, of any length.

    Parameters
    ----------
    samples : (frames, taps) complex array
        In one piece.
    row : int
    amplitude : (room,) array
        Written from its first value on.
    """
    taps = samples.shape[1]
    whole = taps - taps % lanes.BLOCK
    for tap in range(0, whole, lanes.BLOCK):
        lanes.measure_block(samples, row, tap, amplitude)
    for tap in range(whole, taps):
        real, imaginary = np.float64(samples[row, tap].real), np.float64(samples[row, tap].imag)
        amplitude[tap] = math.sqrt(real * real + imaginary * imaginary)


@inlined
def scale(amplitude: FloatArray, taps: int, low: float, high: float, profile: FloatArray) -> bool:
    """Write the profile between the extremes; whether the frame varies by more than rounding.

    Parameters
    ----------
    amplitude : (room,) array
        Magnitudes.
    taps : int
        Taps of the frame.
    low, high : float
        Smallest and largest magnitude; they become 0 and 1.
    profile : (room,) array
        Written, from the first tap of the frame on.
    """
    span = high - low
    if not span > 8 * np.finfo(np.float64).eps * high:
        return False
    for tap in range(0, taps, lanes.BLOCK):
        lanes.scale_block(amplitude, tap, low, span, profile)
    return True


@inlined
def strongest(amplitude: FloatArray, taps: int) -> Any:
    """First of the largest magnitudes in a set of taps, which is not empty."""
    return lanes.first_tap(lanes.taps_at(amplitude, lanes.largest_of(amplitude, taps)) & taps)


@inlined
def maxima(profile: FloatArray, start: int, stop: int) -> tuple[int, bool]:
    """Set of the maxima of one tap each, and whether there may be flat ones, which it lacks.

    Parameters
    ----------
    profile : (room,) array
    start, stop : int
        First tap of the profile, and the one behind the last.
    """
    rises, falls = lanes.slopes(profile)
    inside = taps_before(stop - 1) & ~taps_before(start)  # with a neighbour behind
    behind = (rises & inside) << 1
    return behind & falls & inside, (behind & ~(rises | falls) & inside) != 0


@inlined
def prominence_at(profile: FloatArray, tap: int, inside: int) -> Any:
    """Prominence of the peak at a tap, among a set of taps that are inside the profile.

    Parameters
    ----------
    profile : (room,) array
    tap : int
        Where the peak is.
    inside : int
        Set of the taps of the profile.
    """
    height = profile[tap]
    before = (np.int64(1) << tap) - 1
    higher = lanes.taps_above(profile, height) & inside
    left = before & (np.int64(-1) << (lanes.LANES - lanes.taps_behind(higher & before)))
    right = ~before & taps_before(lanes.first_tap(higher & ~before))
    here = np.int64(1) << tap
    return height - max(lanes.least_of(profile, left & inside | here), lanes.least_of(profile, right & inside))


@inlined
def width_at(profile: FloatArray, tap: int, origin: int, prominence: float, relative_height: float) -> float:
    """Width in taps of the peak at a tap, at a share of its prominence below the crest; taps count from ``origin``.

    Parameters
    ----------
    profile : (room,) array
    tap : int
        Where the peak is.
    origin : int
        Tap from which the edges are counted, which decides how their difference is rounded.
    prominence : float
        In units of the profile.
    relative_height : float
        Share of the prominence, at most 0.9.
    """
    level = profile[tap] - prominence * relative_height
    here = np.int64(1) << tap
    low = ~lanes.taps_above(profile, level)
    start = lanes.LANES - 1 - lanes.taps_behind(low & (here | (here - 1)))
    stop = lanes.first_tap(low & ~(here - 1))
    left, right = float(start - origin), float(stop - origin)
    if profile[start] < level:
        left += (level - profile[start]) / (profile[start + 1] - profile[start])
    if profile[stop] < level:
        right -= (level - profile[stop]) / (profile[stop - 1] - profile[stop])
    return right - left
