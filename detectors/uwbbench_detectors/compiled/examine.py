"""Which peaks of a frame pass the filters, compiled.

Filters that look at single peaks commute, and the strongest peak that passes them all is the first one to pass by
falling amplitude. So where one is wanted, peaks are examined in that order, each by the cheapest question first, and
what is not needed is never computed. After a few rejections all peaks are described in one pass instead, whose cost
grows with the taps alone.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from uwbbench.api import FloatArray, IntArray, compiled, inlined
from uwbbench_detectors.compiled import layout as at
from uwbbench_detectors.compiled import short
from uwbbench_detectors.compiled.frame import FLAT, find_maxima, strongest_crest
from uwbbench_detectors.compiled.layout import NEAR
from uwbbench_detectors.compiled.place import phase_difference
from uwbbench_detectors.compiled.shape import prominence_of, prominences_of, width_of

TRIED_SINGLY = 4
"""Peaks of a long frame examined by falling amplitude before all are described."""

PASSED, FAILED, UNDECIDED = 0, 1, 2
UNCLEAR, MORE = -1, -2
STRONGER_THAN_ALL: Any = np.int64(2**63 - 1)


class Signal(NamedTuple):
    """What the search knows of one frame, in numbers; arrays are handed on by themselves, which costs less."""

    row: int
    earliest: int
    first_path: float
    noise: float
    noise_log: float
    path: float
    path1: float
    path2: float


@inlined
def _examine(
    amplitude: FloatArray,
    responses1: Any,
    responses2: Any,
    how: IntArray,
    limits: FloatArray,
    signal: Signal,
    tap: int,
    prominence: float,
    width: float,
    passed: FloatArray,
    number: int,
) -> int:
    """Whether a peak of known shape passes the filters; a row of ``passed`` (peaks, columns) takes its properties."""
    if not limits[at.LEAST_WIDTH] <= width <= limits[at.LARGEST_WIDTH]:
        return FAILED
    passed[number, at.TAP], passed[number, at.AMPLITUDE] = tap, amplitude[tap]
    passed[number, at.PROMINENCE], passed[number, at.WIDTH] = prominence, width
    if how[at.SCORED]:
        delay = (tap - signal.first_path) * limits[at.DELAY_UNIT]
        score = 20 * (math.log10(amplitude[tap]) - signal.noise_log) + limits[at.GAIN_DB] * delay
        if abs(score - limits[at.LEAST_SCORE]) < NEAR:
            return UNDECIDED
        if not score >= limits[at.LEAST_SCORE]:
            return FAILED
        passed[number, at.SCORE] = score
    if how[at.PHASED]:
        taps = (float(tap), float(tap))
        if how[at.ALIGNED]:
            taps = (signal.path1 + (tap - signal.path), signal.path2 + (tap - signal.path))
        above, offset_rad = how[at.WRAPPED_ABOVE] == 1, limits[at.PDOA_OFFSET]
        pdoa = phase_difference(responses1, responses2, signal.row, taps, above, offset_rad)
        size, largest = abs(pdoa), limits[at.LARGEST_PDOA]
        if math.pi - size < NEAR or abs(size - largest) < NEAR:
            return UNDECIDED
        if largest < np.inf and not size <= largest:
            return FAILED
        passed[number, at.PDOA] = pdoa
    return PASSED


@inlined
def examine_sets(
    amplitude: FloatArray,
    profile: FloatArray,
    responses1: Any,
    responses2: Any,
    how: IntArray,
    limits: FloatArray,
    signal: Signal,
    inside: int,
    stop: int,
    passed: FloatArray,
) -> int:
    """Keep the strongest peak of a short frame that passes; else as :func:`examine_by_strength`.

    Parameters
    ----------
    amplitude : (room,) array
        Magnitudes, with room for whole blocks of taps.
    profile : (room,) array
        Curve that is searched, counted from the first tap of the frame, with the same room.
    responses1, responses2, how, limits, signal
        As of :func:`examine_by_strength`.
    inside : int
        Set of the taps of the profile.
    stop : int
        Taps of the frame, at most LANES.
    passed : (rows, columns) array
        Row 0 takes the properties of the peak, in the order of ``layout.COLUMNS``.
    """
    start = how[at.PROFILE_START]
    none = 0 * start  # what is called with a plain 0 is compiled for it alone
    waiting, flat = short.maxima(profile, start, stop)
    if flat:
        return MORE
    weakest = signal.noise * limits[at.LEAST_RATIO]
    waiting &= ~short.taps_before(min(max(signal.earliest + start, 0), stop))
    while waiting:
        tap = short.strongest(amplitude, waiting)
        # No peak is more prominent than it is high, and those left are no higher.
        if not profile[tap] >= limits[at.LEAST_PROMINENCE] or amplitude[tap] < weakest:
            return 0
        prominence = short.prominence_at(profile, tap, inside)
        if prominence >= limits[at.LEAST_PROMINENCE]:
            width = short.width_at(profile, tap, start, prominence, limits[at.RELATIVE_HEIGHT])
            verdict = _examine(
                amplitude, responses1, responses2, how, limits, signal, tap, prominence, width, passed, none
            )
            if verdict != FAILED:
                return 1 if verdict == PASSED else UNCLEAR
        waiting &= ~(1 << tap)
    return 0


@compiled
def examine_by_strength(
    amplitude: FloatArray,
    profile: FloatArray,
    responses1: Any,
    responses2: Any,
    how: IntArray,
    limits: FloatArray,
    signal: Signal,
    heights: IntArray,
    strengths: IntArray,
    passed: FloatArray,
) -> int:
    """Keep the strongest peak that passes: how many do, UNCLEAR where rounding could decide, or MORE after many.

    Parameters
    ----------
    amplitude : (taps,) array
        Magnitudes.
    profile : (taps - start,) array
        Curve that is searched, from the tap PROFILE_START on.
    responses1, responses2 : (frames, taps) complex array
        Responses behind the phase difference, where it is computed; unused otherwise.
    how, limits : tuple
        Settings, laid out as in :mod:`uwbbench_detectors.compiled.layout`.
    signal : Signal
        The frame's row, noise and first path.
    heights, strengths : (taps - start,) int array
        Bits of the profile and of the magnitudes under it.
    passed : (rows, columns) array
        Row 0 takes the properties of the peak, in the order of ``layout.COLUMNS``.

    Returns
    -------
    int
        0 or 1; UNCLEAR where rounding could decide; MORE where TRIED_SINGLY peaks have failed, or the profile has flat
        tops.
    """
    start = how[at.PROFILE_START]
    weakest = signal.noise * limits[at.LEAST_RATIO]
    none = 0 * start  # what is called with a plain 0 is compiled for it alone
    bound, best = STRONGER_THAN_ALL, none - 1
    for _ in range(TRIED_SINGLY):
        best = strongest_crest(heights, strengths, signal.earliest, bound, best)
        if best == FLAT:
            return MORE
        # No peak is more prominent than it is high, and those left are no higher.
        if best < 0 or not profile[best] >= limits[at.LEAST_PROMINENCE]:
            return 0
        if amplitude[best + start] < weakest:
            return 0
        prominence = prominence_of(profile, best)
        if prominence >= limits[at.LEAST_PROMINENCE]:
            width = width_of(profile, best, prominence, limits[at.RELATIVE_HEIGHT])
            verdict = _examine(
                amplitude, responses1, responses2, how, limits, signal, best + start, prominence, width, passed, none
            )
            if verdict != FAILED:
                return 1 if verdict == PASSED else UNCLEAR
        bound = strengths[best]
    return MORE


@compiled
def examine_all(
    amplitude: FloatArray,
    profile: FloatArray,
    responses1: Any,
    responses2: Any,
    how: IntArray,
    limits: FloatArray,
    signal: Signal,
    passed: FloatArray,
    single: bool,
) -> int:
    """Keep the peaks that pass, by rising tap, or the strongest: how many, or UNCLEAR where rounding could decide.

    Parameters
    ----------
    amplitude, profile, responses1, responses2, how, limits, signal
        As of :func:`examine_by_strength`.
    passed : (rows, columns) array
        The first rows take the properties of the peaks kept, in the order of ``layout.COLUMNS``; at least two rows, and
        one for each peak there may be if all are kept.
    single : bool
        Keep the strongest of those that pass, in row 0.
    """
    start = how[at.PROFILE_START]
    marked, places = np.empty(len(profile), np.uint8), np.empty(len(profile), np.int64)
    peaks = places[: find_maxima(profile, marked, places)]
    prominence = prominences_of(profile, peaks)
    kept: int = 0 * start  # what is called with a plain 0 is compiled for it alone
    for number in range(len(peaks)):
        place = peaks[number]
        tap = place + start
        if place < signal.earliest or not prominence[number] >= limits[at.LEAST_PROMINENCE]:
            continue
        if single and kept and not amplitude[tap] > passed[0, at.AMPLITUDE]:
            continue
        width = width_of(profile, place, prominence[number], limits[at.RELATIVE_HEIGHT])
        verdict = _examine(
            amplitude, responses1, responses2, how, limits, signal, tap, prominence[number], width, passed, kept
        )
        if verdict == UNDECIDED:
            return UNCLEAR
        if verdict == PASSED:
            if single and kept:
                for column in range(passed.shape[1]):
                    passed[0, column] = passed[1, column]
            else:
                kept += 1
    return kept
