"""Magnitudes that count from the first path: of frames, and what windows of frames make of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uwbbench.api.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class Bins:
    """An axis of delay that is the same for all frames, as fine as a stage wants it.

    Attributes
    ----------
    first_tap : int
        Taps from the first path to the first bin; negative before the first path.
    per_tap : int
        Bins a tap.
    count : int
    """

    first_tap: int
    per_tap: int
    count: int

    @property
    def place(self) -> FloatArray:
        """Taps (bins,) from the first path to each bin."""
        return self.first_tap + np.arange(self.count) / self.per_tap


@dataclass(frozen=True)
class AlignedProfile:
    """Magnitudes of frames at equal delays behind their first paths.

    Attributes
    ----------
    bins : Bins
    magnitude : (frames, bins) array
        NaN where a frame has no sample.
    minimum_filled : float
        Share of the bins that frames must fill together before a statistic over them means anything.
    """

    bins: Bins
    magnitude: FloatArray
    minimum_filled: float = 0.0

    def __len__(self) -> int:
        return len(self.magnitude)

    def __getitem__(self, frames: slice) -> AlignedProfile:
        """Profile of some of the frames."""
        return AlignedProfile(self.bins, self.magnitude[frames], self.minimum_filled)

    @staticmethod
    def join(parts: Sequence[AlignedProfile]) -> AlignedProfile:
        """Profile of consecutive frames."""
        magnitude = np.concatenate([part.magnitude for part in parts])
        return AlignedProfile(parts[0].bins, magnitude, parts[0].minimum_filled)


NO_WINDOW = -1
"""Row of a frame that no window holds for."""


@dataclass(frozen=True)
class WindowProfile:
    """A value for each bin that holds for the frames of a window, such as their mean magnitude.

    Attributes
    ----------
    bins : Bins
    row : (frames,) int array
        Row of ``value`` that holds for each frame; -1 where none does.
    stop : (windows,) int array
        Index of the frame behind the last one of each window, by which a window is known.
    value : (windows, bins) array
        NaN where no frame of the window has a sample.
    count : (windows, bins) int array
        Frames that each value is made of.
    refused : tuple of str
        Why windows have no value, each reason once.
    """

    bins: Bins
    row: IntArray
    stop: IntArray
    value: FloatArray
    count: IntArray
    refused: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.row)

    def __getitem__(self, frames: slice) -> WindowProfile:
        """Values that hold for some of the frames; a window that is cut is in both parts."""
        row = self.row[frames]
        held = row[row != NO_WINDOW]
        first, stop = (int(held[0]), int(held[-1]) + 1) if len(held) else (0, 0)
        kept = slice(first, stop)
        row = np.where(row == NO_WINDOW, NO_WINDOW, row - first)
        return WindowProfile(self.bins, row, self.stop[kept], self.value[kept], self.count[kept], self.refused)

    @property
    def of_frames(self) -> FloatArray:
        """Value (frames, bins) that holds for each frame; NaN where none does."""
        nothing = np.full((1, self.bins.count), np.nan)
        return np.concatenate([self.value, nothing])[self.row]

    @staticmethod
    def join(parts: Sequence[WindowProfile]) -> WindowProfile:
        """Values of consecutive frames."""
        before = np.cumsum([0, *(len(part.stop) for part in parts)])
        rows = [
            np.where(part.row == NO_WINDOW, NO_WINDOW, part.row + offset)
            for part, offset in zip(parts, before, strict=False)
        ]
        return WindowProfile(
            parts[0].bins,
            np.concatenate(rows),
            np.concatenate([part.stop for part in parts]),
            np.concatenate([part.value for part in parts]),
            np.concatenate([part.count for part in parts]),
            tuple(dict.fromkeys(reason for part in parts for reason in part.refused)),
        )
