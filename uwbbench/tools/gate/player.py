"""A detector that is timed turn by turn, in whatever process it lives."""

from __future__ import annotations

import gc
import hashlib
from collections.abc import Sequence
from functools import partial
from time import perf_counter_ns

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.capture import Capture
from uwbbench.api.errors import CaptureError
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.latency.counters import core_waits
from uwbbench.measure.latency.loops import WINDOW_FRAMES, call_times_us, cut, stream_pass, warm_up
from uwbbench.measure.latency.paced import paced_pass, responses_us
from uwbbench.tools.gate.ratio import log_ratios


class Player:
    """A detector with preloaded frames of a capture, which it goes through one frame a call, again and again.

    Parameters
    ----------
    pipeline : Pipeline
    capture : Capture
    frames : int
        Frames loaded at most, from the start of the capture.

    Raises
    ------
    CaptureError
        If the capture has no frames.
    """

    def __init__(self, pipeline: Pipeline, capture: Capture, frames: int) -> None:
        self.pipeline, self.capture = pipeline, capture
        self.whole = capture.frames(0, frames)
        if not len(self.whole):
            raise CaptureError(f"capture '{capture.name}' has no frames; there is nothing to time")
        self._stream = pipeline.open(capture)
        self._at = 0

    @property
    def content(self) -> str:
        """SHA-256 of the loaded samples: players are only compared where it is the same."""
        return hashlib.sha256(np.ascontiguousarray(self.whole.preamble).tobytes()).hexdigest()

    def warm_up(self, windows: int) -> float:
        """Run until the times settle; then the median time of a call, in seconds."""
        warm_up(self.pipeline, self.capture, self.whole, windows)
        calls = cut(self.whole.part(0, WINDOW_FRAMES), 1)
        return float(np.median(call_times_us(self.pipeline.open(self.capture), calls))) * 1e-6

    def turn(self, size: int) -> float:
        """Time of the next ``size`` frames, in seconds; where too few are left, the capture starts again.

        Opening a stream and cutting frames is not part of the time, nor is waiting for the core while other processes
        have it, where the system tells. What the detector waits for by itself, such as a file, is.
        """
        size = min(size, len(self.whole))
        if self._at + size > len(self.whole):
            self.rewind()
        calls = cut(self.whole.part(self._at, self._at + size), 1)
        self._at += size
        step = self._stream.step
        gc.disable()  # without collecting first, which takes longer than a turn and empties the caches
        try:
            with core_waits() as waits_ns:
                before_ns = waits_ns()
                start_ns = perf_counter_ns()
                for frames in calls:
                    step(frames)
                spent_ns = perf_counter_ns() - start_ns
                waited_ns = waits_ns() - before_ns
        finally:
            gc.enable()
        # A wait between the readings of the two clocks, beside the timed part, may exceed it: it is none of it.
        return (spent_ns - waited_ns if waited_ns < spent_ns else spent_ns) * 1e-9

    def rewind(self) -> None:
        """Start the capture again, with a stream opened anew."""
        self._stream, self._at = self.pipeline.open(self.capture), 0

    def responses_us(self, count: int, rate_hz: float, *, paced: bool) -> FloatArray:
        """Response times (count,) of single frames, from the moment each is due to its answer.

        Paced, frames come at the radar's rate, as on a robot; else each comes when the one before is answered, which
        takes less time and finds warmer caches, and the queue that the radar's rate would make is computed.
        """
        if paced:
            times_us, _ = paced_pass(self.pipeline, self.capture, self.whole, rate_hz, count / rate_hz)
        else:
            passes = -(-count // len(self.whole))
            one_by_one = [stream_pass(self.pipeline, self.capture, self.whole)[0] for _ in range(passes)]
            times_us = np.concatenate(one_by_one)[:count]
        return responses_us(times_us, 1e6 / rate_hz)


def in_turns(base: Player, head: Player, size: int, blocks: int) -> Sequence[float]:
    """Log ratios of blocks of two players on the same frames, from the start of the capture."""
    for player in (base, head):
        player.rewind()
    return log_ratios(partial(base.turn, size), partial(head.turn, size), blocks)
