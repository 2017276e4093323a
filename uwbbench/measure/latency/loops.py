"""The loops that are timed.

Frames are cut before each loop and never used twice: a block of frames remembers what was once computed of it (its
magnitudes), and a second detector, or a second pass, would get that for nothing.
"""

from __future__ import annotations

import dataclasses
import gc
import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter_ns
from typing import Any

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray
from uwbbench.api.capture import Capture
from uwbbench.api.frames import Frames
from uwbbench.detect.pipeline import BATCH_FRAMES, Pipeline
from uwbbench.detect.stream import Stream

WINDOW_FRAMES = 200
"""Frames of one pass of a warm-up window, at most."""

WINDOW_S = 0.02
"""A window of fast calls repeats its pass for this long: a processor takes milliseconds to raise its clock."""

SLOW_WINDOW_S = 1.0
"""A window of slow calls ends after about this long, but not before ``SLOW_WINDOW_CALLS`` calls."""
SLOW_WINDOW_CALLS = 20

AGREEMENT = 0.05
"""Two warm-up windows whose medians differ by less than this share agree."""


def cut(preloaded: Frames, size: int) -> list[Frames]:
    """Fresh consecutive blocks of preloaded frames."""
    return [preloaded.part(start, min(start + size, len(preloaded))) for start in range(0, len(preloaded), size)]


def endless(preloaded: Frames, period_s: float, *, renumbered: bool = True) -> Iterator[Frames]:
    """Single frames without end: the preloaded ones again and again, with numbers and times that go on.

    A stream then sees one long recording, in which the robot is back at its start now and then. A detector that
    looks up the truth must get the old numbers again, which alone have one: not ``renumbered``.

    Parameters
    ----------
    preloaded : Frames
    period_s : float
        Time from the last frame of a lap to the first of the next.
    renumbered : bool
        Go on counting frames; otherwise the numbers start again with each lap.
    """
    lap_s = float(preloaded.timestamp_s[-1] - preloaded.timestamp_s[0]) + period_s
    for lap in itertools.count():
        first = preloaded.first + lap * len(preloaded) if renumbered else preloaded.first
        timestamp_s = preloaded.timestamp_s + lap * lap_s
        again = dataclasses.replace(preloaded, first=first, timestamp_s=timestamp_s)
        for at in range(len(again)):
            yield again.part(at, at + 1)


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


def call_times_us(stream: Stream, calls: list[Frames]) -> FloatArray:
    """Time of every call (calls,)."""
    step = stream.step
    times_ns = np.empty(len(calls))
    for index, frames in enumerate(calls):
        start = perf_counter_ns()
        step(frames)
        times_ns[index] = perf_counter_ns() - start
    return times_ns * 1e-3


def warm_up(pipeline: Pipeline, capture: Capture, preloaded: Frames, windows: int) -> bool:
    """Run until two windows in a row agree; whether they did within the limit.

    Every pass is a stream of its own and is flushed, so that what a stage imports or compiles only then is warm too.

    Parameters
    ----------
    pipeline : Pipeline
    capture : Capture
        That streams are opened for.
    preloaded : Frames
        Of the capture; the first ``WINDOW_FRAMES`` are used.
    windows : int
        Limit of their number.
    """
    before = np.inf
    for _ in range(windows):
        now = _window_us(pipeline, capture, preloaded)
        if abs(now - before) <= AGREEMENT * now:
            return True
        before = now
    return False


def _window_us(pipeline: Pipeline, capture: Capture, preloaded: Frames) -> float:
    """Median call of a window."""
    times_us: list[float] = []
    spent_us = 0.0
    while spent_us < WINDOW_S * 1e6:
        stream = pipeline.open(capture)
        for calls in _chunks(preloaded):
            passed = call_times_us(stream, calls)
            times_us += passed.tolist()
            spent_us += float(passed.sum())
            if spent_us > SLOW_WINDOW_S * 1e6:
                break
        stream.flush()
    return float(np.median(times_us))


def _chunks(preloaded: Frames) -> list[list[Frames]]:
    calls = cut(preloaded.part(0, WINDOW_FRAMES), 1)
    return [calls[start : start + SLOW_WINDOW_CALLS] for start in range(0, len(calls), SLOW_WINDOW_CALLS)]


def stream_pass(pipeline: Pipeline, capture: Capture, preloaded: Frames) -> tuple[FloatArray, BoolArray | None, float]:
    """Time one stream, one frame a call.

    Parameters
    ----------
    pipeline : Pipeline
        Warmed up before.
    capture : Capture
    preloaded : Frames
        Of the capture.

    Returns
    -------
    times_us : (frames,) array
        Time of every call.
    clustered : (frames,) bool array or None
        Calls in which a stage clustered; None where no stage counts that.
    flush_us : float
        Time of the flush.
    """
    stream, calls = pipeline.open(capture), cut(preloaded, 1)
    counters = [stage for stage in stream.stages if stage.clusterings is not None]
    counts = np.zeros(len(calls) + 1, np.int64)
    times_ns = np.empty(len(calls))
    step = stream.step
    with quiet():
        for index, frames in enumerate(calls):
            start = perf_counter_ns()
            step(frames)
            times_ns[index] = perf_counter_ns() - start
            if counters:
                counts[index + 1] = _total(counters)
        start = perf_counter_ns()
        stream.flush()
        flush_us = (perf_counter_ns() - start) * 1e-3
    return times_ns * 1e-3, np.diff(counts) > 0 if counters else None, flush_us


def _total(counters: list[Any]) -> int:
    return sum(stage.clusterings for stage in counters)


def batch_times_us(pipeline: Pipeline, capture: Capture, preloaded: Frames, repeats: int = 5) -> FloatArray:
    """Time a frame of repeated batch runs (repeats,); one more before them only warms up.

    Parameters
    ----------
    pipeline : Pipeline
    capture : Capture
    preloaded : Frames
        Of the capture; stepped through in blocks of ``BATCH_FRAMES``.
    repeats : int

    Returns
    -------
    (repeats,) array
        Time of all blocks and the flush, in microseconds, over the number of frames.
    """
    times_us = np.empty(repeats + 1)
    with quiet():
        for repeat in range(repeats + 1):
            stream, blocks = pipeline.open(capture), cut(preloaded, BATCH_FRAMES)
            step = stream.step
            start = perf_counter_ns()
            for frames in blocks:
                step(frames)
            stream.flush()
            times_us[repeat] = (perf_counter_ns() - start) * 1e-3 / len(preloaded)
    return times_us[1:]
