"""Inner loops of the alignment to a running template of the direct path."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from uwbbench.api import BoolArray, FloatArray, compiled, inlined
from uwbbench_detectors.first_path.fractional import PAD, moved, power_between

TO_TAP, CREST_START, CREST_STOP, LEAD, MEMORY, STEP_M, POWER_RATIO, LEADING, TRAIL = range(9)
"""Settings, by their places."""
SETTINGS = 9
COUNT, PATH_M, X_M, Y_M = range(4)
"""State of a response between frames, by its places: looks that made the template, the path since the last one, and the
robot's place."""
CARRIED = 4
LARGEST_STEP = 0.3
"""Taps that one Gauss-Newton step may move: half a pulse's flank, beyond which the linear model is none."""
REACH = 10
"""Taps that a crest may be moved by."""
FIRST_LOOKS = 4
"""Looks behind which the template is good enough to be fitted."""
TAIL = 16
"""Taps at the end whose power is taken for noise where no taps precede the arrival."""
LEAST = 1e-36
"""Magnitude below which a single-precision frame is empty: its square and its reciprocal are no numbers any more."""


@compiled
def refined(padded: Any, tap: float, rounds: int, table: Any) -> float:
    """Crest near a tap, by parabolas through logarithms on steps of 1/2, 1/5 and 2/25 tap.

    Parameters
    ----------
    padded : (2, taps + 2 PAD) float32 array
    tap : float
    rounds : int
        How many of these steps.
    table : (PHASES + 1, LENGTH) float32 array
    """
    step = 0.5
    for _ in range(rounds):
        before = math.log(power_between(padded, tap - step, table) + 1e-30)
        here = math.log(power_between(padded, tap, table) + 1e-30)
        after = math.log(power_between(padded, tap + step, table) + 1e-30)
        bend = before - 2 * here + after
        if bend < 0:
            tap += max(-step, min(step, 0.5 * (before - after) / bend * step))
        step *= 0.4
    return tap


@inlined
def fitted(shifted: Any, template: Any, start: int, stop: int) -> tuple[float, float, float]:
    """Complex gain g and shift Re(h / g) of ``shifted ~ g T + h T'``, by least squares.

    Parameters
    ----------
    shifted : (2, taps) float32 array
    template : (4, taps) float32 array
        Real and imaginary parts of T, then those of T'.
    start, stop : int
        Taps that are fitted.

    Returns
    -------
    float, float, float
        Shift in taps, real and imaginary part of the gain up to a common factor.
    """
    s00 = s11 = cross_r = cross_i = b0_r = b0_i = b1_r = b1_i = 0.0
    for tap in range(start, stop):
        tr, ti, dr, di = template[0, tap], template[1, tap], template[2, tap], template[3, tap]
        yr, yi = shifted[0, tap], shifted[1, tap]
        s00 += tr * tr + ti * ti
        s11 += dr * dr + di * di
        cross_r += tr * dr + ti * di
        cross_i += tr * di - ti * dr
        b0_r += tr * yr + ti * yi
        b0_i += tr * yi - ti * yr
        b1_r += dr * yr + di * yi
        b1_i += dr * yi - di * yr
    g_r = b0_r * s11 - (cross_r * b1_r - cross_i * b1_i)
    g_i = b0_i * s11 - (cross_r * b1_i + cross_i * b1_r)
    h_r = b1_r * s00 - (cross_r * b0_r + cross_i * b0_i)
    h_i = b1_i * s00 - (cross_r * b0_i - cross_i * b0_r)
    size = g_r * g_r + g_i * g_i
    return ((h_r * g_r + h_i * g_i) / size if size > 0 else 0.0), g_r, g_i


@inlined
def filled(samples: Any, padded: Any) -> float:
    """Lay a frame between zeros, scaled to a largest part of 1; that part, 0 of an empty frame.

    Parameters
    ----------
    samples : (taps,) complex array
    padded : (2, taps + 2 PAD) float32 array
        Written.
    """
    largest = 0.0
    for tap in range(len(samples)):
        largest = max(largest, abs(samples[tap].real), abs(samples[tap].imag))
    if not LEAST < largest < np.inf:
        return 0.0
    scale = 1.0 / largest
    for tap in range(len(samples)):
        padded[0, PAD + tap] = np.float32(samples[tap].real * scale)
        padded[1, PAD + tap] = np.float32(samples[tap].imag * scale)
    return largest


@inlined
def stands_out(padded: Any, crest: int, at: FloatArray) -> bool:
    """Whether the direct path is far enough above the noise of its frame.

    Parameters
    ----------
    padded : (2, taps + 2 PAD) float32 array
    crest : int
        Tap of the direct path.
    at : (SETTINGS,) array
    """
    taps = padded.shape[1] - 2 * PAD
    leading = int(at[LEADING])
    start, stop = (0, leading) if leading else (max(taps - TAIL, 0), taps)
    power = 0.0
    for tap in range(start, stop):
        power += padded[0, PAD + tap] ** 2 + padded[1, PAD + tap] ** 2
    height = padded[0, PAD + crest] ** 2 + padded[1, PAD + crest] ** 2
    return bool(height * (stop - start) >= power * at[POWER_RATIO])


@compiled
def align_response(
    samples: Any, template: Any, carried: FloatArray, at: FloatArray, table: Any, padded: Any, made: Any
) -> bool:
    """Align one response of one frame to its template, and renew the template.

    Parameters
    ----------
    samples : (taps,) complex array
    template : (4, taps) float32 array
        T and T', changed.
    carried : (CARRIED,) array
        Changed.
    at : (SETTINGS,) array
    table : (PHASES + 1, LENGTH) float32 array
    padded : (2, taps + 2 PAD) float32 array
        Room, zero at both ends.
    made : (2, taps) float32 array
        The aligned response, zero where it was refused.

    Returns
    -------
    bool
        False where the direct path does not stand out of the noise.
    """
    taps = len(samples)
    to_tap, aim = at[TO_TAP], int(at[TO_TAP])
    for tap in range(taps):
        made[0, tap] = made[1, tap] = np.float32(0)
    if filled(samples, padded) == 0:
        return False
    crest, highest = int(at[CREST_START]), -1.0
    for tap in range(int(at[CREST_START]), int(at[CREST_STOP])):
        power = padded[0, PAD + tap] ** 2 + padded[1, PAD + tap] ** 2
        if power > highest:
            crest, highest = tap, power
    if not stands_out(padded, crest, at):
        return False
    settled = carried[COUNT] >= FIRST_LOOKS
    at_tap = refined(padded, float(crest), 1 if settled else 3, table)
    at_tap = max(min(at_tap, to_tap + REACH), to_tap - REACH)
    start, stop = max(aim - int(at[LEAD]), 1), min(aim + int(at[TRAIL]) + 1, taps - 1)
    if settled:
        for _ in range(2):
            moved(padded, at_tap - to_tap, table, start, stop, made)
            shift, _, _ = fitted(made, template, start, stop)
            at_tap -= max(-LARGEST_STEP, min(LARGEST_STEP, shift))
    moved(padded, at_tap - to_tap, table, min(start, 0), taps, made)
    gain_r, gain_i = float(made[0, aim]), float(made[1, aim])
    if settled:
        gain_r = gain_i = size = 0.0
        for place in range(start, stop):
            tr, ti, yr, yi = template[0, place], template[1, place], made[0, place], made[1, place]
            size += tr * tr + ti * ti
            gain_r += tr * yr + ti * yi
            gain_i += tr * yi - ti * yr
        gain_r, gain_i = gain_r / size, gain_i / size
    size = gain_r * gain_r + gain_i * gain_i
    if not size > 0:
        for place in range(taps):
            made[0, place] = made[1, place] = np.float32(0)
        return False
    turn_r, turn_i = np.float32(gain_r / size), np.float32(-gain_i / size)
    for place in range(taps):
        yr, yi = made[0, place], made[1, place]
        made[0, place] = yr * turn_r - yi * turn_i
        made[1, place] = yr * turn_i + yi * turn_r
    if carried[COUNT] < FIRST_LOOKS or carried[PATH_M] > at[STEP_M]:
        carried[PATH_M] = 0
        carried[COUNT] += 1
        share = np.float32(1 / min(carried[COUNT], at[MEMORY]))
        for place in range(start - 1, stop + 1):
            template[0, place] += share * (made[0, place] - template[0, place])
            template[1, place] += share * (made[1, place] - template[1, place])
        for place in range(start, stop):
            template[2, place] = np.float32(0.5) * (template[0, place + 1] - template[0, place - 1])
            template[3, place] = np.float32(0.5) * (template[1, place + 1] - template[1, place - 1])
    return True


@inlined
def path_since(place_m: Any, carried: FloatArray) -> None:
    """Add the way from the robot's last place, which is renewed; nothing at the first.

    Parameters
    ----------
    place_m : (3,) array
    carried : (CARRIED,) array
    """
    way_m = math.hypot(place_m[0] - carried[X_M], place_m[1] - carried[Y_M])
    if way_m == way_m:
        carried[PATH_M] += way_m
    if place_m[0] + place_m[1] == place_m[0] + place_m[1]:
        carried[X_M], carried[Y_M] = place_m[0], place_m[1]


@compiled
def align_frames(
    samples: Any,
    valid: BoolArray,
    place_m: FloatArray,
    template: Any,
    carried: FloatArray,
    at: FloatArray,
    table: Any,
    clear: BoolArray,
) -> Any:
    """Align one response of consecutive frames.

    Parameters
    ----------
    samples : (frames, taps) complex64 array
    valid : (frames,) bool array
    place_m : (frames, 3) array
        Where the robot was.
    template : (4, taps) float32 array
    carried : (CARRIED,) array
        Both carried from block to block.
    at : (SETTINGS,) array
    table : (PHASES + 1, LENGTH) float32 array
    clear : (frames,) bool array
        Written: False for frames that were refused, and are all zero.

    Returns
    -------
    (frames, taps) complex64 array
    """
    frames, taps = samples.shape
    aligned = np.zeros((frames, taps), np.complex64)
    padded, made = np.zeros((2, taps + 2 * PAD), np.float32), np.zeros((2, taps), np.float32)
    for frame in range(frames):
        clear[frame] = False
        if not valid[frame]:
            continue
        path_since(place_m[frame], carried)
        clear[frame] = align_response(samples[frame], template, carried, at, table, padded, made)
        for tap in range(taps):
            aligned[frame, tap] = complex(made[0, tap], made[1, tap])
    return aligned
