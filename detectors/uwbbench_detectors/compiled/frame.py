"""One frame, compiled: magnitudes, noise, profile and first path.

Each function does what the stage of its name does, operation by operation, so that no comparison can come out
otherwise. Magnitudes are never negative, and such numbers are ordered as the whole numbers that their bits spell:
minima, maxima and comparisons are made on those, which a processor does on many at once.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from uwbbench.api import FloatArray, IntArray, compiled, inlined
from uwbbench_detectors.compiled.layout import NEAR
from uwbbench_detectors.compiled.rank import median

FLAT = -2
"""In place of a tap: the profile has flat tops."""


@compiled
def find_extremes(amplitude: FloatArray, start: int, ends: FloatArray) -> None:
    """Write the smallest and the largest magnitude from tap ``start`` on into ``ends`` (2,).

    Parameters
    ----------
    amplitude : (taps,) array
        Magnitudes.
    start : int
        First tap that counts.
    ends : (2,) array
        Written: smallest, largest.
    """
    bits, written = amplitude.view(np.int64), ends.view(np.int64)
    low = high = bits[start]
    for tap in range(start, len(bits)):
        low, high = min(low, bits[tap]), max(high, bits[tap])
    written[0], written[1] = low, high


@inlined
def _scaled_square(value: float, largest: float) -> float:
    return (value / largest) * (value / largest)


@inlined
def root_mean_square(amplitude: FloatArray, start: int, stop: int) -> float:
    """Root mean square of taps ``start`` to ``stop``, scaled by the largest and added up as numpy does.

    Parameters
    ----------
    amplitude : (taps,) array
        Magnitudes.
    start, stop : int
        First tap, and the one behind the last; at least one tap and, for numpy's order, at most 128.
    """
    largest = 0.0
    for tap in range(start, stop):
        largest = max(largest, amplitude[tap])
    if not largest > 0:
        return 0.0
    count = stop - start
    total = 0.0
    done = start
    if count >= 8:
        running = np.empty(8)
        for lane in range(8):
            running[lane] = _scaled_square(amplitude[start + lane], largest)
        done = start + 8
        while done + 8 <= stop:
            for lane in range(8):
                running[lane] += _scaled_square(amplitude[done + lane], largest)
            done += 8
        left = (running[0] + running[1]) + (running[2] + running[3])
        total = left + ((running[4] + running[5]) + (running[6] + running[7]))
    for tap in range(done, stop):
        total += _scaled_square(amplitude[tap], largest)
    return float(largest * math.sqrt(total / count))


@compiled
def median_noise(amplitude: FloatArray) -> float:
    """Root mean square of the noise from the median magnitude, that of a Rayleigh distribution."""
    heights = np.empty(len(amplitude))
    for tap in range(len(amplitude)):
        heights[tap] = amplitude[tap]
    return median(heights) / math.sqrt(math.log(2.0))


@compiled
def crest_tap(amplitude: FloatArray, start: int, stop: int) -> int:
    """First of the largest magnitudes of taps ``start`` to ``stop``.

    Parameters
    ----------
    amplitude : (taps,) array
        Magnitudes.
    start, stop : int
        First tap, and the one behind the last; ``start`` is the answer where that leaves none.
    """
    best = start
    for tap in range(start + 1, stop):
        if amplitude[tap] > amplitude[best]:
            best = tap
    return best


@compiled
def vertex_shift(amplitude: FloatArray, tap: int, logarithmic: bool) -> tuple[float, bool]:
    """Distance in taps from a crest to the vertex of the parabola through three magnitudes.

    Parameters
    ----------
    amplitude : (taps,) array
        Magnitudes.
    tap : int
        Where the crest is.
    logarithmic : bool
        Take the parabola through the logarithms, where none of the three magnitudes is zero.

    Returns
    -------
    float
        Between -0.5 and 0.5; 0 at the edges of the frame, and where the parabola opens upwards.
    bool
        Whether rounding could decide if it does.
    """
    crest = amplitude[tap]
    if tap <= 0 or tap >= len(amplitude) - 1 or not crest > 0:
        return 0.0, False
    left, right = (amplitude[tap - 1] - crest) / crest, (amplitude[tap + 1] - crest) / crest
    if logarithmic and left > -1 and right > -1:
        left, right = math.log1p(left), math.log1p(right)
    bend = left + right
    close = bend != 0 and abs(bend) < NEAR * (abs(left) + abs(right))
    if not bend < 0:
        return 0.0, close
    return min(max(0.5 * (left - right) / bend, -0.5), 0.5), close


@compiled
def strongest_crest(heights: IntArray, strengths: IntArray, earliest: int, bound: int, bound_place: int) -> int:
    """Place in the profile of the strongest maximum that is left to examine; -1 for none, or FLAT.

    Where the profile rises to a tap and goes on level anywhere, other functions must decide what is a maximum. All taps
    are looked at alike, many at once, and without a branch, since which of them are maxima cannot be predicted.

    Parameters
    ----------
    heights, strengths : (taps,) int array
        Bits of the profile and of the magnitudes under it.
    earliest : int
        Place from which on maxima count.
    bound, bound_place : int
        Strength and place of the one examined before: what is left is weaker, or as strong and later.
    """
    last = len(heights) - 1
    best = np.int64(-1)
    flat = np.int64(0)
    for place in range(1, last):
        rises = heights[place] > heights[place - 1]
        flat = max(flat, np.int64(1) if rises & (heights[place] == heights[place + 1]) else np.int64(0))
        crest = rises & (heights[place] > heights[place + 1]) & (place >= earliest)
        left = (strengths[place] < bound) | ((strengths[place] == bound) & (place > bound_place))
        best = max(best, strengths[place] if crest & left else np.int64(-1))
    if flat:
        return FLAT
    strongest = last
    for place in range(1, last):
        crest = (heights[place] > heights[place - 1]) & (heights[place] > heights[place + 1]) & (place >= earliest)
        left = (best < bound) | (place > bound_place)
        strongest = min(strongest, place if crest & left & (strengths[place] == best) else last)
    return strongest if strongest < last else -1


@compiled
def find_maxima(profile: FloatArray, marked: Any, peaks: IntArray) -> int:
    """Write the taps of all local maxima, the middle of flat ones rounded down; how many they are.

    Parameters
    ----------
    profile : (taps,) array
    marked : (taps,) uint8 array
        Room for a mark of each tap; written.
    peaks : (taps,) int array
        Written: the taps, rising; what lies behind them means nothing.
    """
    bits = profile.view(np.int64)
    last = len(bits) - 1
    flat = count = 0 * last  # what is called with a plain 0 is compiled for it alone
    for tap in range(1, last):
        rises = bits[tap] > bits[tap - 1]
        marked[tap] = rises & (bits[tap] >= bits[tap + 1])
        flat += rises & (bits[tap] == bits[tap + 1])
    for tap in range(1, last):  # without a branch: which taps are maxima cannot be predicted
        peaks[count] = tap
        count += marked[tap]
    return _without_shoulders(bits, peaks, count) if flat else count


@compiled
def _without_shoulders(bits: IntArray, peaks: IntArray, count: int) -> int:
    """Replace starts of flat tops by their middles, and drop those behind which the profile rises on."""
    last = len(bits) - 1
    kept = 0
    for place in range(count):
        tap = peaks[place]
        ahead = tap + 1
        while ahead < last and bits[ahead] == bits[tap]:
            ahead += 1
        peaks[kept] = (tap + ahead - 1) // 2
        kept += bits[ahead] < bits[tap]
    return kept
