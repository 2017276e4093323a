"""Inner loops of the track before detection: evidence of each tap, and the best path to each tap."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import BoolArray, FloatArray, IntArray, compiled

(
    TAPS_A_SECOND,
    MEMORY_S,
    FRESH_S,
    START_S,
    LEVEL_S,
    NEUTRAL_DB,
    LOWEST_DB,
    HIGHEST_DB,
    THRESHOLD_DB,
    FRESH_DB,
    DEPTH_TAPS,
    GUARD_TAPS,
) = range(12)
"""Places of the settings: largest speed in taps; times in which a path forgets, as a whole and to be fresh; time at the
start in which the level of each tap is the mean, and time in which it forgets; power over noise that is no evidence;
clips of the evidence; what a path must have gathered, as a whole and freshly; taps about a target in which there is no
other; taps behind the first path that are not looked at."""
SETTINGS = 12
TIME_S, ELAPSED_S, REACH_TAPS = range(3)
"""Places of what is carried besides: time of the last usable frame; time since the first; and the taps that a body may
have gone since the last whole one."""
CARRIED = 3


@compiled
def weigh(
    amplitude: FloatArray, noise: float, start: int, level: FloatArray, gain: float, at: FloatArray
) -> FloatArray:
    """Evidence (taps,) of one frame, less what each tap has shown for long.

    Parameters
    ----------
    amplitude : (taps,) array
    noise : float
        Root mean square of the noise.
    start : int
        First tap that is looked at.
    level : (taps,) array
        Slow mean of the evidence over its lowest; changed.
    gain : float
        Weight of this frame in the level.
    at : (SETTINGS,) array
    """
    evidence = np.full(len(amplitude), at[LOWEST_DB])
    faintest = noise * 10 ** ((at[NEUTRAL_DB] + at[LOWEST_DB]) / 20)
    for tap in range(start, len(amplitude)):
        shown = at[LOWEST_DB]
        if amplitude[tap] > faintest:
            shown = min(20 * math.log10(amplitude[tap] / noise) - at[NEUTRAL_DB], at[HIGHEST_DB])
        evidence[tap] = shown - level[tap]
        level[tap] += gain * (shown - at[LOWEST_DB] - level[tap])
    return evidence


@compiled
def reached(gathered: FloatArray, reach: int) -> FloatArray:
    """Largest value (taps,) within ``reach`` taps of each, doubling the span that is covered."""
    taps = len(gathered)
    span = 2 * reach + 1
    padded = np.zeros(taps + 2 * reach)  # nothing has been gathered outside of the frame
    for tap in range(taps):  # a slice assigned at once would take seconds to compile
        padded[reach + tap] = gathered[tap]
    covered, length = 1, taps + 2 * reach
    while covered < span:
        step = min(covered, span - covered)
        length -= step
        for place in range(length):
            padded[place] = max(padded[place], padded[place + step])
        covered += step
    return padded[:taps]


@compiled
def follow(
    amplitude: FloatArray,
    noise: FloatArray,
    first_path: FloatArray,
    timestamp_s: FloatArray,
    usable: BoolArray,
    gathered: FloatArray,
    fresh: FloatArray,
    level: FloatArray,
    carried: FloatArray,
    at: FloatArray,
) -> tuple[IntArray, IntArray, FloatArray]:
    """Targets of consecutive frames: where the best paths end, as long as there is evidence where they do.

    Parameters
    ----------
    amplitude : (frames, taps) array
    noise, first_path, timestamp_s : (frames,) arrays
    usable : (frames,) bool array
    gathered, fresh : (targets, taps) arrays
        Evidence of the best path to each tap, and of the one that forgets sooner; carried on.
    level : (taps,) array
        What each tap has shown for long; carried on.
    carried : (CARRIED,) array
        Carried on.
    at : (SETTINGS,) array

    Returns
    -------
    row, tap : (n,) int arrays
    score : (n,) array
        What the path has gathered, in dB.
    """
    targets, taps = gathered.shape
    row = np.empty(len(amplitude) * targets, np.int64)
    found_tap = np.empty(len(amplitude) * targets, np.int64)
    score = np.empty(len(amplitude) * targets)
    depth = int(at[DEPTH_TAPS])
    count = 0
    for frame in range(len(amplitude)):
        if not usable[frame]:
            continue
        passed_s = 0.0 if math.isnan(carried[TIME_S]) else timestamp_s[frame] - carried[TIME_S]
        carried[TIME_S] = timestamp_s[frame]
        carried[ELAPSED_S] += passed_s
        learns = -math.expm1(-passed_s / at[LEVEL_S])
        if carried[ELAPSED_S] < at[START_S]:
            learns = passed_s / carried[ELAPSED_S] if carried[ELAPSED_S] > 0 else 1.0
        carried[REACH_TAPS] += at[TAPS_A_SECOND] * passed_s
        reach = int(min(carried[REACH_TAPS], taps - 1.0))
        carried[REACH_TAPS] -= min(math.floor(carried[REACH_TAPS]), carried[REACH_TAPS])
        keeps, stays_fresh = math.exp(-passed_s / at[MEMORY_S]), math.exp(-passed_s / at[FRESH_S])
        start = min(max(math.floor(first_path[frame] + at[GUARD_TAPS]) + 1, 0), taps)
        evidence = weigh(amplitude[frame], noise[frame], start, level, learns, at)
        for target in range(targets):
            best, newest = reached(gathered[target], reach), reached(fresh[target], reach)
            crest = -1
            highest = at[THRESHOLD_DB]
            for tap in range(taps):
                value = max(keeps * best[tap] + evidence[tap], 0.0)
                gathered[target, tap] = value
                fresh[target, tap] = max(stays_fresh * newest[tap] + evidence[tap], 0.0)
                if value > highest:
                    highest = value
                    crest = tap
            if crest < 0:
                continue
            if fresh[target, crest] > at[FRESH_DB] and evidence[crest] > 0:
                row[count] = frame
                found_tap[count] = crest
                score[count] = highest
                count += 1
            for tap in range(max(crest - depth, 0), min(crest + depth + 1, taps)):
                evidence[tap] = at[LOWEST_DB]
    return row[:count].copy(), found_tap[:count].copy(), score[:count].copy()
