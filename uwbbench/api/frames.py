"""Consecutive frames of one receiver as arrays."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from uwbbench.api.arrays import BoolArray, ComplexArray, FloatArray, IntArray, locked

BATCH_FRAMES = 4096
"""Frames of a block where a whole capture is read: enough to be fast, as a compressed file is slow to give them one by
one, and few enough for a capture of a million."""


def magnitude(samples: ComplexArray) -> FloatArray:
    """``sqrt(re^2 + im^2)`` in double precision.

    ``np.abs`` gives unequal magnitudes for about a quarter of the integer I/Q pairs of equal power, so that plateaus
    come and go; squaring after widening complex64 to double does not.
    """
    power, imaginary = samples.real.astype(np.float64), samples.imag.astype(np.float64)
    power *= power  # in place: new pages for each step would take most of the time of a long block
    imaginary *= imaginary
    power += imaginary
    return np.asarray(np.sqrt(power, out=power))


@dataclass(frozen=True)
class Frames:
    """A block of consecutive frames of one receiver.

    Attributes
    ----------
    first : int
        Index of the first frame in its capture.
    preamble : (frames, taps) complex array
        The channel impulse responses used for ranging.
    timestamp_s : (frames,) array
        Non-decreasing times.
    position_m, yaw_rad : (frames, 3) and (frames,) array
        Robot poses in the world.
    valid : (frames,) bool array
        False where a sample is not finite: such a frame must not yield detections.
    sts1, sts2 : (frames, taps) complex array or None
        The responses of the two antennas.
    first_path_index, first_path_index_sts1, first_path_index_sts2 : (frames,) array or None
        Fractional tap of the direct path as the device reports it.
    odometry_position_m, odometry_yaw_rad : array or None
        The drifting pose that a real robot would have.
    """

    first: int
    preamble: ComplexArray
    timestamp_s: FloatArray
    position_m: FloatArray
    yaw_rad: FloatArray
    valid: BoolArray
    sts1: ComplexArray | None = None
    sts2: ComplexArray | None = None
    first_path_index: FloatArray | None = None
    first_path_index_sts1: FloatArray | None = None
    first_path_index_sts2: FloatArray | None = None
    odometry_position_m: FloatArray | None = None
    odometry_yaw_rad: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.preamble)

    @property
    def taps(self) -> int:
        """Samples of one frame."""
        return int(self.preamble.shape[1])

    @property
    def index(self) -> IntArray:
        """Capture-wide indices (frames,) of these frames."""
        return np.arange(self.first, self.first + len(self), dtype=np.int64)

    @cached_property
    def amplitude(self) -> FloatArray:
        """Magnitudes (frames, taps) of the preamble response."""
        return locked(magnitude(self.preamble))

    def with_preamble(self, preamble: ComplexArray) -> Frames:
        """Return the same frames with other samples, for example after clutter removal."""
        return dataclasses.replace(self, preamble=preamble)

    def without_invalid(self) -> Frames:
        """Frames with the samples of invalid ones set to zero, so that no stage's state is poisoned by NaN."""
        if self.valid.all():
            return self
        samples = {name: getattr(self, name) for name in ("preamble", "sts1", "sts2")}
        cleared: dict[str, Any] = {
            name: locked(np.where(self.valid[:, None], values, 0))
            for name, values in samples.items()
            if values is not None
        }
        return dataclasses.replace(self, **cleared)

    def part(self, start: int, stop: int) -> Frames:
        """Frames ``start`` to ``stop`` of this block, as views."""
        parts = {
            field.name: value[start:stop]
            for field in dataclasses.fields(self)
            if (value := getattr(self, field.name)) is not None and field.name != "first"
        }
        return Frames(first=self.first + start, **parts)

    @staticmethod
    def join(blocks: Sequence[Frames]) -> Frames:
        """One block from consecutive blocks of one capture."""
        if len(blocks) == 1:
            return blocks[0]
        parts = {
            field.name: np.concatenate([getattr(block, field.name) for block in blocks])
            for field in dataclasses.fields(Frames)
            if getattr(blocks[0], field.name) is not None and field.name != "first"
        }
        return Frames(first=blocks[0].first, **parts)
