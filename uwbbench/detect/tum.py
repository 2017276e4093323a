"""Trajectories as TUM files, which most programs that map or evaluate read and write.

Conventions
-----------
* A line a pose, ``time tx ty tz qx qy qz qw`` between white space: seconds, metres, and a unit quaternion that turns
  the robot's axes into those of the map (Sturm et al., A Benchmark for the Evaluation of RGB-D SLAM Systems, IROS
  2012). Lines that start with ``#`` and empty lines are skipped.
* Poses here are planar. Of a file the height is left out, and the heading is the quaternion's turn about z; a robot
  that leans further than :data:`LEANING_RAD` is refused, as then the axes are others, such as those of a camera.
* Numbers are written so that they are read back bit by bit, but for the heading, which goes by way of its quaternion.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.errors import ScoringError
from uwbbench.api.text import printable

SUFFIX = ".tum"
COLUMNS = ("time", "tx", "ty", "tz", "qx", "qy", "qz", "qw")

UNIT_LENGTH = 0.01
"""Largest difference of a quaternion's length from 1."""

LEANING_RAD = 0.35
"""Largest angle between the robot's z axis and that of the map."""


def tum_text(time_s: FloatArray, pose: FloatArray) -> str:
    """Poses (n, 3) of x, y and yaw at times (n,), as the content of a file."""
    half = pose[:, 2] / 2
    zero = np.zeros(len(pose))
    rows = np.column_stack([time_s, pose[:, :2], zero, zero, zero, np.sin(half), np.cos(half)])
    lines = [" ".join(map(repr, row)) for row in rows.tolist()]
    return "\n".join([f"# {' '.join(COLUMNS)}", *lines, ""])


def read_tum(path: Path, content: bytes) -> tuple[FloatArray, FloatArray]:
    """Times (n,) and poses (n, 3) of x, y and yaw of a file, in the order of time.

    Parameters
    ----------
    path : Path
        For messages.
    content : bytes

    Raises
    ------
    ScoringError
        If a line is no pose, two poses are of one time, or there are none; names file and line.
    """
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ScoringError(f"{path}: is no text: byte {error.start} is no UTF-8") from error
    rows, places = [], []
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            places.append(f"{path}: line {number}")
            rows.append(_row(line, places[-1]))
    if not rows:
        raise ScoringError(f"{path}: holds no poses; expected lines of {' '.join(COLUMNS)}")
    table = np.array(rows)
    order = np.argsort(table[:, 0], kind="stable")
    again = np.flatnonzero(np.diff(table[order, 0]) == 0)
    if len(again):
        raise ScoringError(
            f"{places[order[again[0] + 1]]}: time {table[order[again[0]], 0].item()!r} has another pose already"
        )
    return table[order, 0], np.column_stack([table[:, 1:3], _headings(table[:, 4:], places)])[order]


def _row(line: str, place: str) -> list[float]:
    """The eight numbers of a line."""
    cells = line.split()
    if len(cells) != len(COLUMNS):
        comma = " Are there commas between them?" if "," in line else ""
        raise ScoringError(f"{place}: {len(cells)} values, expected {len(COLUMNS)}: {' '.join(COLUMNS)}.{comma}")
    values = []
    for name, cell in zip(COLUMNS, cells, strict=True):
        try:
            values.append(float(cell))
        except ValueError:
            raise ScoringError(f"{place}: {name} {printable(cell, 40)!r} is no number") from None
        if not math.isfinite(values[-1]):
            raise ScoringError(f"{place}: {name} is {cell}")
    return values


def _headings(quaternion: FloatArray, places: list[str]) -> FloatArray:
    """Turn about z (n,) of quaternions (n, 4), qw last."""
    length = np.linalg.norm(quaternion, axis=1)
    wrong = np.abs(length - 1) > UNIT_LENGTH
    if wrong.any():
        row = int(np.argmax(wrong))
        raise ScoringError(f"{places[row]}: qx qy qz qw has the length {length[row]:.4g}, expected a unit quaternion")
    x, y, z, w = (quaternion / length[:, None]).T
    upright = 1 - 2 * (x * x + y * y)
    leaning = upright < math.cos(LEANING_RAD)
    if leaning.any():
        row = int(np.argmax(leaning))
        degrees = math.degrees(math.acos(max(-1.0, upright[row])))
        raise ScoringError(
            f"{places[row]}: the robot leans by {degrees:.0f} degrees. Is qw the last of the four, and are the axes "
            "those of a robot, x forward and z up, and not of a camera?"
        )
    return np.asarray(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
