"""Inner loops of the Doppler-range bank."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from uwbbench.api import BoolArray, FloatArray, compiled, inlined
from uwbbench_detectors.integrate import bank_layout as lay
from uwbbench_detectors.integrate.fuse_loops import noise_power
from uwbbench_detectors.position.wrap import wrapped

ROOM = 4
"""Zeros before and behind a response, for samples between its taps."""
WAY_M = 0.02
"""Over which the direction of the way is smoothed: jitter of an odometry is a fraction of a millimetre a frame."""


@inlined
def motion(place_m: Any, yaw_rad: float, carried: FloatArray, at: FloatArray) -> tuple[float, float]:
    """Signed way of the antennas' middle since the last frame that was added, and the turn of the way.

    The direction of the way is smoothed in the frame of the robot, as a robot on wheels drives along a line of its
    own, forth and back. The state is renewed if the way is long enough to be added.

    Parameters
    ----------
    place_m : (3,) array
    yaw_rad : float
    carried : (CARRIED,) array
        Changed.
    at : (SETTINGS,) array

    Returns
    -------
    float, float
        Way in metres, 0 where it is too short; turn in radians since the last frame that was added.
    """
    cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
    x_m = place_m[0] + cosine * at[lay.MIDDLE_X] - sine * at[lay.MIDDLE_Y]
    y_m = place_m[1] + sine * at[lay.MIDDLE_X] + cosine * at[lay.MIDDLE_Y]
    if not carried[lay.STARTED]:
        carried[lay.STARTED] = 1
        carried[lay.X_M], carried[lay.Y_M], carried[lay.HEADING_RAD] = x_m, y_m, yaw_rad
        return 0.0, 0.0
    step_x, step_y = x_m - carried[lay.X_M], y_m - carried[lay.Y_M]
    forth, left = cosine * step_x + sine * step_y, cosine * step_y - sine * step_x
    step_m = math.hypot(forth, left)
    if step_m >= at[lay.STEP_M]:
        back = forth * carried[lay.WAY_X] + left * carried[lay.WAY_Y] < 0
        keep, sign = math.exp(-step_m / WAY_M), -1.0 if back else 1.0
        carried[lay.WAY_X] = keep * carried[lay.WAY_X] + sign * forth
        carried[lay.WAY_Y] = keep * carried[lay.WAY_Y] + sign * left
    size = math.hypot(carried[lay.WAY_X], carried[lay.WAY_Y])
    heading = yaw_rad + (math.atan2(carried[lay.WAY_Y], carried[lay.WAY_X]) if size > 0 else 0.0)
    turn = abs(wrapped(heading - carried[lay.HEADING_RAD]))
    if not step_m >= at[lay.STEP_M]:
        return 0.0, turn
    carried[lay.X_M], carried[lay.Y_M], carried[lay.HEADING_RAD] = x_m, y_m, heading
    return (forth * carried[lay.WAY_X] + left * carried[lay.WAY_Y]) / size, turn


@inlined
def slid(sums: Any, by: int) -> None:
    """Move the sums of one hypothesis by whole taps towards the radar; away from it where negative."""
    taps = sums.shape[1]
    for channel in range(sums.shape[0]):
        line = sums[channel]
        if by > 0:
            for tap in range(max(taps - by, 0)):
                line[tap] = line[tap + by]
            for tap in range(max(taps - by, 0), taps):
                line[tap] = np.float32(0)
        elif by < 0:
            for tap in range(taps - 1, min(-by, taps) - 1, -1):
                line[tap] = line[tap + by]
            for tap in range(min(-by, taps)):
                line[tap] = np.float32(0)


@compiled
def added(
    channels: Any, way_m: float, keep: float, cosines: FloatArray, sums: Any, come: FloatArray, at: FloatArray
) -> None:
    """Add a frame to the sums of all hypotheses.

    Parameters
    ----------
    channels : (2 or 4, taps + 2 ROOM) float32 array
        Real and imaginary parts of each channel.
    way_m : float
        Signed.
    keep : float
        What is left of the sums so far.
    cosines : (bins,) array
    sums : (bins, 2 or 4, taps) float32 array
        Changed.
    come : (bins,) array
        Taps by which a target of each hypothesis has come nearer; changed.
    at : (SETTINGS,) array
    """
    taps = sums.shape[2]
    left = np.float32(keep)
    for place in range(len(cosines)):
        before = math.floor(come[place])
        come[place] += way_m * cosines[place] / at[lay.TAP_M]
        whole = math.floor(come[place])
        if whole != before:
            slid(sums[place], int(whole - before))
        late = come[place] - whole
        mu = 1 - late
        w0, w1 = np.float32(-mu * (mu - 1) * (mu - 2) / 6), np.float32((mu + 1) * (mu - 1) * (mu - 2) / 2)
        w2, w3 = np.float32(-(mu + 1) * mu * (mu - 2) / 2), np.float32((mu + 1) * mu * (mu - 1) / 6)
        angle = -at[lay.PHASE_RAD_M] * at[lay.TAP_M] * come[place]
        turn_r, turn_i = np.float32(math.cos(angle)), np.float32(math.sin(angle))
        for channel in range(0, sums.shape[1], 2):
            real, imaginary = channels[channel], channels[channel + 1]
            sum_r, sum_i = sums[place, channel], sums[place, channel + 1]
            for tap in range(taps):
                re = w0 * real[tap + 2] + w1 * real[tap + 3] + w2 * real[tap + 4] + w3 * real[tap + 5]
                im = w0 * imaginary[tap + 2] + w1 * imaginary[tap + 3]
                im += w2 * imaginary[tap + 4] + w3 * imaginary[tap + 5]
                sum_r[tap] = left * sum_r[tap] + (turn_r * re - turn_i * im)
                sum_i[tap] = left * sum_i[tap] + (turn_r * im + turn_i * re)


@compiled
def powers(sums: Any, per_noise: Any, power: Any) -> None:
    """Power of each sum over that of its noise, added over the channels.

    Parameters
    ----------
    sums : (bins, 2 or 4, taps) float32 array
    per_noise : (1 or 2, taps) float32 array
        One over the power of the noise in a sum of each channel.
    power : (bins, taps) float32 array
        Written.
    """
    taps = sums.shape[2]
    for place in range(sums.shape[0]):
        into, real, imaginary, scale = power[place], sums[place, 0], sums[place, 1], per_noise[0]
        for tap in range(taps):
            into[tap] = (real[tap] * real[tap] + imaginary[tap] * imaginary[tap]) * scale[tap]
        if sums.shape[1] > 2:
            real, imaginary, scale = sums[place, 2], sums[place, 3], per_noise[1]
            for tap in range(taps):
                into[tap] += (real[tap] * real[tap] + imaginary[tap] * imaginary[tap]) * scale[tap]


@inlined
def vertex(before: float, here: float, after: float) -> float:
    """Vertex of the parabola through the logarithms of three powers, in steps from the middle, at most one.

    Parameters
    ----------
    before, here, after : float
    """
    before, here, after = math.log(before + 1e-30), math.log(here + 1e-30), math.log(after + 1e-30)
    bend = before - 2 * here + after
    return max(-1.0, min(1.0, 0.5 * (before - after) / bend)) if bend < 0 else 0.0


@inlined
def highest_of(power: Any, tap: int) -> float:
    """Highest of three powers around a tap."""
    return float(max(power[tap - 1], power[tap], power[tap + 1]))


@compiled
def maxima(
    power: Any,
    sums: Any,
    cosines: FloatArray,
    come: FloatArray,
    carried: FloatArray,
    at: FloatArray,
    motion_rad: float,
    rows: FloatArray,
) -> int:
    """Rows of the local maxima over range and cosine.

    Parameters
    ----------
    power : (bins, taps) float32 array
    sums : (bins, 2 or 4, taps) float32 array
    cosines, come : (bins,) array
    carried : (CARRIED,) array
    at : (SETTINGS,) array
    motion_rad : float
        Direction of the motion in the frame of the receiver.
    rows : (MOST, COLUMNS) array
        Written.

    Returns
    -------
    int
        Rows; where there are more than fit, those of the first hypotheses.
    """
    bins, taps = power.shape
    count, least = 0, np.float32(at[lay.LEAST_POWER])
    spread = at[lay.WAVE] / carried[lay.PATH_M]
    for place in range(bins):
        late = come[place] - math.floor(come[place])
        line = power[place]
        for tap in range(max(int(at[lay.TO_TAP] + at[lay.GUARD]), 1), taps - 2):
            here = line[tap]
            if not here >= least or here < line[tap - 1] or here <= line[tap + 1] or count >= len(rows):
                continue
            if place > 0 and highest_of(power[place - 1], tap) > here:
                continue
            if place < bins - 1 and highest_of(power[place + 1], tap) >= here:
                continue
            row = rows[count]
            count += 1
            row[lay.TAP] = tap - late + vertex(line[tap - 1], here, line[tap + 1])
            row[lay.COSINE] = cosines[place]
            if 0 < place < bins - 1:
                shift = vertex(highest_of(power[place - 1], tap), here, highest_of(power[place + 1], tap))
                row[lay.COSINE] += max(-0.5, min(0.5, shift)) * (cosines[1] - cosines[0])
            row[lay.SCORE_DB] = 10 * math.log10(here)
            real, imaginary = float(sums[place, 0, tap]), float(sums[place, 1, tap])
            row[lay.AMPLITUDE] = math.hypot(real, imaginary) / carried[lay.WEIGHT]
            row[lay.COSINE_SD], row[lay.MOTION_RAD], row[lay.HELD] = spread, motion_rad, 0.0
            if sums.shape[1] > 2:
                other_r, other_i = float(sums[place, 2, tap]), float(sums[place, 3, tap])
                phase = math.atan2(other_i * real - other_r * imaginary, other_r * real + other_i * imaginary)
                row[lay.PDOA_RAD] = wrapped(phase + at[lay.DIRECT_RAD])
    return count


@compiled
def bank_frame(
    first: Any,
    second: Any,
    both: bool,
    place_m: Any,
    yaw_rad: float,
    cosines: FloatArray,
    carried: FloatArray,
    noise: FloatArray,
    come: FloatArray,
    sums: Any,
    at: FloatArray,
    channels: Any,
    per_noise: Any,
    power: Any,
    rows: FloatArray,
) -> int:
    """Add one frame and find the maxima; where the robot has not moved, those that were found last.

    Parameters
    ----------
    first, second : (2, taps) float32 array
        Responses of the two antennas.
    both : bool
        Whether there is a second one.
    place_m : (3,) array
    yaw_rad : float
    cosines, carried, noise, come, sums : arrays
        Hypotheses and state.
    at : (SETTINGS,) array
    channels, per_noise, power : arrays
        Room.
    rows : (MOST, COLUMNS) array
        Rows of the last frame that was added; changed.

    Returns
    -------
    int
        Number of rows.
    """
    taps = first.shape[1]
    way_m, turn = motion(place_m, yaw_rad, carried, at)
    if way_m == 0:
        count = int(carried[lay.ROWS])
        for row in range(count):
            rows[row, lay.HELD] = 1.0
        return count if turn <= at[lay.TURN_RAD] else 0
    for part in range(2):
        for tap in range(taps):
            channels[part, ROOM + tap] = first[part, tap]
            if both:
                channels[2 + part, ROOM + tap] = second[part, tap]
    keep = math.exp(-abs(way_m) / at[lay.LENGTH_M] - turn / at[lay.TURN_RAD])
    added(channels, way_m, keep, cosines, sums, come, at)
    carried[lay.SQUARES] = keep * keep * carried[lay.SQUARES] + 1
    carried[lay.WEIGHT] = keep * carried[lay.WEIGHT] + 1
    carried[lay.PATH_M] = keep * carried[lay.PATH_M] + abs(way_m)
    carried[lay.ROWS] = 0
    known = noise_power(first, noise[0]) > 0
    if both:
        known = known and noise_power(second, noise[1]) > 0
    if not known or carried[lay.PATH_M] < at[lay.LEAST_PATH_M]:
        return 0
    fall = math.exp(-1 / at[lay.FLOOR_TAPS])
    for channel in range(len(per_noise)):
        traces = at[lay.FLOOR]
        for tap in range(taps):
            if tap > at[lay.TO_TAP]:
                traces *= fall
            per_noise[channel, tap] = np.float32(1 / ((noise[channel, 0] + traces) * carried[lay.SQUARES]))
    powers(sums, per_noise, power)
    motion_rad = wrapped(carried[lay.HEADING_RAD] - yaw_rad - at[lay.MOUNT_RAD])
    carried[lay.ROWS] = maxima(power, sums, cosines, come, carried, at, motion_rad, rows)
    return int(carried[lay.ROWS])


@compiled
def bank_frames(
    first: Any,
    second: Any,
    both: bool,
    valid: BoolArray,
    place_m: FloatArray,
    yaw_rad: FloatArray,
    start: int,
    cosines: FloatArray,
    carried: FloatArray,
    noise: FloatArray,
    come: FloatArray,
    sums: Any,
    at: FloatArray,
    rows: FloatArray,
) -> FloatArray:
    """Rows of consecutive frames.

    Parameters
    ----------
    first, second : (frames, taps) complex64 array
        Frames whose first response is all zero are passed over.
    both : bool
        Whether the second response is one.
    valid : (frames,) bool array
    place_m, yaw_rad : (frames, 3) and (frames,) array
    start : int
        Index of the first frame.
    cosines : (bins,) array
    carried, noise, come, sums : arrays
        Carried from block to block.
    at : (SETTINGS,) array
    rows : (MOST, COLUMNS) array
        Carried too.

    Returns
    -------
    (rows, COLUMNS) array
        Frames by their bits.
    """
    frames, taps = first.shape
    one, other = np.zeros((2, taps), np.float32), np.zeros((2, taps), np.float32)
    width = sums.shape[1]
    channels, per_noise = np.zeros((width, taps + 2 * ROOM), np.float32), np.zeros((width // 2, taps), np.float32)
    power = np.zeros((len(cosines), taps), np.float32)
    table, written = np.empty((frames * len(rows), rows.shape[1])), 0
    index = table.view(np.int64)
    for frame in range(frames):
        some = False
        for tap in range(taps):
            one[0, tap], one[1, tap] = first[frame, tap].real, first[frame, tap].imag
            other[0, tap], other[1, tap] = second[frame, tap].real, second[frame, tap].imag
            some |= one[0, tap] != 0 or one[1, tap] != 0
        if not valid[frame] or not some:
            continue
        count = bank_frame(
            one,
            other,
            both,
            place_m[frame],
            yaw_rad[frame],
            cosines,
            carried,
            noise,
            come,
            sums,
            at,
            channels,
            per_noise,
            power,
            rows,
        )
        for row in range(count):
            table[written] = rows[row]
            index[written, lay.FRAME] = start + frame
            written += 1
    return table[:written].copy()
