"""One frame a call: how long it takes in a loop and at the radar's rate, what it keeps, and several receivers at once.

Run through ``python tests/bench/run.py stream``.
"""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Iterator
from time import perf_counter_ns

import frames as made
import naive
import numpy as np
from bench_batch import check, cut
from harness import (
    Disagreement,
    Effort,
    Row,
    alone,
    at_least,
    at_most,
    interleaved,
    median,
    once,
    ratio,
    resampled,
    told,
)

from uwbbench.api import Capture, Detections, FloatArray, Frames
from uwbbench.detect.pipeline import Pipeline, Stream, load_detector
from uwbbench.measure.latency.loops import stream_pass, warm_up
from uwbbench.measure.latency.memory import resident_bytes
from uwbbench.measure.latency.paced import paced_pass, responses_us
from uwbbench.measure.latency.received import laps, received

PERIOD_US = 1e6 / made.FRAME_RATE_HZ
LONG_STREAM = 100_000
WARM_UP_WINDOWS = 10


def rows(effort: Effort) -> Iterator[Row]:
    """All targets of this module."""
    yield from looped(effort)
    yield from paced(effort)
    yield memory(effort)
    yield receivers(effort)


def looped(effort: Effort) -> list[Row]:
    """Single frames in a loop, against the naive script's."""
    capture = made.approach(effort.frames(made.FRAMES), sts=False)
    whole = capture.frames()
    detector = load_detector("paper-filtering")
    check(naive.filtering(capture, whole), Detections.join([*map(detector.open(capture).step, cut(whole, 1))]))
    frames = received(capture)
    rounds = effort.rounds(15)
    shape = (rounds, 2, len(whole))
    scripted, ours = np.empty(shape), np.empty(shape)
    with alone():
        warm_up(detector, capture, frames, WARM_UP_WINDOWS)
        for turn in range(rounds):
            scripted[turn, 0] = _scripted_us(capture, whole)
            for half in range(2):
                ours[turn, half] = stream_pass(detector, capture, frames).step_us
            scripted[turn, 1] = _scripted_us(capture, whole)
    middle = np.median(ours, axis=(1, 2))
    tail = np.percentile(ours, 99, axis=(1, 2))
    note = f"p50 {np.median(middle):.3g} us, p99 {np.median(tail):.3g} us; naive p50 {np.median(scripted):.3g} us"
    return [
        at_least("stream.step of one frame, p50: naive / ours", 15, ratio(np.median(scripted, axis=(1, 2)), middle)),
        at_most("  p99 / p50 in a loop", 3, ratio(tail, middle), note=note),
    ]


def _scripted_us(capture: Capture, whole: Frames) -> FloatArray:
    """Time of the naive script on each frame."""
    detect = naive.Detector(capture.radar).detect
    times_ns = np.empty(len(whole))
    for frame, samples in enumerate(whole.preamble):
        start = perf_counter_ns()
        detect(samples)
        times_ns[frame] = perf_counter_ns() - start
    return times_ns * 1e-3


def paced(effort: Effort) -> list[Row]:
    """Single frames at 96 Hz, with caches that have gone cold in between."""
    capture = made.approach(sts=False)
    frames = received(capture)
    detector = load_detector("paper-filtering")
    with alone():
        warm_up(detector, capture, frames, WARM_UP_WINDOWS)
        times_us, _ = paced_pass(detector, capture, frames, made.FRAME_RATE_HZ, effort.paced_s)
    second = round(made.FRAME_RATE_HZ)
    blocks = times_us[: len(times_us) // second * second].reshape(-1, second)  # neighbours are alike: resample seconds
    p99_us = resampled(blocks, lambda drawn: np.percentile(drawn, 99))
    missed = int((responses_us(times_us, PERIOD_US) > PERIOD_US).sum())
    note = f"p50 {np.median(times_us):.3g} us, longest {times_us.max():.3g} us"
    return [
        at_most(f"paced at 96 Hz for {effort.paced_s:g} s, p99", 104, p99_us, unit="us", note=note),
        at_most(f"  deadlines missed of {len(times_us):,}", 0, once(missed), unit=""),
    ]


def memory(effort: Effort) -> Row:
    """What a long stream keeps of each frame, once its buffers have their size."""
    capture = made.approach(effort.frames(made.FRAMES), sts=False)
    frames = received(capture)
    length = 2_000 if effort.quick else LONG_STREAM
    detector = load_detector("paper-filtering")
    warm_up(detector, capture, frames, WARM_UP_WINDOWS)
    resident = _kept(detector, capture, frames, length, lambda: resident_bytes() or 0)
    tracemalloc.start()
    try:
        live = _kept(detector, capture, frames, length, lambda: tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    note = f"resident size {resident:+.2g} bytes a frame"
    title = f"memory that {length:,} frames leave behind, a frame"
    return at_most(title, 1, once(live), unit="bytes", note=note)


def _kept(detector: Pipeline, capture: Capture, frames: Capture, length: int, reading: Callable[[], int]) -> float:
    """Growth of a reading for each frame of the last four fifths of a stream."""
    step, (source, numbers) = detector.open(capture).step, laps(frames, length)
    before = 0
    for number in numbers:
        if number == length // 5:
            before = reading()
        step(source.frames(number, number + 1, sts=False))
    return (reading() - before) / (length - length // 5)


def receivers(effort: Effort) -> Row:
    """Four receivers on two channels in one process, frame by frame in turn."""
    count = effort.frames(1500)
    captures = [made.approach(count, channel=channel, seed=seed) for channel in (5, 9) for seed in range(1, 5)]
    wholes = [capture.frames() for capture in captures]
    detector = load_detector("paper")

    def streams() -> list[tuple[Stream, list[Frames]]]:
        return [(detector.open(c), cut(whole, 1)) for c, whole in zip(captures, wholes, strict=True)]

    def in_turn(opened: list[tuple[Stream, list[Frames]]]) -> list[list[Detections]]:
        found: list[list[Detections]] = [[] for _ in opened]
        for number in range(count):
            for (stream, calls), parts in zip(opened, found, strict=True):
                parts.append(stream.step(calls[number]))
        return [[*parts, stream.flush()] for (stream, _), parts in zip(opened, found, strict=True)]

    def one_by_one(opened: list[tuple[Stream, list[Frames]]]) -> list[list[Detections]]:
        return [[*map(stream.step, calls), stream.flush()] for stream, calls in opened]

    for mixed, single in zip(in_turn(streams()), one_by_one(streams()), strict=True):
        _check_same(Detections.join(mixed), Detections.join(single))
    contenders = {
        "in turn": lambda: (lambda opened: lambda: in_turn(opened))(streams()),
        "one by one": lambda: (lambda opened: lambda: one_by_one(opened))(streams()),
    }
    spent = interleaved(contenders, effort.rounds(7))
    together_us = median(spent["in turn"] / count * 1e6)
    note = f"equal to separate streams; {together_us.value:.3g} us for a frame of all eight"
    return told("4 receivers x 2 channels in turn / one by one", ratio(*spent.values()), "times", note)


def _check_same(mixed: Detections, single: Detections) -> None:
    same = mixed.columns.keys() == single.columns.keys() and all(
        np.array_equal(mixed[name], single[name], equal_nan=True) for name in single.columns
    )
    if not same:
        raise Disagreement("a stream among others finds something else than alone")
