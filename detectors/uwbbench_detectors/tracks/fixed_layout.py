"""Where the map of fixed objects keeps its settings, its state and its columns."""

LOOK_M, HIT, MISS, MOST_EVIDENCE, SHOWN, FORGOTTEN, RANGE_VARIANCE, AZIMUTH_VARIANCE = range(8)
WANDER, GATE, APART_M, VIEW_RAD, MOUNT_X, MOUNT_Y, MOUNT_RAD, BIRTH = range(8, 16)
NEAR_M, FAR_M, PLANE_M, STEP_M, HOLDS, MIRROR, LOOKS_RAD = range(16, 23)
SETTINGS = 23

X_M, Y_M, XX, XY, YY, EVIDENCE, AMPLITUDE, SCORE_DB, OFF_M, SEEN_M, NUMBER, ROW, RANGE, AZIMUTH, NEWS = range(15)
FIELDS = 15
"""Of an object: place and its covariance, log odds that it is there, amplitude at one metre and score of its last
detection, by how much that was farther than the place, the way at which it was seen, its number, and of the present
frame the detection, range and azimuth that belong to it, and whether it is new."""

COUNT, PLACE_X, PLACE_Y, WAY_M, NEXT, BEGUN = range(6)
CARRIED = 6
"""State: objects, the robot's place, its way, the next number, 1 once begun."""

FRAME, DETECTED_M, DETECTED_RAD, DETECTED_AMPLITUDE, DETECTED_DB, DETECTED_HELD = range(6)
GIVEN = 6
"""Columns of the detections that are taken."""

NAMES = ("range_m", "azimuth_rad", "amplitude", "score_db", "held", "track", "probability_there")
COLUMNS = 7
MOST = 64
"""Objects that are kept; the least certain gives way."""
