"""Anchors: radios of known identity that stand in the world, and what a receiver hears of them."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray, lock_fields
from uwbbench.api.errors import CaptureError


@dataclass(frozen=True)
class Messages:
    """What a receiver hears of anchors, one row a message; read-only.

    Attributes
    ----------
    anchor : (n,) int array
        Identity that the message carries.
    azimuth_rad : (n,) array
        Direction it comes from, from the boresight of the receiver; NaN where only the distance was measured.
    range_m : (n,) array
        Distance from the receiver; NaN where only the direction was measured.
    placed : (n,) bool array
        Whether the robot has just set this anchor down: azimuth and range are then where it has put it, not measured.

    Raises
    ------
    CaptureError
        If columns differ in length, a value is infinite, or a message says neither direction nor distance.
    """

    anchor: IntArray
    azimuth_rad: FloatArray
    range_m: FloatArray
    placed: BoolArray

    def __post_init__(self) -> None:
        lock_fields(self, ("anchor", "azimuth_rad", "range_m", "placed"))
        lengths = [len(column) for column in (self.anchor, self.azimuth_rad, self.range_m, self.placed)]
        if len(set(lengths)) > 1:
            raise CaptureError(f"messages: columns anchor, azimuth_rad, range_m, placed of lengths {lengths}")
        known = ~np.isnan([self.azimuth_rad, self.range_m])
        for name in ("azimuth_rad", "range_m"):
            infinite = np.isinf(getattr(self, name))
            if infinite.any():
                raise CaptureError(f"messages: {name} of message {int(np.argmax(infinite))} is infinite")
        said = np.where(self.placed, known.all(axis=0), known.any(axis=0))
        if not said.all():
            row = int(np.argmin(said))
            wanted = "both azimuth_rad and range_m" if self.placed[row] else "azimuth_rad or range_m"
            raise CaptureError(f"messages: message {row} needs {wanted}")

    def __len__(self) -> int:
        return len(self.anchor)

    @classmethod
    def none(cls) -> Messages:
        """No message."""
        return cls(np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0, np.bool_))

    def take(self, rows: IntArray | BoolArray) -> Messages:
        """Some of the rows, by number or by mask."""
        return Messages(self.anchor[rows], self.azimuth_rad[rows], self.range_m[rows], self.placed[rows])


@dataclass(frozen=True)
class Anchors:
    """Anchors around a receiver; read-only.

    Attributes
    ----------
    identity : (n,) int array
        Distinct numbers.
    position_m : (n, 2) array
        True places, which no mapper is shown; NaN where one is not known.
    frame : (m,) int array
        Frame in which each message was heard, not decreasing.
    messages : Messages
        The messages (m,). The identity that one carries may be that of no anchor.

    Raises
    ------
    CaptureError
        If an identity appears twice, a place is missing or infinite, or frames do not fit the messages.
    """

    identity: IntArray
    position_m: FloatArray
    frame: IntArray
    messages: Messages

    def __post_init__(self) -> None:
        lock_fields(self, ("identity", "position_m", "frame"))
        if self.position_m.shape != (len(self.identity), 2):
            expected = f"({len(self.identity)}, 2), a place for each identity"
            raise CaptureError(f"anchors: position_m has shape {self.position_m.shape}, expected {expected}")
        if len(np.unique(self.identity)) < len(self.identity):
            raise CaptureError(f"anchors: an identity appears twice in {self.identity.tolist()}")
        if np.isinf(self.position_m).any():
            raise CaptureError("anchors: a place is infinite")
        if len(self.frame) != len(self.messages):
            raise CaptureError(f"anchors: {len(self.messages)} messages in {len(self.frame)} frames; expected one each")
        if np.any(np.diff(self.frame) < 0):
            raise CaptureError(f"anchors: frame decreases at message {int(np.argmax(np.diff(self.frame) < 0)) + 1}")

    def heard_in(self, frame: int) -> Messages:
        """Messages of one frame."""
        start, stop = np.searchsorted(self.frame, (frame, frame + 1))
        return self.messages.take(np.arange(start, stop))

    def of_frames(self, source: IntArray) -> Anchors:
        """What is heard in a capture that is made of other frames of this one.

        Parameters
        ----------
        source : (frames,) int array
            The frame that each of its frames is a copy of; -1 for one in which nothing is heard.
        """
        start, stop = np.searchsorted(self.frame, source), np.searchsorted(self.frame, source, side="right")
        count = stop - start
        rows = np.repeat(start - np.cumsum(count) + count, count) + np.arange(count.sum())
        frame = np.repeat(np.arange(len(source)), count)
        return Anchors(self.identity, self.position_m, frame, self.messages.take(rows))

    @property
    def sha256(self) -> str:
        """Hash of the content."""
        heard = self.messages
        columns = (heard.anchor, heard.azimuth_rad, heard.range_m, heard.placed)
        digest = hashlib.sha256()
        for array in (self.identity, self.position_m, self.frame, *columns):
            digest.update(f"{array.dtype} {array.shape}".encode())
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()
