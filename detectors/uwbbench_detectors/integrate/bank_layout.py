"""Where the Doppler-range bank keeps its settings, its state and its rows."""

LENGTH_M, TURN_RAD, PHASE_RAD_M, TAP_M, LEAST_POWER, GUARD, STEP_M, LEAST_PATH_M = range(8)
MIDDLE_X, MIDDLE_Y, MOUNT_RAD, DIRECT_RAD, FLOOR, FLOOR_TAPS, TO_TAP, WAVE = range(8, 16)
SETTINGS = 16
"""Settings: integration length; turn that is forgotten over; phase a metre; range a tap; least power; taps behind the
direct path; least way between two frames; least way behind a row; middle of the antennas in the robot frame; heading of
the receiver; phase difference of the direct path; floor of the direct path's own traces and the taps over which it
falls; tap of the direct path; wavelength over 4 pi."""

X_M, Y_M, HEADING_RAD, WAY_X, WAY_Y, SQUARES, WEIGHT, PATH_M, ROWS, STARTED = range(10)
CARRIED = 10
"""State: place of the middle and heading of the way at the last frame that was added; the smoothed way in the robot
frame; sums of the squared and of the plain weights; the way behind the sums; rows of the last frame; 1 once begun."""

FRAME, TAP, AMPLITUDE, SCORE_DB, COSINE, COSINE_SD, MOTION_RAD, HELD, PDOA_RAD = range(9)
COLUMNS = 9
NAMES = ("tap", "amplitude", "score_db", "motion_cosine", "motion_cosine_sd", "motion_rad", "held", "pdoa_rad")
"""Columns of the rows behind their frame; the last is NaN where there is one channel."""

MOST = 64
"""Rows of a frame."""
