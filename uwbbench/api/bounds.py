"""How large a capture may be: what a file declares is checked before anything is made of that size."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.errors import CaptureError
from uwbbench.api.text import counted

MOST_FRAMES = 100_000_000
"""Twelve days at 100 frames a second."""
MOST_TAPS = 1 << 17
"""The longest accumulators of chips have 1016, and windows of impulse radars some thousands."""
MOST_RECEIVERS = 256
MOST_OBJECTS = 2_000
MOST_VERTICES = 10_000
"""Of one outline."""

FARTHEST_M = 1e12
"""Squares of coordinates up to here do not overflow, and nothing that is seen is as far."""

_MOST_UNFOLDED = 256 << 20
_MOST_RATIO = 50
"""Packed data of any size may unfold to so many times their size, and any data to so many bytes."""


def check_shape(frames: int, taps: int) -> None:
    """Refuse more frames, or more taps, than any radar gives.

    Raises
    ------
    CaptureError
        Naming the number and the limit.
    """
    for number, most, what in ((frames, MOST_FRAMES, "frame"), (taps, MOST_TAPS, "tap")):
        if number > most:
            raise CaptureError(f"declares {counted(number, what)}, of which there may be {most}")


def check_truth(objects: int, vertices: int) -> None:
    """Refuse more labelled objects, or more vertices of one outline, than can be judged.

    Parameters
    ----------
    objects : int
    vertices : int
        Of the outline that has most.

    Raises
    ------
    CaptureError
        Naming the number and the limit.
    """
    if objects > MOST_OBJECTS:
        raise CaptureError(f"declares {counted(objects, 'object')}, of which there may be {MOST_OBJECTS}")
    if vertices > MOST_VERTICES:
        raise CaptureError(f"declares an outline of {vertices} vertices, which may have {MOST_VERTICES}")


def check_places(what: str, position_m: FloatArray) -> None:
    """Refuse coordinates beyond all that can be seen; NaN and infinity mean that a place is not known.

    Parameters
    ----------
    what : str
        Of which these are the coordinates, for the message.
    position_m : array

    Raises
    ------
    CaptureError
        Naming the farthest.
    """
    far = np.abs(position_m, where=np.isfinite(position_m), out=np.zeros(position_m.shape))
    if far.size and far.max() > FARTHEST_M:
        raise CaptureError(f"{what} has a coordinate of {far.max():g} m; it may have {FARTHEST_M:g} m")


def check_unfolded(where: str, declared_bytes: int, stored_bytes: int) -> None:
    """Refuse an array that says that it is far larger than what is stored of it.

    Parameters
    ----------
    where : str
        File, and place in it, for the message.
    declared_bytes : int
        Size of the array in memory.
    stored_bytes : int
        What the file holds of it, or the size of the file.

    Raises
    ------
    CaptureError
        Naming both.
    """
    if declared_bytes > max(_MOST_UNFOLDED, _MOST_RATIO * stored_bytes):
        raise CaptureError(f"{where}: declares {declared_bytes} bytes, of which the file holds {stored_bytes}")


def check_columns(path: Path, metadata: Any) -> None:
    """Refuse a Parquet file whose columns are far larger than itself, before they are read.

    Parameters
    ----------
    path : Path
    metadata : pyarrow.parquet.FileMetaData
        As the file states it.

    Raises
    ------
    CaptureError
        Naming both sizes.
    """
    groups = (metadata.row_group(number) for number in range(metadata.num_row_groups))
    values = sum(group.column(number).num_values for group in groups for number in range(group.num_columns))
    check_unfolded(str(path), 8 * max(values, metadata.num_rows), path.stat().st_size)
