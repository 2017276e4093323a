"""Anchors: radios of known identity that stand in the world, and what a receiver hears of them."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray, lock_fields


@dataclass(frozen=True)
class Messages:
    """What a receiver hears of anchors, one row a message; read-only.

    Attributes
    ----------
    anchor : (n,) int array
        Identity that the message carries.
    azimuth_rad : (n,) array
        Direction it comes from, from the boresight of the receiver.
    range_m : (n,) array
        Distance from the receiver; NaN where only the direction was measured.
    placed : (n,) bool array
        Whether the robot has just set this anchor down: azimuth and range are then where it has put it, not measured.
    """

    anchor: IntArray
    azimuth_rad: FloatArray
    range_m: FloatArray
    placed: BoolArray

    def __post_init__(self) -> None:
        lock_fields(self, ("anchor", "azimuth_rad", "range_m", "placed"))

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
        True places, which no mapper is shown.
    frame : (m,) int array
        Frame in which each message was heard, not decreasing.
    messages : Messages
        The messages (m,).
    """

    identity: IntArray
    position_m: FloatArray
    frame: IntArray
    messages: Messages

    def __post_init__(self) -> None:
        lock_fields(self, ("identity", "position_m", "frame"))

    def heard_in(self, frame: int) -> Messages:
        """Messages of one frame."""
        start, stop = np.searchsorted(self.frame, (frame, frame + 1))
        return self.messages.take(np.arange(start, stop))

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
