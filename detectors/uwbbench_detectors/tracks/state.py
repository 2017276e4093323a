"""What is known of tracks and of the stream, how it goes on to the next frame, and what a measured range adds."""

from __future__ import annotations

import math

from uwbbench.api import FloatArray, compiled

RANGE, RATE, RANGE_VARIANCE, COVARIANCE, RATE_VARIANCE, HIT_S, BEARING, NUMBER, HITS, FRAMES, ROW = range(11)
"""Columns of the table of tracks.

Range and own rate with their covariance, the time of the last detection and the direction in the world in which it lay,
the track's number (-1 while tentative), detections and frames so far, and the row of its detection in this frame (-1:
none). Confirmed tracks come first, in the order of their numbers.
"""
FIELDS = 11
COUNT, CONFIRMED, NEXT, TIME_S, X_M, Y_M, X_M_S, Y_M_S, BORESIGHT = range(9)
"""Places of what is carried besides: tracks, confirmed ones of them, the next number, and time, place, velocity and
boresight of the receiver."""
CARRIED = 9
(
    ACCELERATION,
    VARIANCE,
    GATE,
    START_RATE_VARIANCE,
    HITS_ASKED,
    FRAMES_ALLOWED,
    LIVES_S,
    ONE,
    NEAREST,
    EMITS_ALL,
    MOUNT_X_M,
    MOUNT_Y_M,
    MOUNT_YAW,
    AZIMUTH,
) = range(14)
"""Places of the settings: acceleration; variance of a range; squared gate; variance of a new track's rate; detections
and frames of the trial; seconds that a track lives without detection; 1 for one track; 1 to start from the nearest; 1
to give out tentative tracks; the receiver's place and boresight on the robot; column of azimuths among the detections
(-1: none)."""
SETTINGS = 14


@compiled
def predict(track: FloatArray, step_s: float, acceleration: float, moved_m: float) -> None:
    """Take a track over to the next frame: constant rate, and an acceleration that is white from frame to frame.

    ``x <- F x``, ``P <- F P F' + Q`` with ``F = [[1, T], [0, 1]]`` and
    ``Q = q^2 [[T^4/4, T^3/2], [T^3/2, T^2]]`` (Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking
    and Navigation, 2001, section 6.3.2).

    Parameters
    ----------
    track : (fields,) array
        Changed.
    step_s : float
        True time T since the last frame.
    acceleration : float
        Standard deviation q in m/s^2.
    moved_m : float
        By which the robot's own motion has shortened the range.
    """
    track[RANGE] += step_s * track[RATE] - moved_m
    drift = acceleration * step_s
    bend = 0.5 * drift * step_s
    covariance = track[COVARIANCE] + step_s * track[RATE_VARIANCE]
    track[RANGE_VARIANCE] += step_s * (track[COVARIANCE] + covariance) + bend * bend
    track[COVARIANCE] = covariance + bend * drift
    track[RATE_VARIANCE] += drift * drift


@compiled
def update(track: FloatArray, range_m: float, variance: float) -> None:
    """Put a measured range with its variance into a track.

    ``K = P H' / S``, ``x <- x + K (z - H x)``, ``P <- P - K H P`` with ``H = [1, 0]``, ``S = H P H' + R``, written so
    that no variance is a difference of nearly equal numbers but that of the rate.

    Parameters
    ----------
    track : (fields,) array
        Changed.
    range_m, variance : float
        z and R.
    """
    spread = track[RANGE_VARIANCE] + variance
    off_m = range_m - track[RANGE]
    track[RANGE] += track[RANGE_VARIANCE] / spread * off_m
    track[RATE] += track[COVARIANCE] / spread * off_m
    track[RATE_VARIANCE] -= track[COVARIANCE] * track[COVARIANCE] / spread
    track[COVARIANCE] *= variance / spread
    track[RANGE_VARIANCE] *= variance / spread


@compiled
def advance(carried: FloatArray, moment: FloatArray, at: FloatArray) -> tuple[float, float, float]:
    """Go on to the next frame: true time since the last one, and how far the receiver has moved in the world.

    Parameters
    ----------
    carried : (CARRIED,) array
        Changed.
    moment : (2,) or (5,) array
        Time, valid, and, where odometry is used, the robot's x, y and yaw.
    at : (SETTINGS,) array
    """
    started = not math.isnan(carried[TIME_S])
    step_s = moment[0] - carried[TIME_S] if started else 0.0
    carried[TIME_S] = moment[0]
    if len(moment) == 2:
        return step_s, 0.0, 0.0
    yaw = moment[4]
    x_m = moment[2] + at[MOUNT_X_M] * math.cos(yaw) - at[MOUNT_Y_M] * math.sin(yaw)
    y_m = moment[3] + at[MOUNT_X_M] * math.sin(yaw) + at[MOUNT_Y_M] * math.cos(yaw)
    moved_x_m, moved_y_m = (x_m - carried[X_M], y_m - carried[Y_M]) if started else (0.0, 0.0)
    carried[X_M], carried[Y_M], carried[BORESIGHT] = x_m, y_m, yaw + at[MOUNT_YAW]
    if step_s > 0:
        carried[X_M_S], carried[Y_M_S] = moved_x_m / step_s, moved_y_m / step_s
    return step_s, moved_x_m, moved_y_m
