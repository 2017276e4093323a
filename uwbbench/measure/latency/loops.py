"""The loops that are timed.

What is timed is *samples to rows*, all that a robot pays for a frame: the raw samples of one frame, which lie in
memory, become :class:`~uwbbench.api.frames.Frames` (with the look for samples that are not finite, and the analytic
signal of real ones), the detector takes its step, and what it found becomes plain records. The step alone is timed
inside of it, by two more readings of the clock. Frames are made anew for every call: a block of frames remembers what
was once computed of it, and a second pass would get that for nothing.
"""

from __future__ import annotations

import dataclasses
import gc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter_ns
from typing import Any

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray
from uwbbench.api.frames import BATCH_FRAMES
from uwbbench.measure.latency.played import Played, Stepping, Timed

WINDOW_FRAMES = 200
"""Frames of one pass of a warm-up window, at most."""

WINDOW_S = 0.02
"""A window of fast calls repeats its pass for this long: a processor takes milliseconds to raise its clock."""

SLOW_WINDOW_S = 1.0
"""A window of slow calls ends after about this long, but not before ``SLOW_WINDOW_CALLS`` calls."""
SLOW_WINDOW_CALLS = 20

AGREEMENT = 0.05
"""Two warm-up windows whose medians differ by less than this share agree."""


@contextmanager
def quiet() -> Iterator[None]:
    """Keep the garbage collector out of the measurement."""
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.unfreeze()


def clock_us(readings: int = 1001) -> float:
    """Median time between two readings of the clock with nothing between them, in microseconds."""
    gaps_ns = np.empty(readings)
    for index in range(readings):
        start = perf_counter_ns()
        gaps_ns[index] = perf_counter_ns() - start
    return float(np.median(gaps_ns)) * 1e-3


@dataclass(frozen=True)
class Pass:
    """Times of one stream, one frame a call.

    Attributes
    ----------
    times_us : (frames,) array
        From the raw samples of each frame to its rows as plain records.
    step_us : (frames,) array
        The part of it that the detector's own step took.
    clustered : (frames,) bool array or None
        Calls in which a stage clustered; None where no stage counts that.
    flush_us : float
        Time of the flush, its records included.
    """

    times_us: FloatArray
    step_us: FloatArray
    clustered: BoolArray | None = None
    flush_us: float = 0.0


def timed_calls(stream: Stepping, frames: Played, start: int, stop: int) -> Pass:
    """Time of single frames from raw samples to records, without a flush.

    Parameters
    ----------
    stream : Stepping
    frames : Played
        Received frames, in memory.
    start, stop : int
        First frame, and the one behind the last.
    """
    step, receive, sts = stream.step, frames.frames, "sts" in stream.needs
    counters = [stage for stage in stream.stages if stage.clusterings is not None]
    counts = np.zeros(stop - start + 1, np.int64)
    counts[0] = _total(counters)
    times_ns, step_ns = np.empty((2, stop - start))
    for index in range(stop - start):
        began = perf_counter_ns()
        frame = receive(start + index, start + index + 1, sts=sts)
        made = perf_counter_ns()
        found = step(frame)
        stepped = perf_counter_ns()
        found.records()
        ended = perf_counter_ns()
        times_ns[index], step_ns[index] = ended - began, stepped - made
        if counters:
            counts[index + 1] = _total(counters)
    clustered = np.diff(counts) > 0 if counters else None
    return Pass(times_ns * 1e-3, step_ns * 1e-3, clustered)


def warm_up(pipeline: Timed, capture: Played, frames: Played, windows: int) -> bool:
    """Run until two windows in a row agree; whether they did within the limit.

    Every pass is a stream of its own and is flushed, so that what a stage imports or compiles only then is warm too.

    Parameters
    ----------
    pipeline : Timed
    capture : Played
        That streams are opened for.
    frames : Played
        Received frames of it; the first ``WINDOW_FRAMES`` are used.
    windows : int
        Limit of their number.
    """
    before = np.inf
    for _ in range(windows):
        now = _window_us(pipeline, capture, frames)
        if abs(now - before) <= AGREEMENT * now:
            return True
        before = now
    return False


def _window_us(pipeline: Timed, capture: Played, frames: Played) -> float:
    """Median call of a window."""
    times_us: list[float] = []
    spent_us = 0.0
    count = min(WINDOW_FRAMES, len(frames))
    while spent_us < WINDOW_S * 1e6:
        stream = pipeline.open(capture)
        for start in range(0, count, SLOW_WINDOW_CALLS):
            passed = timed_calls(stream, frames, start, min(start + SLOW_WINDOW_CALLS, count)).times_us
            times_us += passed.tolist()
            spent_us += float(passed.sum())
            if spent_us > SLOW_WINDOW_S * 1e6:
                break
        stream.flush().records()
    return float(np.median(times_us))


def stream_pass(pipeline: Timed, capture: Played, frames: Played) -> Pass:
    """Time one stream, one frame a call.

    Parameters
    ----------
    pipeline : Timed
        Warmed up before.
    capture : Played
        That the stream is opened for.
    frames : Played
        Received frames of it.
    """
    stream = pipeline.open(capture)
    with quiet():
        passed = timed_calls(stream, frames, 0, len(frames))
        start = perf_counter_ns()
        stream.flush().records()
        flush_us = (perf_counter_ns() - start) * 1e-3
    return dataclasses.replace(passed, flush_us=flush_us)


def _total(counters: list[Any]) -> int:
    return sum(stage.clusterings for stage in counters)


def batch_times_us(pipeline: Timed, capture: Played, frames: Played, repeats: int = 5) -> FloatArray:
    """Time a frame of repeated batch runs (repeats,); one more before them only warms up.

    Parameters
    ----------
    pipeline : Timed
    capture : Played
        That streams are opened for.
    frames : Played
        Received frames of it; stepped through in blocks of ``BATCH_FRAMES``.
    repeats : int

    Returns
    -------
    (repeats,) array
        Time from the raw samples of all blocks to the detections of the flush, in microseconds, over the number of
        frames.
    """
    times_us = np.empty(repeats + 1)
    with quiet():
        for repeat in range(repeats + 1):
            stream = pipeline.open(capture)
            step, sts = stream.step, "sts" in stream.needs
            start = perf_counter_ns()
            for block in frames.blocks(BATCH_FRAMES, sts=sts):
                step(block)
            stream.flush()
            times_us[repeat] = (perf_counter_ns() - start) * 1e-3 / len(frames)
    return times_us[1:]
