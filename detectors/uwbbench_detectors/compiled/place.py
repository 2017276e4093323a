"""From the tap of a peak to phase difference, azimuth, range and position, compiled."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from uwbbench.api import SPEED_OF_LIGHT_M_S, FloatArray, IntArray, compiled, inlined
from uwbbench_detectors.compiled import layout as at


@compiled
def _phase(samples: Any, row: int, tap: float) -> float:
    """Phase of the sample of a row nearest to a tap; NaN outside the window, or where the sample is zero."""
    nearest = math.floor(tap + 0.5)
    if not 0 <= nearest <= samples.shape[1] - 1:
        return float(np.nan)
    sample = samples[row, int(nearest)]
    real, imaginary = np.float64(sample.real), np.float64(sample.imag)
    if real == 0 and imaginary == 0:
        return float(np.nan)
    return math.atan2(imaginary, real)


@compiled
def phase_difference(
    first: Any, second: Any, row: int, taps: tuple[float, float], wrapped_above: bool, offset_rad: float
) -> float:
    """Phase of the second response of a row less that of the first, each at its own tap, wrapped.

    Parameters
    ----------
    first, second : (frames, taps) complex arrays
    row : int
    taps : (float, float)
        Where the first and the second response are read, each at the nearest sample.
    wrapped_above : bool
        Wrap into (-pi, pi] instead of [-pi, pi).
    offset_rad : float
        Added before it is wrapped.

    Returns
    -------
    float
        Radians; NaN where a tap lies outside the window, or its sample is zero.
    """
    alpha = _phase(second, row, taps[1]) - _phase(first, row, taps[0]) + offset_rad
    if wrapped_above:
        alpha = -alpha
    wrapped = (alpha + math.pi) % (2 * math.pi) - math.pi
    if wrapped >= math.pi:
        wrapped = -math.pi
    return -wrapped if wrapped_above else wrapped


@compiled
def azimuth_of(pdoa_rad: float, limits: FloatArray) -> float:
    """Azimuth by the arcsine of the scaled phase difference."""
    ratio = (limits[at.ANGLE_SIGN] * pdoa_rad - limits[at.PDOA_BIAS]) / limits[at.SINE_DIVISOR]
    if math.isnan(ratio):  # min and max would turn it into a limit
        return float(np.nan)
    return float(math.asin(min(max(ratio, -1.0), 1.0)) / limits[at.ANGLE_DIVISOR] - limits[at.ANGLE_BIAS])


@inlined
def range_of(delay_s: float, azimuth_rad: float, how: IntArray, limits: FloatArray) -> float:
    """Bistatic range, as uwbbench.api.geometry has it; boresight where the azimuth is not known.

    Parameters
    ----------
    delay_s : float
        Delay after the first path.
    azimuth_rad : float
        From boresight, positive to the left; NaN if not known.
    how, limits : tuple
        Settings, laid out as in :mod:`uwbbench_detectors.compiled.layout`.

    Returns
    -------
    float
        Metres from the receiver; NaN where the path is shorter than the baseline.
    """
    cosine, sine = 1.0, 0.0
    if not math.isnan(azimuth_rad):
        cosine, sine = math.cos(azimuth_rad), math.sin(azimuth_rad)
    excess = (delay_s * limits[at.SPEED_RATIO]) * SPEED_OF_LIGHT_M_S - limits[at.EXCESS_OFFSET_M]
    length = limits[at.BASELINE_LENGTH]
    if excess == 0:
        return float(0.0 - limits[at.RANGE_BIAS])
    if not excess > 0:
        return float(np.nan)
    if how[at.RANGED] == at.RANGED_EXACT:
        ahead = cosine * limits[at.BASELINE_X] + sine * limits[at.BASELINE_Y]
        path = excess + (length - ahead)
    else:
        path = excess + length * (1 + sine)
    return float(excess * (excess + 2 * length) / (2 * path) - limits[at.RANGE_BIAS])


@compiled
def position_of(
    range_m: float, azimuth_rad: float, robot_m: FloatArray, yaw_rad: float, limits: FloatArray
) -> tuple[float, float]:
    """World coordinates of a target at a range and azimuth from a receiver mounted on a robot.

    Parameters
    ----------
    range_m : float
        From the receiver.
    azimuth_rad : float
        From boresight, positive to the left.
    robot_m : (3,) array
        Position of the robot in the world.
    yaw_rad : float
        Heading of the robot.
    limits : tuple
        Settings with the receiver's mount, laid out as in :mod:`uwbbench_detectors.compiled.layout`.

    Returns
    -------
    x, y : float
        Metres.
    """
    cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
    x = robot_m[0] + (cosine * limits[at.MOUNT_X] - sine * limits[at.MOUNT_Y])
    y = robot_m[1] + (sine * limits[at.MOUNT_X] + cosine * limits[at.MOUNT_Y])
    heading = yaw_rad + limits[at.MOUNT_YAW] + azimuth_rad
    return x + range_m * math.cos(heading), y + range_m * math.sin(heading)
