"""Prominence and width of peaks, compiled."""

from __future__ import annotations

import numpy as np

from uwbbench.api import FloatArray, IntArray, compiled


@compiled
def prominence_of(profile: FloatArray, tap: int) -> float:
    """Prominence of one peak, found by looking to both sides until something higher."""
    height = profile[tap]
    left = right = height
    at = tap - 1
    while at >= 0 and profile[at] <= height:
        left = min(left, profile[at])
        at -= 1
    at = tap + 1
    while at < len(profile) and profile[at] <= height:
        right = min(right, profile[at])
        at += 1
    return float(height - max(left, right))


@compiled
def prominences_of(profile: FloatArray, peaks: IntArray) -> FloatArray:
    """Prominences of all peaks (count,), found in one pass to each side.

    A stack holds the peaks that are higher than all between them and the present one. What a peak would have to look
    over, the peaks it takes off the stack have looked over before: the work grows with the taps, however many peaks
    there are, where looking from each peak anew grows with their square on a comb.
    """
    count = len(peaks)
    prominence = np.empty(count)
    higher, lowest = np.empty(count, np.int64), np.empty(count)
    depth = 0
    for place in range(count):
        tap = peaks[place]
        base = profile[tap]
        for at in range(0 if place == 0 else peaks[place - 1], tap):
            base = min(base, profile[at])
        while depth and profile[peaks[higher[depth - 1]]] <= profile[tap]:
            depth -= 1
            base = min(base, lowest[depth])
        higher[depth], lowest[depth] = place, base
        depth += 1
        prominence[place] = base
    depth = 0
    for place in range(count - 1, -1, -1):
        tap = peaks[place]
        base = profile[tap]
        for at in range(tap + 1, len(profile) if place == count - 1 else peaks[place + 1] + 1):
            base = min(base, profile[at])
        while depth and profile[peaks[higher[depth - 1]]] <= profile[tap]:
            depth -= 1
            base = min(base, lowest[depth])
        higher[depth], lowest[depth] = place, base
        depth += 1
        prominence[place] = profile[tap] - max(prominence[place], base)
    return prominence


@compiled
def width_of(profile: FloatArray, tap: int, prominence: float, relative_height: float) -> float:
    """Width in taps of a peak at a share of its prominence below the crest.

    The level lies above the lower ground on either side, so that both searches end inside the profile.

    Parameters
    ----------
    profile : (taps,) array
    tap : int
        Place of the peak in it.
    prominence : float
        In units of the profile.
    relative_height : float
        Share of the prominence, at most 0.9: by rounding, a deeper level could lie below the ground.
    """
    level = profile[tap] - prominence * relative_height
    start = tap
    while profile[start] > level:
        start -= 1
    stop = tap
    while profile[stop] > level:
        stop += 1
    left, right = float(start), float(stop)
    if profile[start] < level:
        left += (level - profile[start]) / (profile[start + 1] - profile[start])
    if profile[stop] < level:
        right -= (level - profile[stop]) / (profile[stop - 1] - profile[stop])
    return right - left
