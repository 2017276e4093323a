"""The loops that are timed.

Frames are cut before each loop and never used twice: a block of frames remembers what was once computed of it (its
magnitudes), and a second detector, or a second pass, would get that for nothing.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import Any

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray
from uwbbench.api.capture import Capture
from uwbbench.api.frames import Frames
from uwbbench.pipeline import BATCH_FRAMES, Pipeline, Stream

WINDOW_FRAMES = 200
"""Frames of a warm-up window."""

AGREEMENT = 0.05
"""Two warm-up windows whose medians differ by less than this share agree."""

MINIMUM_BLOCKS = 32
BLOCK_FRAMES = 20
"""Blocks of the comparison with the reference: this many frames, or fewer where that gave too few blocks."""


def cut(whole: Frames, size: int) -> list[Frames]:
    """Fresh consecutive blocks of preloaded frames."""
    return [whole.part(start, min(start + size, len(whole))) for start in range(0, len(whole), size)]


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


def call_times_us(stream: Stream, calls: list[Frames]) -> FloatArray:
    """Time of every call (calls,)."""
    times = np.empty(len(calls))
    for index, frames in enumerate(calls):
        start = perf_counter()
        stream.step(frames)
        times[index] = perf_counter() - start
    return times * 1e6


def warm_up(pipeline: Pipeline, capture: Capture, whole: Frames, windows: int) -> bool:
    """Run until two windows in a row agree; whether they did within the limit.

    Each window is flushed, so that what a stage imports or compiles only then is warm too.
    """
    window = whole.part(0, min(len(whole), WINDOW_FRAMES))
    before = np.inf
    for _ in range(windows):
        stream = pipeline.open(capture)
        now = float(np.median(call_times_us(stream, cut(window, 1))))
        stream.flush()
        if abs(now - before) <= AGREEMENT * now:
            return True
        before = now
    return False


def stream_pass(pipeline: Pipeline, capture: Capture, whole: Frames) -> tuple[FloatArray, BoolArray | None, float]:
    """One frame a call: time of every call, which calls clustered, and the time of the flush, in microseconds."""
    stream, calls = pipeline.open(capture), cut(whole, 1)
    counters = [stage for stage in stream.stages if hasattr(stage, "clusterings")]
    clustered = np.zeros(len(calls), bool)
    times_us = np.empty(len(calls))
    before = 0
    with quiet():
        for index, frames in enumerate(calls):
            start = perf_counter()
            stream.step(frames)
            times_us[index] = (perf_counter() - start) * 1e6
            count = _total(counters)
            clustered[index] = count > before
            before = count
        start = perf_counter()
        stream.flush()
        flush_us = (perf_counter() - start) * 1e6
    return times_us, clustered if counters else None, flush_us


def _total(counters: list[Any]) -> int:
    return sum(stage.clusterings for stage in counters)


def batch_times_us(pipeline: Pipeline, capture: Capture, whole: Frames, repeats: int = 5) -> FloatArray:
    """Time a frame of repeated batch runs (repeats,)."""
    times = []
    for _ in range(repeats):
        stream, blocks = pipeline.open(capture), cut(whole, BATCH_FRAMES)
        with quiet():
            start = perf_counter()
            for frames in blocks:
                stream.step(frames)
            stream.flush()
            times.append((perf_counter() - start) * 1e6 / len(whole))
    return np.array(times)


def alternating(first: Pipeline, second: Pipeline, capture: Capture, whole: Frames) -> tuple[FloatArray, FloatArray]:
    """Times (blocks,) of two detectors that take turns on the same frames, block by block, in the order ABBA.

    Slow drift of the machine (its clock, its other work) meets both alike and cancels in the ratio of a block.
    """
    size = min(BLOCK_FRAMES, max(1, len(whole) // MINIMUM_BLOCKS))
    streams = first.open(capture), second.open(capture)
    calls = cut(whole, 1), cut(whole, 1)
    spent = np.zeros((len(whole) // size, 2))
    with quiet():
        for block, times in enumerate(spent):
            part = slice(block * size, (block + 1) * size)
            for who in (0, 1) if block % 2 == 0 else (1, 0):
                start = perf_counter()
                for frames in calls[who][part]:
                    streams[who].step(frames)
                times[who] = perf_counter() - start
    return spent[:, 0], spent[:, 1]
