"""A detector that is timed turn by turn, in whatever process it lives.

What a turn is
--------------
* A turn is the time of some consecutive frames of a capture, one frame a call, each from its raw samples to its rows
  as plain records. It lasts ``TURN_S`` or longer, thousands
  of readings of the clock, and has ``TURN_FRAMES`` frames or more, so that work that comes every fifty, such as
  clustering, is part of every turn. Both hold unless the slowest detector would take longer than ``LONGEST_TURN_S`` for
  them: beside a fast reference, a slow one would be timed for minutes. The parts of a capture are equally long, and
  next to nothing of it is left over.
* Both turns of a block are the same work: a detector has two streams, which go through the same frames one after the
  other, so that the faster of both is the less disturbed one and never the one that had less to do.
* On a busy machine other processes take the core for milliseconds. Linux counts for each thread how long it waited for
  its core; that time is no detector's, and is left out of the turn: with both cores busy, that halved the scatter of
  blocks as long as a time slice. Processor time would do the same, but a detector that sleeps or waits for a file would
  pass. What others did to the caches stays in. Where the system does not count that, nothing is left out.
"""

from __future__ import annotations

import gc
import hashlib
import math
from collections.abc import Sequence
from functools import partial
from time import perf_counter_ns

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.capture import Capture
from uwbbench.api.errors import CaptureError
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.latency.counters import core_waits
from uwbbench.measure.latency.loops import stream_pass, timed_calls, warm_up
from uwbbench.measure.latency.paced import paced_pass, responses_us
from uwbbench.measure.latency.ratio import alternate

TURN_S = 1.5e-3
TURN_FRAMES = 64
LONGEST_TURN_S = 0.03

PROBED_S = 0.01
"""Time after which a detector's speed is known well enough to choose the length of its turns."""


class Player:
    """A detector with received frames of a capture, which two streams of it go through again and again.

    Parameters
    ----------
    pipeline : Pipeline
    capture : Capture
        That streams are opened for.
    whole : Capture
        Its received frames (:func:`~uwbbench.measure.latency.received.received`).

    Attributes
    ----------
    waited_s : list of float
        Time in each turn during which other processes had the core; 0 where the system does not count it.

    Raises
    ------
    CaptureError
        If there are no frames.
    """

    def __init__(self, pipeline: Pipeline, capture: Capture, whole: Capture) -> None:
        self.pipeline, self.capture, self.whole = pipeline, capture, whole
        if not len(self.whole):
            raise CaptureError(f"capture '{capture.name}' has no frames; there is nothing to time")
        self._at, self._again = 0, False
        self.rewind()

    @property
    def content(self) -> str:
        """SHA-256 of the raw samples: players are only compared where it is the same."""
        return hashlib.sha256(np.asarray(self.whole.preamble[:]).tobytes()).hexdigest()

    def warm_up(self, windows: int) -> None:
        """Run until the times settle, so many windows at most."""
        warm_up(self.pipeline, self.capture, self.whole, windows)

    def call_s(self) -> float:
        """Median time of the first calls: enough of them to choose the length of turns."""
        stream = self.pipeline.open(self.capture)
        times_us: list[float] = []
        for frame in range(min(1000, len(self.whole))):
            times_us += timed_calls(stream, self.whole, frame, frame + 1).times_us.tolist()
            if sum(times_us) > PROBED_S * 1e6:
                break
        return max(float(np.median(times_us)) * 1e-6, 1e-9)

    def turn(self, size: int) -> float:
        """Time of ``size`` frames, in seconds: of the first stream, then of the second on the same, then of the next.

        The time is that from samples to rows. Where too few frames are left, the capture starts again. Opening streams
        is not part of the time, nor is waiting for the core while other processes have it, where the system counts
        that. What the detector waits for by itself, such as a file, is.
        """
        if not self._again and self._at + size > len(self.whole):
            self._reopen()
        stream, receive, frames = self._streams[self._again], self.whole.frames, range(self._at, self._at + size)
        step, sts = stream.step, "sts" in stream.needs
        if self._again:
            self._at += size
        self._again = not self._again
        gc.disable()  # without collecting first, which takes longer than a turn and empties the caches
        try:
            with core_waits() as waits_ns:
                before_ns = waits_ns()
                start_ns = perf_counter_ns()
                for frame in frames:
                    step(receive(frame, frame + 1, sts=sts)).records()
                spent_ns = perf_counter_ns() - start_ns
                waited_ns = waits_ns() - before_ns
        finally:
            gc.enable()
        self.waited_s.append(waited_ns * 1e-9)
        # A wait between the readings of the two clocks, beside the timed part, may exceed it: it is none of it.
        return (spent_ns - waited_ns if waited_ns < spent_ns else spent_ns) * 1e-9

    def rewind(self) -> None:
        """Start the capture again, with streams opened anew, and forget earlier turns."""
        self.waited_s: list[float] = []
        self._reopen()

    def _reopen(self) -> None:
        self._streams = [self.pipeline.open(self.capture) for _ in range(2)]
        self._at, self._again = 0, False

    def responses_us(self, count: int, rate_hz: float, *, paced: bool) -> FloatArray:
        """Response times (count,) of single frames, from the moment each is due to its answer.

        Paced, frames come at the radar's rate, as on a robot; else each comes when the one before is answered, which
        takes less time and finds warmer caches, and the queue that the radar's rate would make is computed.

        Parameters
        ----------
        count : int
            Frames.
        rate_hz : float
            At which they are due, or taken to be.
        paced : bool
        """
        if paced:
            times_us, _ = paced_pass(self.pipeline, self.capture, self.whole, rate_hz, count / rate_hz)
        else:
            passes = -(-count // len(self.whole))
            one_by_one = [stream_pass(self.pipeline, self.capture, self.whole).times_us for _ in range(passes)]
            times_us = np.concatenate(one_by_one)[:count]
        return responses_us(times_us, 1e6 / rate_hz)


def turn_frames(call_s: Sequence[float], frames: int) -> int:
    """Frames of a turn of detectors that take so long for a frame, on a capture of so many frames."""
    least = max(TURN_FRAMES, math.ceil(TURN_S / min(call_s)))
    size = max(1, min(least, int(LONGEST_TURN_S / max(call_s))))
    return frames // max(1, frames // size)


def in_turns(players: Sequence[Player], size: int, blocks: int) -> FloatArray:
    """Times (blocks, players, 2) of players that take turns on the same frames, from the start of the capture.

    Parameters
    ----------
    players : sequence of Player
        Warm: what is compiled in here would be part of the times.
    size : int
        Frames of a turn, no more than there are.
    blocks : int
    """
    for player in players:
        player.rewind()
    return alternate([partial(player.turn, size) for player in players], blocks)
