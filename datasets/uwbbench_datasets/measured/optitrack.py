"""Motion of a rigid body from an OptiTrack (Motive) CSV export, in this project's frame.

OptiTrack's frame is right-handed with Y up. Its (X, Y, Z) becomes (x, y, z) = (X, -Z, Y): a quarter turn about X, so
that z points up and the frame stays right-handed. The shorter (X, Z, Y) would be a mirror image: it keeps every range
and turns every azimuth round.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uwbbench.api import CaptureError, FloatArray
from uwbbench_datasets.measured.recordings import content

_AXES = ("X", "Y", "Z", "W")


def z_up(position_m: FloatArray) -> FloatArray:
    """Positions (..., 3) of the Y-up frame as (X, -Z, Y), z up."""
    return np.stack([position_m[..., 0], -position_m[..., 2], position_m[..., 1]], axis=-1)


@dataclass(frozen=True)
class Motion:
    """Where a rigid body was.

    Attributes
    ----------
    time_s : (n,) array
        Increasing, from the start of the take.
    position_m : (n, 3) array
        z up; NaN where the body was not tracked.
    heading : (n, 2) array
        Horizontal direction of the body's x axis; NaN where the body was not tracked.
    """

    time_s: FloatArray
    position_m: FloatArray
    heading: FloatArray

    def at(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions (m, 3) and yaws (m,) at times (m,), linear in between.

        NaN outside the take and next to frames in which the body was not tracked. The heading is interpolated as a
        vector, so that a turn through +-180 degrees goes the short way.
        """
        known = np.column_stack([self.position_m, self.heading])
        x, y, z, ahead, left = (np.interp(time_s, self.time_s, each, np.nan, np.nan) for each in known.T)
        return np.column_stack([x, y, z]), np.arctan2(left, ahead)


def read_motion(path: Path, body: str) -> Motion:
    """Motion of one rigid body.

    Parameters
    ----------
    path : Path
        CSV export, version 1.2x, with quaternions and metres.
    body : str
        Name of the rigid body.

    Returns
    -------
    Motion

    Raises
    ------
    CaptureError
        If the export is broken, incomplete, in other units, or without that body; names the file and the line.
    """
    lines = content(path).decode("utf-8", errors="replace").splitlines()
    try:
        rows = list(csv.reader(lines, strict=True))
    except csv.Error as error:
        raise CaptureError(f"{path}: not a CSV file: {error}") from error
    if len(rows) < 7 or rows[0][:1] != ["Format Version"]:
        raise CaptureError(f"{path}: line 1: not an OptiTrack export, which starts with 'Format Version'")
    settings = dict(zip(rows[0][::2], rows[0][1::2], strict=False))
    for key, expected in (("Rotation Type", "Quaternion"), ("Length Units", "Meters")):
        if settings.get(key) != expected:
            raise CaptureError(f"{path}: line 1: '{key}' must be '{expected}', not '{settings.get(key)}'")
    columns = _columns(path, rows, body)
    table = _numbers(path, rows[7:], columns)
    if settings.get("Total Exported Frames") != str(len(table)):
        raise CaptureError(
            f"{path}: holds {len(table)} frames, but its line 1 says {settings.get('Total Exported Frames')}"
        )
    time_s, (x, y, z, w) = table[:, 0], table[:, 1:5].T
    if not (len(time_s) and np.all(np.isfinite(time_s)) and np.all(np.diff(time_s) > 0)):
        raise CaptureError(f"{path}: its times must be given and increase from frame to frame")
    # The body's x axis turned by its quaternion, (1 - 2 (y^2 + z^2), ., 2 (x z - w y)) in the Y-up frame.
    heading = np.column_stack([1 - 2 * (y**2 + z**2), -2 * (x * z - w * y)])
    return Motion(time_s, z_up(table[:, 5:8]), heading)


def _columns(path: Path, rows: list[list[str]], body: str) -> list[int]:
    """Columns of time, quaternion X Y Z W and position X Y Z, which rows 3 to 7 name."""
    kinds, names, _, quantities, axes = rows[2:7]
    width = min(map(len, (kinds, names, quantities, axes)))
    place = {(kinds[i], names[i], quantities[i], axes[i]): i for i in range(width)}
    bodies = sorted({name for kind, name, *_ in place if kind == "Rigid Body"})
    if body not in bodies:
        raise CaptureError(f"{path}: line 4: no rigid body '{body}'; known: {', '.join(bodies) or 'none'}")
    wanted = [("Rotation", axis) for axis in _AXES] + [("Position", axis) for axis in _AXES[:3]]
    try:
        return [axes.index("Time (Seconds)"), *(place["Rigid Body", body, *each] for each in wanted)]
    except (KeyError, ValueError) as error:
        raise CaptureError(f"{path}: lines 3 to 7: a column of rigid body '{body}' is missing: {error}") from error


def _numbers(path: Path, rows: list[list[str]], columns: list[int]) -> FloatArray:
    """Cells (rows, columns); an empty cell is NaN."""
    table = np.empty((len(rows), len(columns)))
    for number, row in enumerate(rows):
        try:
            table[number] = [float(row[column] or "nan") for column in columns]
        except (IndexError, ValueError) as error:
            raise CaptureError(f"{path}: line {number + 8}: not a row of numbers: {error}") from error
    return table
