"""The search of frames for the detections of a whole chain of stages, compiled."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from uwbbench.api import FloatArray, IntArray, as_tuple, compiled, inlined
from uwbbench_detectors.compiled import layout as at
from uwbbench_detectors.compiled import short
from uwbbench_detectors.compiled.examine import MORE, UNCLEAR, Signal, examine_all, examine_by_strength, examine_sets
from uwbbench_detectors.compiled.frame import crest_tap, find_extremes, median_noise, root_mean_square, vertex_shift
from uwbbench_detectors.compiled.lanes import BLOCK, LANES, largest_of, least_of
from uwbbench_detectors.compiled.layout import HOW, LIMITS, NEAR
from uwbbench_detectors.compiled.place import azimuth_of, position_of, range_of
from uwbbench_detectors.peaks.noise import FRAMES_TO_JUDGE, SUSPICIOUS_RATIO

# Read-only in compiled code, as what a capture hands over: one search is compiled for both.
_NO_VALUES: FloatArray = np.zeros(1)
_NO_POSES: FloatArray = np.zeros((1, 3))


@inlined
def _noise(amplitude: FloatArray, how: IntArray) -> float:
    taps = how[at.NOISE_TAPS]
    if how[at.NOISE] == at.NOISE_LEADING:
        return root_mean_square(amplitude, 0 * taps, taps)  # a plain 0 is compiled for by itself
    if how[at.NOISE] == at.NOISE_TAIL:
        return root_mean_square(amplitude, len(amplitude) - taps, len(amplitude))
    return median_noise(amplitude)


@compiled
def _judge(amplitude: FloatArray, how: IntArray, noise_tally: IntArray) -> None:
    """Count a frame, and whether its leading taps hold more than the noise of the last ones."""
    taps = how[at.NOISE_TAPS]
    tail = root_mean_square(amplitude, len(amplitude) - taps, len(amplitude))
    noise_tally[at.JUDGED] += 1
    noise_tally[at.SUSPICIOUS] += root_mean_square(amplitude, 0 * taps, taps) > SUSPICIOUS_RATIO * tail


@inlined
def _first_path(
    amplitude: FloatArray, room: FloatArray, given: float, how: IntArray, limits: FloatArray
) -> tuple[float, bool]:
    """Tap of the first path; and whether rounding could decide which."""
    if how[at.FIRST_PATH] == at.FIRST_PATH_GIVEN:
        return given, False
    if how[at.FIRST_PATH] == at.FIRST_PATH_FIXED:
        return limits[at.FIRST_PATH_TAP], False
    start, stop = how[at.CREST_START], how[at.CREST_STOP]
    if start < stop <= LANES:
        crest = short.strongest(room, short.taps_before(stop) & ~short.taps_before(start))
    else:
        crest = crest_tap(amplitude, start, stop)
    if how[at.FIRST_PATH] == at.FIRST_PATH_CREST:
        return float(crest), False
    shift, close = vertex_shift(amplitude, crest, True)
    return crest + shift, close


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


@inlined
def _finish(
    passed: FloatArray,
    number: int,
    amplitude: FloatArray,
    first_path: float,
    robot_m: FloatArray,
    yaw_rad: FloatArray,
    row: int,
    how: IntArray,
    limits: FloatArray,
) -> None:
    """Describe a retained peak further."""
    tap = passed[number, at.TAP]
    if how[at.INTERPOLATE] != at.INTERPOLATE_NONE:
        logarithmic = how[at.INTERPOLATE] == at.INTERPOLATE_LOG_PARABOLA
        tap += vertex_shift(amplitude, int(tap), logarithmic)[0]
        passed[number, at.TAP] = tap
    azimuth_rad = np.nan
    if how[at.ANGLE]:
        azimuth_rad = azimuth_of(passed[number, at.PDOA], limits)
        passed[number, at.AZIMUTH] = azimuth_rad
    if how[at.RANGED] != at.RANGED_NONE:
        delay_s = (tap - first_path) * limits[at.INTERVAL_S]
        range_m = range_of(delay_s, azimuth_rad, how, limits)
        passed[number, at.DELAY], passed[number, at.RANGE] = delay_s, range_m
        if how[at.PLACED]:
            placed = position_of(range_m, azimuth_rad, robot_m[row], yaw_rad[row], limits)
            passed[number, at.X], passed[number, at.Y] = placed


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
    settings: IntArray,
    bounds: FloatArray,
    order: IntArray,
    noise_tally: IntArray,
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
        First path, where an earlier stage has found it; unused otherwise.
    responses1, responses2 : (frames, taps) complex array
        Responses behind the phase difference, where it is computed; unused otherwise.
    path, path1, path2 : (frames,) array
        Reported first paths of preamble and responses, where taps are aligned by them; unused otherwise.
    robot_m, yaw_rad : (frames, 3), (frames,) array
        Poses, where positions are computed; unused otherwise.
    first : int
        Index of the first frame.
    settings, bounds : arrays
        How the search goes and its limits, as laid out in :mod:`uwbbench_detectors.compiled.layout`.
    order : (columns,) int array
        Which of all columns are written, in this order.
    noise_tally : (NOISE_TALLY,) int array
        Frames judged and suspicious so far, which are counted on up to FRAMES_TO_JUDGE.
    table : (rows, 1 + columns) array
        Written: the detections, by frame and then tap; the first column holds the bits of the index of the frame.
    irregular : (frames,) bool array
        Written: frames where rounding could decide or a value is not finite, which the plain stages must search.

    Returns
    -------
    int
        Detections found; -1 less that if frames are irregular.
    """
    # As values of their own: those of an array are read anew after whatever is written to any array.
    how, limits = as_tuple(settings, HOW), as_tuple(bounds, LIMITS)
    start, stop = how[at.PROFILE_START], samples.shape[1]
    single = how[at.SELECT] == at.SELECT_STRONGEST and how[at.COUNT] == 1
    near = NEAR if how[at.FIRST_PATH] == at.FIRST_PATH_INTERPOLATED else 0.0
    scaled = how[at.PROFILE] != at.PROFILE_AMPLITUDE
    lowest_from = 0 if how[at.PROFILE] == at.PROFILE_MINMAX_ALL_TAPS else start
    is_short = stop <= LANES
    everywhere = short.taps_before(stop)
    inside, scaling = everywhere & ~short.taps_before(start), everywhere & ~short.taps_before(lowest_from)
    strengths_room = np.empty(max(stop, LANES) + BLOCK)
    heights_room = np.empty(len(strengths_room)) if scaled else strengths_room
    amplitude, profile = strengths_room[:stop], heights_room[start:stop]
    heights, strengths = profile.view(np.int64), amplitude[start:].view(np.int64)
    ends = np.empty(2)
    passed = np.empty((2 if single else stop // 2 + 1, len(at.COLUMNS)))
    retained = np.empty(len(passed), np.uint8)
    frame = table.view(np.int64)
    clear = True
    written = 0
    for row in range(len(samples)):
        irregular[row] = False
        if not valid[row]:
            continue
        short.measure(samples, row, strengths_room)
        if is_short:
            low, high = least_of(strengths_room, scaling), largest_of(strengths_room, scaling)
            highest = largest_of(strengths_room, everywhere)
        else:
            find_extremes(amplitude, lowest_from, ends)
            low, high = ends[0], ends[1]
            highest = high
            for tap in range(start):
                highest = max(highest, amplitude[tap])
        regular = highest < np.inf
        if how[at.NOISE] == at.NOISE_LEADING and noise_tally[at.JUDGED] < FRAMES_TO_JUDGE and regular and highest > 0:
            _judge(amplitude, how, noise_tally)
        if scaled and regular and not short.scale(strengths_room, stop, low, high, heights_room):
            continue
        first_path, close = _first_path(
            amplitude, strengths_room, given[row] if how[at.FIRST_PATH] == at.FIRST_PATH_GIVEN else 0.0, how, limits
        )
        guarded = first_path + limits[at.GUARD_TAPS]
        if near > 0:
            close |= abs(guarded - np.rint(guarded)) < near
        noise = _noise(amplitude, how) if how[at.SCORED] else 1.0
        kept = UNCLEAR
        if regular and not close and math.isfinite(first_path) and noise > 0:
            earliest = math.floor(max(guarded, -1.0)) + 1 - start
            paths = (path[row], path1[row], path2[row]) if how[at.ALIGNED] else (0.0, 0.0, 0.0)
            signal = Signal(row, earliest, first_path, noise, math.log10(noise), paths[0], paths[1], paths[2])
            kept = MORE
            if single and is_short:
                kept = examine_sets(
                    strengths_room,
                    heights_room,
                    responses1,
                    responses2,
                    how,
                    limits,
                    signal,
                    inside,
                    stop,
                    passed,
                )
            elif single:
                kept = examine_by_strength(
                    amplitude, profile, responses1, responses2, how, limits, signal, heights, strengths, passed
                )
            if kept == MORE:
                kept = examine_all(amplitude, profile, responses1, responses2, how, limits, signal, passed, single)
        if kept == UNCLEAR:
            irregular[row], clear = True, False
            continue
        if not single:
            _retain(passed, kept, how, retained)
        for number in range(kept):
            if single or retained[number]:
                _finish(passed, number, amplitude, first_path, robot_m, yaw_rad, row, how, limits)
                frame[written, 0] = first + row
                for column in range(len(order)):
                    table[written, 1 + column] = passed[number, order[column]]
                written += 1
    return written if clear else -1 - written


@compiled
def search_alone(
    samples: Any,
    valid: Any,
    first: int,
    how: IntArray,
    limits: FloatArray,
    order: IntArray,
    noise_tally: IntArray,
    table: FloatArray,
    irregular: Any,
) -> int:
    """Search where only the samples are needed: a short call is cheaper with fewer arrays to hand over.

    Parameters
    ----------
    samples, valid, first : arrays and int
        As of :func:`search`.
    how, limits : (HOW,) int array, (LIMITS,) array
        The ``settings`` and ``bounds`` of :func:`search`, which must need no other input.
    order, noise_tally, table, irregular : arrays
        As of :func:`search`; the last three are written.

    Returns
    -------
    int
        As of :func:`search`.
    """
    return search(
        samples,
        valid,
        _NO_VALUES,
        samples,
        samples,
        _NO_VALUES,
        _NO_VALUES,
        _NO_VALUES,
        _NO_POSES,
        _NO_VALUES,
        first,
        how,
        limits,
        order,
        noise_tally,
        table,
        irregular,
    )
