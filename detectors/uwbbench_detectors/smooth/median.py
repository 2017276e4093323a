"""Median of ranges along the frames."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field, field_validator

from uwbbench.api import Block, FloatArray, Params, Radar, Stage, ports


class MedianSmoothingParams(Params):
    """How long the median is."""

    frames: int = Field(
        5,
        ge=1,
        le=255,
        description="Frames of the median, an odd number, the middle one being the frame that is handed out: frames "
        "come out (frames - 1) / 2 later than they went in.",
    )

    @field_validator("frames")
    @classmethod
    def _odd(cls, value: int) -> int:
        if value % 2 == 0:
            raise ValueError(f"frames of a median around a frame must be odd, found {value}")
        return value


class MedianSmoothing(Stage[MedianSmoothingParams]):
    """Ranges replaced by their median over the frames around.

    For each detection the median is of its own range and, in each other frame of the window, of the range nearest to
    it; frames without a detection do not count. Of one detection a frame that is the plain running median: one frame
    far off is put right, and nothing lags, for whole frames are held back until those behind them are there. The
    scoring ``latest`` counts that delay. At both ends of a capture the window is as long as there are frames.

    Ranges of walking persons are smoothed so behind low-rank clutter removal (after Sabushimike et al., Sensors
    16(9):1409, 2016); the length is a choice made here.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames", "detections", "range_m")
    produces: ClassVar[frozenset[str]] = ports("range_m")
    fidelity = "reconstruction"

    @property
    def every_nth(self) -> bool:
        """Whether an answer hangs on which frames were lost: the window is of frames."""
        return self.params.frames > 1

    def open(self, radar: Radar) -> None:
        """Start without frames."""
        super().open(radar)
        self._held: list[Block] = []
        self._out = 0  # first frame that was not handed out yet

    def step(self, block: Block) -> Block:
        """Block of the frames whose window is complete."""
        return self._hand_out(block, self.params.frames // 2)

    def flush(self) -> Block | None:
        """The last frames."""
        return self._hand_out(None, 0) if self._held else None

    def _hand_out(self, block: Block | None, behind: int) -> Block:
        """Frames that have so many others behind them, smoothed; a window of frames before stays for the next ones."""
        joined = Block.join([*self._held, *([] if block is None else [block])])
        first = joined.frames.first
        if not self._held:
            self._out = first
        stop = max(first + len(joined.frames) - behind, self._out)
        ready = joined.cut(self._out - first, stop - first)
        ready = ready.with_columns(range_m=self._medians(joined, ready))
        kept = max(stop - self.params.frames // 2, first)
        held = joined.cut(kept - first, len(joined.frames))
        self._held = [held.replace(detections=held.detections.annotated(processed=held.frames.index))]
        self._out = stop
        return ready

    def _medians(self, joined: Block, ready: Block) -> FloatArray:
        """Median (n,) of each range that is ready."""
        known = np.isfinite(joined.detections.range_m)
        frame, range_m = joined.detections.frame[known], joined.detections.range_m[known]
        half = self.params.frames // 2
        found = ready.detections.range_m.copy()
        start = np.searchsorted(frame, ready.detections.frame - half)
        stop = np.searchsorted(frame, ready.detections.frame + half, side="right")
        for row in np.flatnonzero(np.isfinite(found)):
            own = ready.detections.frame[row]
            near = slice(start[row], stop[row])
            off = np.abs(range_m[near] - found[row])
            order = np.lexsort((off, frame[near]))
            of_frame = frame[near][order]
            one_each = order[np.flatnonzero(np.diff(of_frame, prepend=-1))]
            others = one_each[frame[near][one_each] != own]
            found[row] = np.median(np.append(range_m[near][others], found[row]))
        return found
