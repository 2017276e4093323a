"""The search of frames for the detections of a whole chain of stages, compiled.

Filters that look at single peaks commute, and the strongest peak that passes them all is the first one to pass by
falling amplitude. So where one is wanted, peaks are examined in that order, each by the cheapest question first, and
what nobody asks for is never computed. After a few rejections all peaks are described in one pass instead, whose cost
grows with the taps alone.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from uwbbench.api.arrays import FloatArray, IntArray
from uwbbench.api.compiled import compiled
from uwbbench_detectors.fused import layout as at
from uwbbench_detectors.fused.frame import (
    FLAT,
    crest_tap,
    find_extremes,
    find_maxima,
    measure_magnitudes,
    median_noise,
    root_mean_square,
    scale_profile,
    strongest_crest,
    vertex_shift,
)
from uwbbench_detectors.fused.place import azimuth_of, phase_difference, position_of, range_of
from uwbbench_detectors.fused.shape import prominence_of, prominences_of, width_of

TRIED_SINGLY = 4
"""Peaks examined by falling amplitude before all are described."""

NEAR = 1e-9
"""A decision that hangs on a logarithm or an angle closer to its limit than this is left to the plain stages."""

PASSED, FAILED, UNDECIDED = 0, 1, 2
UNCLEAR, MORE = -1, -2
STRONGER_THAN_ALL = np.int64(2**63 - 1)


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


@compiled
def _noise(amplitude: FloatArray, how: IntArray) -> float:
    taps = how[at.NOISE_TAPS]
    if how[at.NOISE] == at.NOISE_LEADING:
        return root_mean_square(amplitude, 0, taps)
    if how[at.NOISE] == at.NOISE_TAIL:
        return root_mean_square(amplitude, len(amplitude) - taps, len(amplitude))
    return median_noise(amplitude)


@compiled
def _judge(amplitude: FloatArray, how: IntArray, told: IntArray) -> None:
    """Count a frame, and whether its leading taps hold more than the noise of the last ones."""
    taps = how[at.NOISE_TAPS]
    tail = root_mean_square(amplitude, len(amplitude) - taps, len(amplitude))
    told[at.JUDGED] += 1
    told[at.SUSPICIOUS] += root_mean_square(amplitude, 0, taps) > at.SUSPICIOUS_RATIO * tail


@compiled
def _first_path(
    amplitude: FloatArray, given: FloatArray, row: int, how: IntArray, limits: FloatArray
) -> tuple[float, bool]:
    """Tap of the first path; and whether rounding could decide which."""
    if how[at.FIRST_PATH] == at.FIRST_PATH_GIVEN:
        return given[row], False
    if how[at.FIRST_PATH] == at.FIRST_PATH_FIXED:
        return limits[at.FIRST_PATH_TAP], False
    crest = crest_tap(amplitude, how[at.CREST_START], how[at.CREST_STOP])
    if how[at.FIRST_PATH] == at.FIRST_PATH_CREST:
        return float(crest), False
    shift, close = vertex_shift(amplitude, crest, True)
    return crest + shift, close


@compiled
def _examine(
    amplitude: FloatArray,
    profile: FloatArray,
    responses1: Any,
    responses2: Any,
    how: IntArray,
    limits: FloatArray,
    signal: Signal,
    place: int,
    row: FloatArray,
) -> int:
    """Whether the peak at a place of the profile passes the filters; ``row`` (columns,) takes its properties.

    ``row`` holds its prominence already, or NaN where that is not known.
    """
    if math.isnan(row[at.PROMINENCE]):
        row[at.PROMINENCE] = prominence_of(profile, place)
    if not row[at.PROMINENCE] >= limits[at.LEAST_PROMINENCE]:
        return FAILED
    row[at.WIDTH] = width_of(profile, place, row[at.PROMINENCE], limits[at.RELATIVE_HEIGHT])
    if not limits[at.LEAST_WIDTH] <= row[at.WIDTH] <= limits[at.LARGEST_WIDTH]:
        return FAILED
    tap = place + how[at.PROFILE_START]
    row[at.TAP], row[at.AMPLITUDE] = tap, amplitude[tap]
    if how[at.SCORED]:
        delay = (tap - signal.first_path) * limits[at.DELAY_UNIT]
        row[at.SCORE] = 20 * (math.log10(amplitude[tap]) - signal.noise_log) + limits[at.GAIN_DB] * delay
        if abs(row[at.SCORE] - limits[at.LEAST_SCORE]) < NEAR:
            return UNDECIDED
        if not row[at.SCORE] >= limits[at.LEAST_SCORE]:
            return FAILED
    if how[at.PHASED]:
        taps = (float(tap), float(tap))
        if how[at.ALIGNED]:
            taps = (signal.path1 + (tap - signal.path), signal.path2 + (tap - signal.path))
        above = how[at.WRAPPED_ABOVE] == 1
        row[at.PDOA] = phase_difference(responses1, responses2, signal.row, taps, above)
        size, largest = abs(row[at.PDOA]), limits[at.LARGEST_PDOA]
        if math.pi - size < NEAR or abs(size - largest) < NEAR:
            return UNDECIDED
        if largest < np.inf and not size <= largest:
            return FAILED
    return PASSED


@compiled
def _examine_by_strength(
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
    """Keep the strongest peak that passes: how many do, UNCLEAR where rounding could decide, or MORE after many."""
    row = passed[0]
    weakest = signal.noise * limits[at.LEAST_RATIO]
    bound, best = STRONGER_THAN_ALL, -1
    for _ in range(TRIED_SINGLY):
        best = strongest_crest(heights, strengths, signal.earliest, bound, best)
        if best == FLAT:
            return MORE
        # No peak is more prominent than it is high, and those left are no higher.
        if best < 0 or not profile[best] >= limits[at.LEAST_PROMINENCE]:
            return 0
        if amplitude[best + how[at.PROFILE_START]] < weakest:
            return 0
        row[at.PROMINENCE] = np.nan
        verdict = _examine(amplitude, profile, responses1, responses2, how, limits, signal, best, row)
        if verdict != FAILED:
            return 1 if verdict == PASSED else UNCLEAR
        bound = strengths[best]
    return MORE


@compiled
def _examine_all(
    amplitude: FloatArray,
    profile: FloatArray,
    responses1: Any,
    responses2: Any,
    how: IntArray,
    limits: FloatArray,
    signal: Signal,
    marked: Any,
    places: IntArray,
    passed: FloatArray,
    single: bool,
) -> int:
    """Keep the peaks that pass, by rising tap, or the strongest: how many, or UNCLEAR where rounding could decide."""
    start = how[at.PROFILE_START]
    peaks = places[: find_maxima(profile, marked, places)]
    prominence = prominences_of(profile, peaks)
    kept = 0
    for number in range(len(peaks)):
        place = peaks[number]
        if place < signal.earliest:
            continue
        if single and kept and not amplitude[place + start] > passed[0, at.AMPLITUDE]:
            continue
        passed[kept, at.PROMINENCE] = prominence[number]
        verdict = _examine(amplitude, profile, responses1, responses2, how, limits, signal, place, passed[kept])
        if verdict == UNDECIDED:
            return UNCLEAR
        if verdict == PASSED:
            if single and kept:
                passed[0] = passed[1]
            else:
                kept += 1
    return kept


@compiled
def _retain(passed: FloatArray, count: int, how: IntArray, retained: Any) -> None:
    """Mark (count,) which of the passed peaks, by rising tap, are retained."""
    wanted = how[at.COUNT]
    for place in range(count):
        retained[place] = how[at.SELECT] == at.SELECT_ALL or (how[at.SELECT] == at.SELECT_NEAREST and place < wanted)
    if how[at.SELECT] == at.SELECT_STRONGEST:
        for _ in range(min(wanted, count)):
            best = -1
            for place in range(count):
                if not retained[place] and (best < 0 or passed[place, at.AMPLITUDE] > passed[best, at.AMPLITUDE]):
                    best = place
            retained[best] = 1


@compiled
def _finish(
    row: FloatArray,
    amplitude: FloatArray,
    first_path: float,
    robot_m: FloatArray,
    yaw_rad: FloatArray,
    row_of_frame: int,
    how: IntArray,
    limits: FloatArray,
) -> None:
    """Describe a retained peak further."""
    if how[at.INTERPOLATE] != at.INTERPOLATE_NONE:
        logarithmic = how[at.INTERPOLATE] == at.INTERPOLATE_LOG_PARABOLA
        row[at.TAP] += vertex_shift(amplitude, int(row[at.TAP]), logarithmic)[0]
    row[at.AZIMUTH] = azimuth_of(row[at.PDOA], limits) if how[at.ANGLE] else np.nan
    if how[at.RANGED] != at.RANGED_NONE:
        row[at.DELAY] = (row[at.TAP] - first_path) * limits[at.INTERVAL_S]
        row[at.RANGE] = range_of(row[at.DELAY], row[at.AZIMUTH], how, limits)
    if how[at.PLACED]:
        robot = robot_m[row_of_frame]
        row[at.X], row[at.Y] = position_of(row[at.RANGE], row[at.AZIMUTH], robot, yaw_rad[row_of_frame], limits)


@compiled
def search(
    samples: Any,
    valid: Any,
    given: FloatArray,
    responses1: Any,
    responses2: Any,
    path: FloatArray,
    path1: FloatArray,
    path2: FloatArray,
    robot_m: FloatArray,
    yaw_rad: FloatArray,
    first: int,
    how: IntArray,
    limits: FloatArray,
    order: IntArray,
    told: IntArray,
    table: FloatArray,
    irregular: Any,
) -> int:
    """Search frames for detections.

    Parameters
    ----------
    samples : (frames, taps) complex array
    valid : (frames,) bool array
        Frames that are searched.
    given : (frames,) array
        First path, where an earlier stage has found it; else anything.
    responses1, responses2 : (frames, taps) complex array
        Responses behind the phase difference, where it is asked for; else anything.
    path, path1, path2 : (frames,) array
        Reported first paths of preamble and responses, where taps are aligned by them; else anything.
    robot_m, yaw_rad : (frames, 3), (frames,) array
        Poses, where positions are asked for; else anything.
    first : int
        Index of the first frame.
    how, limits : arrays
        Settings, as laid out in :mod:`uwbbench_detectors.fused.layout`.
    order : (columns,) int array
        Which of all columns are written, in this order.
    told : (TOLD,) int array
        Frames judged and suspicious so far, which are counted on up to FRAMES_JUDGED.
    table : (rows, 1 + columns) array
        Written: the detections, by frame and then tap; the first column holds the bits of the index of the frame.
    irregular : (frames,) bool array
        Written: frames where rounding could decide or a value is not finite, which the plain stages must search.

    Returns
    -------
    int
        Detections found; -1 less that if frames are irregular.
    """
    start = how[at.PROFILE_START]
    single = how[at.SELECT] == at.SELECT_STRONGEST and how[at.COUNT] == 1
    near = NEAR if how[at.FIRST_PATH] == at.FIRST_PATH_INTERPOLATED else 0.0
    taps = samples.shape[1]
    amplitude, ends = np.empty(taps), np.empty(2)
    profile = amplitude[start:] if how[at.PROFILE] == at.PROFILE_AMPLITUDE else np.empty(taps - start)
    heights, strengths = profile.view(np.int64), amplitude[start:].view(np.int64)
    marked, places = np.empty(taps, np.uint8), np.empty(taps, np.int64)
    passed = np.empty((2 if single else taps // 2 + 1, len(at.COLUMNS)))
    retained = np.empty(len(passed), np.uint8)
    frame = table.view(np.int64)
    clear = True
    found = 0
    for row in range(len(samples)):
        irregular[row] = False
        if not valid[row]:
            continue
        measure_magnitudes(samples, row, amplitude)
        find_extremes(amplitude, 0 if how[at.PROFILE] == at.PROFILE_MINMAX_ALL_TAPS else start, ends)
        highest = ends[1]
        for tap in range(start):
            highest = max(highest, amplitude[tap])
        regular = highest < np.inf
        if how[at.NOISE] == at.NOISE_LEADING and told[at.JUDGED] < at.FRAMES_JUDGED and regular and highest > 0:
            _judge(amplitude, how, told)
        scaled = how[at.PROFILE] != at.PROFILE_AMPLITUDE
        if scaled and regular and not scale_profile(amplitude, start, ends[0], ends[1], profile):
            continue
        first_path, close = _first_path(amplitude, given, row, how, limits)
        guarded = first_path + limits[at.GUARD_TAPS]
        close |= abs(guarded - np.rint(guarded)) < near
        noise = _noise(amplitude, how) if how[at.SCORED] else 1.0
        kept = UNCLEAR
        if regular and not close and math.isfinite(first_path) and noise > 0:
            earliest = math.floor(max(guarded, -1.0)) + 1 - start
            paths = (path[row], path1[row], path2[row]) if how[at.ALIGNED] else (0.0, 0.0, 0.0)
            signal = Signal(row, earliest, first_path, noise, math.log10(noise), paths[0], paths[1], paths[2])
            kept = MORE
            if single:
                kept = _examine_by_strength(
                    amplitude, profile, responses1, responses2, how, limits, signal, heights, strengths, passed
                )
            if kept == MORE:
                kept = _examine_all(
                    amplitude,
                    profile,
                    responses1,
                    responses2,
                    how,
                    limits,
                    signal,
                    marked,
                    places,
                    passed,
                    single,
                )
        if kept == UNCLEAR:
            irregular[row], clear = True, False
            continue
        if not single:
            _retain(passed, kept, how, retained)
        for number in range(kept):
            if single or retained[number]:
                _finish(passed[number], amplitude, first_path, robot_m, yaw_rad, row, how, limits)
                frame[found, 0] = first + row
                for column in range(len(order)):
                    table[found, 1 + column] = passed[number, order[column]]
                found += 1
    return found if clear else -1 - found


@compiled
def search_alone(
    samples: Any,
    valid: Any,
    first: int,
    how: IntArray,
    limits: FloatArray,
    order: IntArray,
    told: IntArray,
    table: FloatArray,
    irregular: Any,
) -> int:
    """Search where nothing but the samples is needed: handing over fewer arrays saves a third of a short call."""
    anything = limits
    return search(
        samples,
        valid,
        anything,
        samples,
        samples,
        anything,
        anything,
        anything,
        table,
        anything,
        first,
        how,
        limits,
        order,
        told,
        table,
        irregular,
    )
