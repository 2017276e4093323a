"""Inner loop of the joint angle from Doppler and phase difference."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import FloatArray, compiled
from uwbbench_detectors.position.wrap import wrapped

SLOPE, MIDDLE_X, MIDDLE_Y, TAP_M, BASELINE_M, COSINE_SD, PHASE_SD, LOOSE_SD, BEHIND = range(9)
SETTINGS = 9
"""Settings, by their places."""
STEPS = 72
"""Directions of the search: 5 degrees apart, which both measurements resolve at best."""
NEAREST_M = 0.05
"""Least distance from the middle of the antennas that directions are converted for."""


def directions(behind: float) -> FloatArray:
    """Cosines, sines and costs (3, STEPS) of the directions that are searched.

    Parameters
    ----------
    behind : float
        Cost of those behind the antennas.
    """
    angle = -np.pi + 2 * np.pi * np.arange(STEPS) / STEPS
    cosine = np.cos(angle)
    return np.ascontiguousarray(np.stack([cosine, np.sin(angle), np.where(cosine < 0, behind, 0.0)]))


@compiled
def joint_angle(
    row: FloatArray, along: tuple[float, float], fan: FloatArray, at: FloatArray, cost: FloatArray
) -> tuple[float, float, float]:
    """Direction in which Doppler and phase difference agree best.

    Parameters
    ----------
    row : (6,) array
        Excess delay in taps, score in decibels, cosine to the motion, its resolution, direction of the motion,
        phase difference.
    along : (2,) floats
        Cosine and sine of the direction of the motion.
    fan : (3, STEPS) array
    at : (SETTINGS,) array
    cost : (STEPS,) array
        Room.

    Returns
    -------
    float, float, float
        Azimuth at the receiver, azimuth at the middle of the antennas, and the cost there with the loose phase.
    """
    half_m = max(at[TAP_M] * row[0] + at[BASELINE_M] / 2, NEAREST_M)
    to_cosine = 1 / math.sqrt(at[COSINE_SD] ** 2 + row[3] ** 2)
    of_noise = 10 ** (-row[1] / 10)
    to_phase = 1 / math.sqrt(at[PHASE_SD] ** 2 + of_noise)
    cosines, sines, costs = fan[0], fan[1], fan[2]
    for step in range(STEPS):  # without a branch, so that several directions are worked out at once
        off = (cosines[step] * along[0] + sines[step] * along[1] - row[2]) * to_cosine
        x_m, y_m = at[MIDDLE_X] + half_m * cosines[step], at[MIDDLE_Y] + half_m * sines[step]
        phase = row[5] - at[SLOPE] * y_m / math.sqrt(x_m * x_m + y_m * y_m)
        phase = (phase - 2 * math.pi * np.floor(phase / (2 * math.pi) + 0.5)) * to_phase
        cost[step] = off * off + phase * phase + costs[step]
    best, least = 0, np.inf
    for step in range(STEPS):
        if cost[step] < least:
            best, least = step, cost[step]
    before, after = cost[(best - 1) % STEPS], cost[(best + 1) % STEPS]
    bend = before - 2 * least + after
    shift = max(-0.5, min(0.5, 0.5 * (before - after) / bend)) if bend > 0 else 0.0
    middle = -math.pi + 2 * math.pi * (best + shift) / STEPS
    cosine, sine = math.cos(middle), math.sin(middle)
    off = (cosine * along[0] + sine * along[1] - row[2]) * to_cosine
    x_m, y_m = at[MIDDLE_X] + half_m * cosine, at[MIDDLE_Y] + half_m * sine
    phase = wrapped(row[5] - at[SLOPE] * y_m / math.sqrt(x_m * x_m + y_m * y_m)) / at[LOOSE_SD]
    loose = off * off + phase * phase + (at[BEHIND] if cosine < 0 else 0.0)
    return math.atan2(y_m, x_m), middle, loose


@compiled
def joint_angles(rows: FloatArray, fan: FloatArray, at: FloatArray) -> FloatArray:
    """Azimuth at the receiver and at the middle of the antennas, and cost, of each row.

    Parameters
    ----------
    rows : (n, 6) array
        As :func:`joint_angle` wants each.
    fan : (3, STEPS) array
    at : (SETTINGS,) array

    Returns
    -------
    (3, n) array
    """
    found, cost = np.empty((3, len(rows))), np.empty(STEPS)
    for place in range(len(rows)):
        along = math.cos(rows[place, 4]), math.sin(rows[place, 4])
        found[0, place], found[1, place], found[2, place] = joint_angle(rows[place], along, fan, at, cost)
    return found
