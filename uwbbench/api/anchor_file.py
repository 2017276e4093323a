"""Anchors in a capture file: where they stand, once for all receivers, and what each receiver heard."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import h5py
import numpy as np

from uwbbench.api.anchors import Anchors, Messages
from uwbbench.api.capture import Capture
from uwbbench.api.errors import CaptureError

PLACES = "/anchors"
"""Group of identities and places; each receiver's group ``anchors`` holds its messages."""

_MESSAGES = {"frame": "int64", "anchor": "int64", "azimuth_rad": "float64", "range_m": "float64", "placed": "0 or 1"}
"""Columns of messages, and what they hold."""


class Reader(Protocol):
    """What of an open capture file is needed here."""

    def find(self, where: str) -> Any:
        """Object at a path, or None."""

    def dataset(self, where: str) -> h5py.Dataset | None:
        """Array at a path."""

    def fail(self, where: str, text: str) -> CaptureError:
        """Error that names the file and the path in it."""


def read_anchors(reader: Reader, receiver: str) -> Anchors | None:
    """Anchors as one receiver heard them; None where its group has no messages.

    Parameters
    ----------
    reader : Reader
    receiver : str

    Raises
    ------
    CaptureError
        If an array is missing, misshapen or of the wrong kind, or what they say cannot be.
    """
    base = f"/receivers/{receiver}/anchors"
    if reader.find(base) is None:
        return None
    if reader.find(PLACES) is None:
        raise reader.fail(PLACES, f"missing, though {base} has messages; expected identity and position_m")
    identity = _column(reader, f"{PLACES}/identity", "int64")
    places = _array(reader, f"{PLACES}/position_m", "float64")
    columns = {name: _column(reader, f"{base}/{name}", kind) for name, kind in _MESSAGES.items()}
    placed = columns.pop("placed")
    if not np.isin(placed, (0, 1)).all():
        raise reader.fail(f"{base}/placed", "expected 0 or 1")
    frame = columns.pop("frame")
    try:
        return Anchors(identity, places, frame, Messages(**columns, placed=placed.astype(np.bool_)))
    except CaptureError as error:
        raise reader.fail(base, str(error)) from None


def write_anchors(file: h5py.File, captures: Sequence[Capture]) -> None:
    """Write the anchors of captures of one run, where any has some.

    Parameters
    ----------
    file : h5py.File
        With a group for each receiver.
    captures : sequence of Capture
    """
    for capture in captures:
        anchors = capture.anchors
        if anchors is None:
            continue
        if PLACES not in file:
            places = file.create_group(PLACES)
            places.create_dataset("identity", data=np.asarray(anchors.identity, np.int64))
            places.create_dataset("position_m", data=np.asarray(anchors.position_m, np.float64))
        said = anchors.messages
        group = file[f"/receivers/{capture.radar.receiver}"].create_group("anchors")
        group.create_dataset("frame", data=np.asarray(anchors.frame, np.int64))
        group.create_dataset("anchor", data=np.asarray(said.anchor, np.int64))
        group.create_dataset("azimuth_rad", data=np.asarray(said.azimuth_rad, np.float64))
        group.create_dataset("range_m", data=np.asarray(said.range_m, np.float64))
        group.create_dataset("placed", data=np.asarray(said.placed, np.uint8))


def same_places(first: Anchors | None, other: Anchors | None) -> bool:
    """Whether two receivers of a run agree on which anchors there are and where; one may have none."""
    if first is None or other is None:
        return True
    same = np.array_equal(first.identity, other.identity)
    return same and np.array_equal(first.position_m, other.position_m, equal_nan=True)


def _array(reader: Reader, where: str, kind: str) -> Any:
    array = reader.dataset(where)
    assert array is not None  # noqa: S101
    if array.dtype.kind not in ("fiu" if kind == "float64" else "iub"):
        raise reader.fail(where, f"expected {kind}, found {array.dtype}")
    return np.asarray(array[...], np.float64 if kind == "float64" else np.int64)


def _column(reader: Reader, where: str, kind: str) -> Any:
    values = _array(reader, where, kind)
    if values.ndim != 1:
        raise reader.fail(where, f"expected one value a row, found shape {values.shape}")
    return values
