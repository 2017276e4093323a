"""All steps of a moving radar's chain on one frame after the other."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from uwbbench.api import BoolArray, FloatArray, IntArray, compiled, inlined
from uwbbench_detectors.clutter.robot_loops import without_robot
from uwbbench_detectors.filters.sidelobe_loops import masked
from uwbbench_detectors.first_path.fractional import PAD
from uwbbench_detectors.first_path.template_loops import align_response, path_since
from uwbbench_detectors.integrate import bank_layout as lay
from uwbbench_detectors.integrate.bank_loops import ROOM, bank_frame
from uwbbench_detectors.integrate.fuse_loops import weighted
from uwbbench_detectors.position.doppler_phase_loops import STEPS, joint_angle
from uwbbench_detectors.position.mirror_loops import INTERVAL_S, mirror_range
from uwbbench_detectors.smooth.matched_loops import matched
from uwbbench_detectors.tracks import fixed_layout as fixed
from uwbbench_detectors.tracks.fixed_loops import followed

ROBOT, FUSES, MATCHES, SECOND, MASKS, ANGLES, RANGES, FOLLOWS = range(8)
SWITCHES = 8
"""Which of the steps there are."""
WIDEST_RAD, MOST_COST, LEAST_REFLECTION = range(3)
LIMITS = 3
"""Limits of the filters, infinite where there is none."""
AZIMUTH_RAD, ANGLE_COST, MIDDLE_RAD, DELAY_S, RANGE_M = range(lay.COLUMNS, lay.COLUMNS + 5)
COLUMNS = lay.COLUMNS + 5
"""Columns behind those of the bank."""


@inlined
def some(plane: Any) -> bool:
    """Whether any sample is not zero."""
    for tap in range(plane.shape[1]):  # noqa: SIM110  (what numba compiles)
        if plane[0, tap] != 0 or plane[1, tap] != 0:
            return True
    return False


@compiled
def located(
    rows: FloatArray,
    count: int,
    switches: IntArray,
    limits: FloatArray,
    at_lobes: FloatArray,
    fan: FloatArray,
    at_angle: FloatArray,
    at_mirror: FloatArray,
    to_tap: float,
    given: FloatArray,
    cost: FloatArray,
    left: FloatArray,
) -> int:
    """Mask, angle, range and filters of the rows of one frame.

    Parameters
    ----------
    rows : (MOST, bank columns) array
    count : int
    switches, limits : arrays
    at_lobes, fan, at_angle, at_mirror : arrays
        Settings of the steps.
    to_tap : float
        Tap of the direct path.
    given, cost : arrays
        Room.
    left : (MOST, COLUMNS) array
        Written.

    Returns
    -------
    int
        Rows left.
    """
    kept = 0
    for row in range(count):
        one = rows[row]
        if switches[MASKS] and masked(
            rows[:, lay.TAP], rows[:, lay.SCORE_DB], rows[:, lay.COSINE], rows[:, lay.COSINE_SD], row, count, at_lobes
        ):
            continue
        line = left[kept]
        for column in range(lay.COLUMNS):
            line[column] = one[column]
        line[AZIMUTH_RAD] = line[MIDDLE_RAD] = np.nan
        if switches[ANGLES]:
            given[0], given[1], given[2] = one[lay.TAP] - to_tap, one[lay.SCORE_DB], one[lay.COSINE]
            given[3], given[4], given[5] = one[lay.COSINE_SD], one[lay.MOTION_RAD], one[lay.PDOA_RAD]
            along = math.cos(given[4]), math.sin(given[4])
            line[AZIMUTH_RAD], line[MIDDLE_RAD], line[ANGLE_COST] = joint_angle(given, along, fan, at_angle, cost)
            if not (abs(line[AZIMUTH_RAD]) <= limits[WIDEST_RAD] and line[ANGLE_COST] <= limits[MOST_COST]):
                continue
        if switches[RANGES]:
            line[DELAY_S] = (one[lay.TAP] - to_tap) * at_mirror[INTERVAL_S]
            line[RANGE_M] = mirror_range(line[DELAY_S], line[MIDDLE_RAD], at_mirror)
            if limits[LEAST_REFLECTION] > 0 and not one[lay.AMPLITUDE] * line[RANGE_M] >= limits[LEAST_REFLECTION]:
                continue
        kept += 1
    return kept


@compiled
def whole_frames(
    preamble: Any,
    sts1: Any,
    sts2: Any,
    valid: BoolArray,
    place_m: FloatArray,
    yaw_rad: FloatArray,
    first: int,
    switches: IntArray,
    limits: FloatArray,
    templates: Any,
    align_carried: FloatArray,
    at_align: FloatArray,
    between: Any,
    robots: Any,
    robot_carried: FloatArray,
    at_robot: FloatArray,
    fuse_noise: FloatArray,
    pulse: Any,
    cosines: FloatArray,
    bank_carried: FloatArray,
    bank_noise: FloatArray,
    come: FloatArray,
    sums: Any,
    at_bank: FloatArray,
    bank_rows: FloatArray,
    at_lobes: FloatArray,
    fan: FloatArray,
    at_angle: FloatArray,
    at_mirror: FloatArray,
    objects: FloatArray,
    fixed_carried: FloatArray,
    at_fixed: FloatArray,
    refused: BoolArray,
) -> FloatArray:
    """Rows of consecutive frames.

    Parameters
    ----------
    preamble, sts1, sts2 : (frames, taps) complex64 array
        Any array where a response is not used.
    valid : (frames,) bool array
    place_m, yaw_rad : (frames, 3) and (frames,) array
    first : int
        Index of the first frame.
    switches, limits : (SWITCHES,) and (LIMITS,) array
    templates, align_carried, at_align, between : arrays
        Of the alignment; as all that follow, state that is changed, and settings, of the stage that they are of.
    robots, robot_carried, at_robot : arrays
    fuse_noise, pulse : arrays
    cosines, bank_carried, bank_noise, come, sums, at_bank, bank_rows : arrays
    at_lobes, fan, at_angle, at_mirror : arrays
    objects, fixed_carried, at_fixed : arrays
    refused : (1,) bool array
        Set where a response was refused.

    Returns
    -------
    (rows, columns) array
        Of the bank and what follows, or of the map where there is one; frames, and tracks, by their bits.
    """
    frames, taps = preamble.shape
    follows, both = bool(switches[FOLLOWS]), bool(switches[SECOND])
    width = fixed.COLUMNS + 1 if follows else COLUMNS
    table, written = np.empty((max(8 * frames, lay.MOST + fixed.MOST), width)), 0
    padded, planes = np.zeros((2, taps + 2 * PAD), np.float32), np.zeros((3, 2, taps), np.float32)
    room = np.zeros(taps + len(pulse) - 1, np.float32)
    channels = np.zeros((sums.shape[1], taps + 2 * ROOM), np.float32)
    per_noise, power = np.zeros((sums.shape[1] // 2, taps), np.float32), np.zeros((len(cosines), taps), np.float32)
    given, cost = np.empty(6), np.empty(STEPS)
    left, found = np.zeros((lay.MOST, COLUMNS)), np.zeros((lay.MOST, fixed.GIVEN))
    rows = np.zeros((fixed.MOST, fixed.COLUMNS + 1))
    for frame in range(frames):
        if not valid[frame]:
            continue
        for response in range(3):
            if (response == 1 and not switches[FUSES]) or (response == 2 and not both):
                continue
            samples = preamble[frame] if response == 0 else (sts1[frame] if response == 1 else sts2[frame])
            plane, carried = planes[response], align_carried[response]
            path_since(place_m[frame], carried)
            if not align_response(samples, templates[response], carried, at_align, between, padded, plane):
                refused[0] = True
            if switches[ROBOT]:
                path_since(place_m[frame], robot_carried[response])
                if some(plane):
                    without_robot(plane, robots[response], robot_carried[response], at_robot)
        if not some(planes[0]):
            continue
        if switches[FUSES]:
            weighted(planes[0], planes[1], fuse_noise)
        if switches[MATCHES]:
            matched(planes[0], pulse, room)
            if both:
                matched(planes[2], pulse, room)
        count = bank_frame(
            planes[0],
            planes[2],
            both,
            place_m[frame],
            yaw_rad[frame],
            cosines,
            bank_carried,
            bank_noise,
            come,
            sums,
            at_bank,
            channels,
            per_noise,
            power,
            bank_rows,
        )
        count = located(
            bank_rows,
            count,
            switches,
            limits,
            at_lobes,
            fan,
            at_angle,
            at_mirror,
            at_bank[lay.TO_TAP],
            given,
            cost,
            left,
        )
        if follows:
            for row in range(count):
                found[row, fixed.DETECTED_M], found[row, fixed.DETECTED_RAD] = (
                    left[row, RANGE_M],
                    left[row, AZIMUTH_RAD],
                )
                found[row, fixed.DETECTED_AMPLITUDE] = left[row, lay.AMPLITUDE]
                found[row, fixed.DETECTED_DB] = left[row, lay.SCORE_DB]
                found[row, fixed.DETECTED_HELD] = left[row, lay.HELD]
            count = followed(objects, fixed_carried, found[:count], place_m[frame], yaw_rad[frame], at_fixed, rows)
        if written + count > len(table):
            larger = np.empty((2 * len(table), width))
            larger[:written] = table[:written]
            table = larger
        index = table.view(np.int64)
        for row in range(count):
            source = rows[row] if follows else left[row]
            for column in range(1, width):
                table[written, column] = source[column]
            index[written, 0] = first + frame
            if follows:
                index[written, 6] = np.int64(source[6])
            written += 1
    return table[:written].copy()
