"""Inner loops of the map of fixed objects."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import BoolArray, FloatArray, IntArray, compiled, inlined
from uwbbench_detectors.position.wrap import wrapped
from uwbbench_detectors.tracks import fixed_layout as lay


@inlined
def seen_from(objects: FloatArray, count: int, eye: tuple[float, float, float]) -> None:
    """Range and azimuth of each object from the receiver.

    Parameters
    ----------
    objects : (MOST, FIELDS) array
        Changed.
    count : int
    eye : (3,) floats
        Place and heading of the receiver.
    """
    for place in range(count):
        item = objects[place]
        off_x, off_y = item[lay.X_M] - eye[0], item[lay.Y_M] - eye[1]
        item[lay.RANGE] = math.hypot(off_x, off_y)
        item[lay.AZIMUTH] = wrapped(math.atan2(off_y, off_x) - eye[2])
        item[lay.ROW], item[lay.NEWS] = -1, 0


@inlined
def distance(item: FloatArray, row: FloatArray, eye_rad: float, at: FloatArray) -> float:
    """Squared distance of a detection from an object, in standard deviations of their difference.

    Parameters
    ----------
    item : (FIELDS,) array
    row : (GIVEN,) array
    eye_rad : float
        Heading of the receiver.
    at : (SETTINGS,) array
    """
    range_m = max(item[lay.RANGE], 0.1)
    heading = item[lay.AZIMUTH] + eye_rad
    cosine, sine = math.cos(heading), math.sin(heading)
    along = cosine * cosine * item[lay.XX] + 2 * cosine * sine * item[lay.XY] + sine * sine * item[lay.YY]
    across = sine * sine * item[lay.XX] - 2 * cosine * sine * item[lay.XY] + cosine * cosine * item[lay.YY]
    off_m = row[lay.DETECTED_M] - item[lay.RANGE]
    off_rad = wrapped(row[lay.DETECTED_RAD] - item[lay.AZIMUTH])
    in_range = off_m * off_m / (along + at[lay.RANGE_VARIANCE])
    return float(in_range + off_rad * off_rad / (across / (range_m * range_m) + at[lay.AZIMUTH_VARIANCE]))


@inlined
def renewed(item: FloatArray, row: FloatArray, eye: tuple[float, float, float], at: FloatArray) -> None:
    """Kalman update of an object's place by range and azimuth, one after the other.

    Parameters
    ----------
    item : (FIELDS,) array
        Changed.
    row : (GIVEN,) array
    eye : (3,) floats
    at : (SETTINGS,) array
    """
    for part in range(2):
        off_x, off_y = item[lay.X_M] - eye[0], item[lay.Y_M] - eye[1]
        range_m = max(math.hypot(off_x, off_y), 0.1)
        if part == 0:
            h_x, h_y, variance = off_x / range_m, off_y / range_m, at[lay.RANGE_VARIANCE]
            off = row[lay.DETECTED_M] - range_m
        else:
            h_x, h_y = -off_y / (range_m * range_m), off_x / (range_m * range_m)
            variance = at[lay.AZIMUTH_VARIANCE]
            off = wrapped(row[lay.DETECTED_RAD] + eye[2] - math.atan2(off_y, off_x))
        to_x, to_y = item[lay.XX] * h_x + item[lay.XY] * h_y, item[lay.XY] * h_x + item[lay.YY] * h_y
        size = h_x * to_x + h_y * to_y + variance
        item[lay.X_M] += to_x / size * off
        item[lay.Y_M] += to_y / size * off
        item[lay.XX] -= to_x * to_x / size
        item[lay.XY] -= to_x * to_y / size
        item[lay.YY] -= to_y * to_y / size


@inlined
def born(item: FloatArray, row: FloatArray, eye: tuple[float, float, float], at: FloatArray) -> None:
    """A new object where a detection lies.

    Parameters
    ----------
    item : (FIELDS,) array
        Written.
    row : (GIVEN,) array
    eye : (3,) floats
    at : (SETTINGS,) array
    """
    heading, range_m = row[lay.DETECTED_RAD] + eye[2], row[lay.DETECTED_M]
    cosine, sine = math.cos(heading), math.sin(heading)
    along, across = at[lay.RANGE_VARIANCE], at[lay.AZIMUTH_VARIANCE] * range_m * range_m
    item[:] = 0
    item[lay.X_M], item[lay.Y_M] = eye[0] + range_m * cosine, eye[1] + range_m * sine
    item[lay.XX] = cosine * cosine * along + sine * sine * across
    item[lay.XY] = cosine * sine * (along - across)
    item[lay.YY] = sine * sine * along + cosine * cosine * across
    item[lay.RANGE], item[lay.AZIMUTH] = range_m, row[lay.DETECTED_RAD]
    item[lay.EVIDENCE], item[lay.NUMBER], item[lay.NEWS] = at[lay.BIRTH], -1, 1


@inlined
def kept(objects: FloatArray, count: int, at: FloatArray) -> int:
    """Drop what is not there, and of two in one place the less certain; how many are left.

    Parameters
    ----------
    objects : (MOST, FIELDS) array
        Changed.
    count : int
    at : (SETTINGS,) array
    """
    left = 0
    for place in range(count):
        item = objects[place]
        stays = item[lay.EVIDENCE] > at[lay.FORGOTTEN]
        for other in range(count):
            if not stays:
                break
            one = objects[other]
            better = one[lay.EVIDENCE] > item[lay.EVIDENCE] or (
                one[lay.EVIDENCE] == item[lay.EVIDENCE] and other < place
            )
            if other != place and better and one[lay.NUMBER] != -2:
                off_m = math.hypot(one[lay.X_M] - item[lay.X_M], one[lay.Y_M] - item[lay.Y_M])
                stays = off_m >= at[lay.APART_M]
        if not stays:
            item[lay.NUMBER] = -2
    for place in range(count):
        if objects[place, lay.NUMBER] != -2:
            if left < place:
                for field in range(lay.FIELDS):
                    objects[left, field] = objects[place, field]
            left += 1
    return left


@inlined
def least(item: FloatArray, at: FloatArray) -> float:
    """Log odds from which on an object is shown: more where it is not measured."""
    return float(at[lay.SHOWN] if item[lay.NEWS] == 1 else at[lay.HOLDS])


@inlined
def behind_mirror(objects: FloatArray, count: int, place: int, at: FloatArray) -> bool:
    """Whether an object lies behind the plane of a nearer one that reflects more, and may be its image.

    Parameters
    ----------
    objects : (MOST, FIELDS) array
    count, place : int
    at : (SETTINGS,) array
    """
    item = objects[place]
    for other in range(count):
        one = objects[other]
        nearer = one[lay.RANGE] < item[lay.RANGE] - at[lay.APART_M]
        stronger = one[lay.AMPLITUDE] >= item[lay.AMPLITUDE] * at[lay.MIRROR]
        if nearer and stronger and one[lay.EVIDENCE] >= least(one, at):
            along_m = item[lay.RANGE] * math.cos(one[lay.AZIMUTH] - item[lay.AZIMUTH])
            if along_m > one[lay.RANGE] - at[lay.PLANE_M]:
                return True
    return False


@compiled
def followed(
    objects: FloatArray,
    carried: FloatArray,
    found: FloatArray,
    place_m: FloatArray,
    yaw_rad: float,
    at: FloatArray,
    rows: FloatArray,
) -> int:
    """Rows of one frame, after its detections have been taken.

    Parameters
    ----------
    objects : (MOST, FIELDS) array
        Changed.
    carried : (CARRIED,) array
        Changed.
    found : (n, GIVEN) array
        Detections of the frame; their first column is overwritten.
    place_m : (3,) array
    yaw_rad : float
    at : (SETTINGS,) array
    rows : (MOST, COLUMNS + 1) array
        Written.

    Returns
    -------
    int
    """
    cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
    eye = (
        place_m[0] + cosine * at[lay.MOUNT_X] - sine * at[lay.MOUNT_Y],
        place_m[1] + sine * at[lay.MOUNT_X] + cosine * at[lay.MOUNT_Y],
        yaw_rad + at[lay.MOUNT_RAD],
    )
    way_m = math.hypot(place_m[0] - carried[lay.PLACE_X], place_m[1] - carried[lay.PLACE_Y])
    if not carried[lay.BEGUN]:
        carried[lay.BEGUN], way_m = 1, 0.0
    moves = way_m >= at[lay.STEP_M]
    count = int(carried[lay.COUNT])
    if moves:
        carried[lay.WAY_M] += way_m
    if moves or count == 0:
        carried[lay.PLACE_X], carried[lay.PLACE_Y] = place_m[0], place_m[1]
    seen_from(objects, count, eye)
    if moves:
        look = min(way_m / at[lay.LOOK_M], 1.0)
        for place in range(count):
            objects[place, lay.XX] += at[lay.WANDER] * way_m
            objects[place, lay.YY] += at[lay.WANDER] * way_m
        # The nearest pair first, until none is near enough.
        for row in range(len(found)):
            found[row, lay.FRAME] = -1.0
        while True:
            nearest, which, whom = at[lay.GATE], -1, -1
            for place in range(count):
                if objects[place, lay.ROW] >= 0:
                    continue
                for row in range(len(found)):
                    if found[row, lay.FRAME] >= 0 or found[row, lay.DETECTED_HELD] != 0:
                        continue
                    off = distance(objects[place], found[row], eye[2], at)
                    if off < nearest:
                        nearest, which, whom = off, place, row
            if which < 0:
                break
            objects[which, lay.ROW], found[whom, lay.FRAME] = whom, which
        for place in range(count):
            item = objects[place]
            if item[lay.ROW] >= 0:
                row = found[int(item[lay.ROW])]
                renewed(item, row, eye, at)
                item[lay.EVIDENCE] = min(item[lay.EVIDENCE] + look * at[lay.HIT], at[lay.MOST_EVIDENCE])
                item[lay.NEWS] = 1
                item[lay.SEEN_M] = carried[lay.WAY_M]
            elif abs(item[lay.AZIMUTH]) < at[lay.LOOKS_RAD] and at[lay.NEAR_M] < item[lay.RANGE] < at[lay.FAR_M]:
                item[lay.EVIDENCE] += look * at[lay.MISS]
        for row in range(len(found)):
            taken = found[row, lay.FRAME] >= 0 or found[row, lay.DETECTED_HELD] != 0
            if not taken and found[row, lay.DETECTED_M] > 0 and np.isfinite(found[row, lay.DETECTED_RAD]):
                if count == lay.MOST:
                    continue
                born(objects[count], found[row], eye, at)
                objects[count, lay.ROW], objects[count, lay.SEEN_M] = row, carried[lay.WAY_M]
                count += 1
        for place in range(count):
            item = objects[place]
            if item[lay.NEWS] == 1:
                row = found[int(item[lay.ROW])]
                off_x, off_y = item[lay.X_M] - eye[0], item[lay.Y_M] - eye[1]
                item[lay.RANGE] = math.hypot(off_x, off_y)
                item[lay.AZIMUTH] = wrapped(math.atan2(off_y, off_x) - eye[2])
                item[lay.OFF_M] = row[lay.DETECTED_M] - item[lay.RANGE]
                item[lay.SCORE_DB] = row[lay.DETECTED_DB]
                item[lay.AMPLITUDE] = row[lay.DETECTED_AMPLITUDE] * row[lay.DETECTED_M]
        count = kept(objects, count, at)
        carried[lay.COUNT] = count
    written = 0
    for place in range(count):
        item = objects[place]
        if not item[lay.EVIDENCE] >= least(item, at) or behind_mirror(objects, count, place, at):
            continue
        if item[lay.NUMBER] < 0:
            item[lay.NUMBER] = carried[lay.NEXT]
            carried[lay.NEXT] += 1
        range_m = item[lay.RANGE] + item[lay.OFF_M]
        if abs(item[lay.AZIMUTH]) > at[lay.VIEW_RAD] or not at[lay.NEAR_M] <= range_m <= at[lay.FAR_M]:
            continue
        line = rows[written]
        written += 1
        line[1], line[2] = range_m, item[lay.AZIMUTH]
        line[3], line[4] = item[lay.AMPLITUDE] / range_m, item[lay.SCORE_DB]
        line[5] = 0.0 if item[lay.NEWS] == 1 else 1.0
        line[6], line[7] = item[lay.NUMBER], 1 / (1 + math.exp(-item[lay.EVIDENCE]))
    return written


@compiled
def follow(
    objects: FloatArray,
    carried: FloatArray,
    found: FloatArray,
    starts: IntArray,
    looked: BoolArray,
    place_m: FloatArray,
    yaw_rad: FloatArray,
    first: int,
    at: FloatArray,
) -> FloatArray:
    """Rows of consecutive frames.

    Parameters
    ----------
    objects : (MOST, FIELDS) array
    carried : (CARRIED,) array
        Both carried from block to block.
    found : (n, GIVEN) array
        Detections by frame; their frames are counted from the first of the block, and overwritten.
    starts : (frames + 1,) int array
        First detection of each frame.
    looked : (frames,) bool array
        Frames that were looked at.
    place_m, yaw_rad : (frames, 3) and (frames,) array
    first : int
        Index of the first frame.
    at : (SETTINGS,) array

    Returns
    -------
    (rows, 1 + COLUMNS) array
        Frames and tracks by their bits.
    """
    rows = np.zeros((lay.MOST, lay.COLUMNS + 1))
    table, written = np.empty((max(4 * len(looked), lay.MOST), lay.COLUMNS + 1)), 0
    for frame in range(len(looked)):
        if not looked[frame]:
            continue
        count = followed(
            objects, carried, found[starts[frame] : starts[frame + 1]], place_m[frame], yaw_rad[frame], at, rows
        )
        if written + count > len(table):
            larger = np.empty((2 * len(table), table.shape[1]))
            larger[:written] = table[:written]
            table = larger
        index = table.view(np.int64)
        for row in range(count):
            table[written] = rows[row]
            index[written, 0] = first + frame
            index[written, 6] = np.int64(rows[row, 6])
            written += 1
    return table[:written].copy()
