"""Where the compiled search finds its settings, and where it puts its columns.

A compiled function takes arrays, not objects; these are the places in them.
"""

from __future__ import annotations

COLUMNS = (
    "tap",
    "amplitude",
    "prominence",
    "width_taps",
    "score_db",
    "pdoa_rad",
    "azimuth_rad",
    "delay_s",
    "range_m",
    "x_m",
    "y_m",
)
"""Columns of a detection, in the order of the rows of the output table."""
TAP, AMPLITUDE, PROMINENCE, WIDTH, SCORE, PDOA, AZIMUTH, DELAY, RANGE, X, Y = range(len(COLUMNS))

# Whole numbers: how the search goes.
(
    NOISE,  # how the noise is measured, one of the NOISE_ values
    NOISE_TAPS,
    PROFILE,  # what the profile is, one of the PROFILE_ values
    PROFILE_START,
    FIRST_PATH,  # how the first path is found, one of the FIRST_PATH_ values
    CREST_START,
    CREST_STOP,
    SCORED,  # 1 where a score is asked for
    PHASED,  # 1 where the phase difference is asked for
    ALIGNED,  # 1 where STS taps count from each response's own first path
    WRAPPED_ABOVE,  # 1 where the phase difference lies in (-pi, pi]
    SELECT,  # which detections of a frame are retained, one of the SELECT_ values
    COUNT,
    INTERPOLATE,  # one of the INTERPOLATE_ values
    ANGLE,  # 1 where an azimuth is asked for
    RANGED,  # one of the RANGED_ values
    PLACED,  # 1 where a position in the world is asked for
) = range(17)
HOW = 17

NOISE_NONE, NOISE_LEADING, NOISE_TAIL, NOISE_MEDIAN = range(4)
PROFILE_AMPLITUDE, PROFILE_MINMAX, PROFILE_MINMAX_ALL_TAPS = range(3)
FIRST_PATH_GIVEN, FIRST_PATH_FIXED, FIRST_PATH_CREST, FIRST_PATH_INTERPOLATED = range(4)
SELECT_ALL, SELECT_STRONGEST, SELECT_NEAREST = range(3)
INTERPOLATE_NONE, INTERPOLATE_PARABOLA, INTERPOLATE_LOG_PARABOLA = range(3)
RANGED_NONE, RANGED_EXACT, RANGED_SINE = range(3)

# Real numbers: limits and geometry.
(
    FIRST_PATH_TAP,  # where it is fixed
    GUARD_TAPS,
    RELATIVE_HEIGHT,
    LEAST_PROMINENCE,
    LEAST_WIDTH,
    LARGEST_WIDTH,
    LEAST_SCORE,
    LEAST_RATIO,  # amplitude over noise below which no score is enough, wherever the peak lies
    GAIN_DB,  # a unit of delay
    DELAY_UNIT,  # units of delay in a tap
    LARGEST_PDOA,
    PDOA_OFFSET,  # what the geometry adds to responses that are relative to their direct paths
    SINE_DIVISOR,  # phase difference over the argument of the arcsine
    ANGLE_DIVISOR,  # arcsine over azimuth
    ANGLE_SIGN,
    PDOA_BIAS,
    ANGLE_BIAS,
    INTERVAL_S,
    SPEED_RATIO,  # speed assumed over the speed of light
    EXCESS_OFFSET_M,
    BASELINE_X,
    BASELINE_Y,
    BASELINE_LENGTH,
    RANGE_BIAS,
    MOUNT_X,
    MOUNT_Y,
    MOUNT_YAW,
) = range(27)
LIMITS = 27

# Whole numbers counted on from call to call: frames by which the noise was judged, and the suspicious ones of them.
JUDGED, SUSPICIOUS = range(2)
NOISE_TALLY = 2

NEAR = 1e-9
"""A decision that hangs on a logarithm or an angle closer to its limit than this is left to the plain stages."""
