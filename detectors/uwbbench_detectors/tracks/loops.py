"""Inner loops of the Kalman tracker: all tracks of a stream, frame by frame."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import BoolArray, FloatArray, compiled
from uwbbench_detectors.tracks.assignment import assigned
from uwbbench_detectors.tracks.state import (
    ACCELERATION,
    AZIMUTH,
    BEARING,
    BORESIGHT,
    CONFIRMED,
    COUNT,
    EMITS_ALL,
    FIELDS,
    FRAMES,
    FRAMES_ALLOWED,
    GATE,
    HIT_S,
    HITS,
    HITS_ASKED,
    LIVES_S,
    NEAREST,
    NEXT,
    NUMBER,
    ONE,
    RANGE,
    RANGE_VARIANCE,
    RATE,
    RATE_VARIANCE,
    ROW,
    START_RATE_VARIANCE,
    TIME_S,
    VARIANCE,
    X_M_S,
    Y_M_S,
    advance,
    predict,
    update,
)

CLOCK_S = 1e-9
"""By which two times may differ that are meant to be equal."""
SHARED = 5
"""Columns that every table of tracks has: frame, number, range, its rate, its standard deviation."""


@compiled
def _copy(source: FloatArray, target: FloatArray) -> None:
    for field in range(len(source)):
        target[field] = source[field]


@compiled
def _with_room(table: FloatArray, rows: int) -> FloatArray:
    """A table with room for twice as many rows, whose first ones are these."""
    larger = np.empty((2 * len(table), table.shape[1]))
    for row in range(rows):
        _copy(table[row], larger[row])
    return larger


@compiled
def _associate(tracks: FloatArray, start: int, stop: int, here: FloatArray, used: BoolArray, at: FloatArray) -> None:
    """Give a group of tracks the detections that are not used yet, so that the sum of squared distances is least.

    A distance counts in standard deviations of the difference between detection and prediction. At the gate it counts
    as no detection, so that a track goes without one rather than take one beyond.

    Parameters
    ----------
    tracks : (n, fields) array
        ``ROW`` is written.
    start, stop : int
        Places of the group in the table.
    here : (columns, rows) array
        Detections of the frame.
    used : (rows,) bool array
        Written.
    at : (SETTINGS,) array
    """
    free, count = np.empty(len(used), np.int64), 0
    for row in range(len(used)):
        if not used[row]:
            free[count] = row
            count += 1
    if stop == start or count == 0:
        return
    cost = np.empty((stop - start, count))
    for place in range(stop - start):
        track = tracks[start + place]
        for column in range(count):
            off_m = here[1, free[column]] - track[RANGE]
            cost[place, column] = min(off_m * off_m / (track[RANGE_VARIANCE] + at[VARIANCE]), at[GATE])
    column_of = assigned(cost)
    for place in range(stop - start):
        column = column_of[place]
        if column >= 0 and cost[place, column] < at[GATE]:
            tracks[start + place, ROW] = free[column]
            used[free[column]] = True


@compiled
def _forget(tracks: FloatArray, carried: FloatArray, oldest_s: float, at: FloatArray) -> None:
    """Drop tracks whose last detection is older, and tentative ones that can no longer be confirmed."""
    kept, confirmed = 0, 0
    for place in range(int(carried[COUNT])):
        track = tracks[place]
        hopeless = track[NUMBER] < 0 and track[HITS] + at[FRAMES_ALLOWED] - track[FRAMES] < at[HITS_ASKED]
        if track[HIT_S] >= oldest_s and not hopeless:
            confirmed += track[NUMBER] >= 0
            _copy(track, tracks[kept])
            kept += 1
    carried[COUNT], carried[CONFIRMED] = kept, confirmed


@compiled
def _begin(track: FloatArray, detection: FloatArray, row: int, carried: FloatArray, at: FloatArray) -> None:
    """Make a tentative track of a detection.

    Parameters
    ----------
    track : (fields,) array
        Written.
    detection : (columns,) array
    row : int
        Of the detection in its frame.
    carried, at : arrays
    """
    track[:] = 0
    track[RANGE], track[RANGE_VARIANCE], track[RATE_VARIANCE] = detection[1], at[VARIANCE], at[START_RATE_VARIANCE]
    track[NUMBER], track[FRAMES] = -1, 1
    _hit(track, detection, row, carried, at)


@compiled
def _hit(track: FloatArray, detection: FloatArray, row: int, carried: FloatArray, at: FloatArray) -> None:
    """Note that a detection belongs to a track: when, which, and in which direction of the world.

    Parameters
    ----------
    track : (fields,) array
        Changed.
    detection : (columns,) array
    row : int
        Of the detection in its frame.
    carried, at : arrays
    """
    track[HIT_S], track[ROW], track[BEARING] = carried[TIME_S], row, carried[BORESIGHT]
    track[HITS] += 1
    azimuth = int(at[AZIMUTH])
    if azimuth >= 0 and not math.isnan(detection[azimuth]):
        track[BEARING] += detection[azimuth]


@compiled
def _first(here: FloatArray, rows: FloatArray, nearest: bool) -> int:
    """Place among rows of detections (-1: none) of the nearest or strongest; -1 if there are none.

    Parameters
    ----------
    here : (columns, n) array
        Detections of the frame.
    rows : (m,) array
    nearest : bool
        Else the strongest; an unknown amplitude comes last.
    """
    first, best = -1, -np.inf
    for place in range(len(rows)):
        row = int(rows[place])
        if row >= 0:
            height = -here[1, row] if nearest else here[2, row]
            if first < 0 or height > best or (math.isnan(best) and not math.isnan(height)):
                first, best = place, height
    return first


@compiled
def _confirm(tracks: FloatArray, carried: FloatArray, here: FloatArray, at: FloatArray) -> None:
    """Number the tentative tracks that have enough detections, and put them behind the confirmed ones.

    Of one track alone the nearest or strongest of them is taken, and all others are forgotten.

    Parameters
    ----------
    tracks, carried : arrays
        Changed.
    here : (columns, rows) array
        Detections of the frame.
    at : (SETTINGS,) array
    """
    count, confirmed = int(carried[COUNT]), int(carried[CONFIRMED])
    chosen = -1
    if at[ONE] > 0:
        rows = np.empty(count - confirmed)
        for place in range(len(rows)):
            ready = tracks[confirmed + place, HITS] >= at[HITS_ASKED]
            rows[place] = tracks[confirmed + place, ROW] if ready else -1
        chosen = _first(here, rows, at[NEAREST] > 0)
        if chosen < 0:
            return
        chosen += confirmed
    for place in range(confirmed, count):
        if tracks[place, HITS] >= at[HITS_ASKED] and (chosen < 0 or place == chosen):
            track = np.empty(FIELDS)
            _copy(tracks[place], track)
            track[NUMBER] = carried[NEXT]
            carried[NEXT] += 1
            for later in range(place, confirmed, -1):
                _copy(tracks[later - 1], tracks[later])
            _copy(track, tracks[confirmed])
            confirmed += 1
    carried[CONFIRMED] = confirmed
    if at[ONE] > 0:
        carried[COUNT] = confirmed


@compiled
def _start(tracks: FloatArray, carried: FloatArray, here: FloatArray, used: BoolArray, at: FloatArray) -> None:
    """Begin tentative tracks from the detections that no track took, or from the first of them.

    Parameters
    ----------
    tracks, carried : arrays
        Changed.
    here : (columns, rows) array
        Detections of the frame.
    used : (rows,) bool array
    at : (SETTINGS,) array
    """
    chosen = -1
    if at[ONE] > 0:
        rows = np.empty(len(used))
        for row in range(len(used)):
            rows[row] = -1 if used[row] else row
        chosen = _first(here, rows, at[NEAREST] > 0)
        if chosen < 0:
            return
    for row in range(len(used)):
        if not used[row] and (chosen < 0 or row == chosen):
            count = int(carried[COUNT])
            _begin(tracks[count], here[:, row], row, carried, at)
            carried[COUNT] += 1


@compiled
def _write(
    tracks: FloatArray, carried: FloatArray, here: FloatArray, at: FloatArray, frame: int, table: FloatArray, row: int
) -> int:
    """Put the tracks of a frame into the table that is handed out.

    Parameters
    ----------
    tracks, carried : arrays
    here : (columns, rows) array
        Detections of the frame.
    at : (SETTINGS,) array
    frame : int
        Index in the capture.
    table : (n, SHARED + columns) array
        Written.
    row : int
        Of the table, to start at.

    Returns
    -------
    int
        Row behind the last one written.
    """
    whole = table.view(np.int64)
    for place in range(int(carried[COUNT] if at[EMITS_ALL] > 0 else carried[CONFIRMED])):
        track = tracks[place]
        closing_m_s = carried[X_M_S] * math.cos(track[BEARING]) + carried[Y_M_S] * math.sin(track[BEARING])
        whole[row, 0], whole[row, 1] = frame, int(track[NUMBER])
        table[row, 2], table[row, 3] = track[RANGE], track[RATE] - closing_m_s
        table[row, 4] = math.sqrt(track[RANGE_VARIANCE])
        for column in range(2, len(here)):
            table[row, SHARED + column - 2] = here[column, int(track[ROW])] if track[ROW] >= 0 else np.nan
        row += 1
    return row


@compiled
def follow(
    tracks: FloatArray, carried: FloatArray, clock: FloatArray, found: FloatArray, at: FloatArray, first: int
) -> FloatArray:
    """Take all tracks through the frames of a block.

    Parameters
    ----------
    tracks : (room, fields) array
        Table of tracks, with room for one more of each detection; changed.
    carried : (CARRIED,) array
        State of the stream besides; changed.
    clock : (2, frames) or (5, frames) array
        Time, 1 for valid frames, and, where odometry is used, the robot's x, y and yaw.
    found : (columns, rows) array
        Index of the frame, range, amplitude and what else tracks take over of each detection, by frame.
    at : (SETTINGS,) array
    first : int
        Index of the first frame.

    Returns
    -------
    (n, SHARED + columns - 2) array
        Tracks in each frame: frame and number by their bits, range, its rate, its standard deviation, and what they
        take over, NaN where no detection belongs to the track.
    """
    none = 0 * len(clock)  # what is called with a plain 0 is compiled for it alone
    table, written, start = np.empty((clock.shape[1] + 1, SHARED + len(found) - 2)), none, none
    for frame in range(clock.shape[1]):
        stop = start
        while stop < found.shape[1] and found[0, stop] <= first + frame:
            stop += 1
        here = found[:, start:stop]
        start = stop
        if clock[1, frame] == 0:
            continue  # nobody has looked: neither found nor missed
        step_s, moved_x_m, moved_y_m = advance(carried, clock[:, frame], at)
        _forget(tracks, carried, clock[0, frame] - at[LIVES_S] - CLOCK_S, at)
        for place in range(int(carried[COUNT])):
            track = tracks[place]
            closed_m = moved_x_m * math.cos(track[BEARING]) + moved_y_m * math.sin(track[BEARING])
            predict(track, step_s, at[ACCELERATION], closed_m)
            track[FRAMES] += 1
            track[ROW] = -1

        used = np.empty(here.shape[1], np.bool_)
        for row in range(len(used)):
            used[row] = not math.isfinite(here[1, row])
        confirmed, count = int(carried[CONFIRMED]), int(carried[COUNT])
        _associate(tracks, none, confirmed, here, used, at)
        _associate(tracks, confirmed, count, here, used, at)
        for place in range(count):
            row = int(tracks[place, ROW])
            if row >= 0:
                update(tracks[place], here[1, row], at[VARIANCE])
                _hit(tracks[place], here[:, row], row, carried, at)
        if at[ONE] == 0 or confirmed == 0:
            _start(tracks, carried, here, used, at)
            _confirm(tracks, carried, here, at)

        while written + carried[COUNT] > len(table):
            table = _with_room(table, written)
        written = _write(tracks, carried, here, at, first + frame, table, written)
    return table[:written]
