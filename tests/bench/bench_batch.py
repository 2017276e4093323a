"""Whole captures: how many times faster than the naive script, how far from the floor, and how the time grows.

Run through ``python tests/bench/run.py batch``. Our side is a batch as ``Pipeline.run`` makes it, on frames that lie in
memory, as do those of the others: an opened stream steps through blocks of 4 096 frames and is flushed.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from time import perf_counter

import frames as made
import naive
import numpy as np
from floor import Floor, compiler
from harness import (
    Disagreement,
    Effort,
    Row,
    Run,
    at_least,
    at_most,
    exponent,
    interleaved,
    missing,
    ratio,
    told,
)

from uwbbench.api import Capture, Detections, FloatArray, Frames
from uwbbench.api.frames import BATCH_FRAMES
from uwbbench.detect.pipeline import Pipeline, load_detector

FRAME_COUNTS = (1_000, 10_000, 100_000, 1_000_000)
TAP_COUNTS = (50, 100, 200, 400, 1016)
ENTRIES = ("detect_first", "detect_first_plain", "detect_all")  # of the floor; the last one only to agree
DISTINCT = 20_000  # frames that the longest captures repeat


def rows(effort: Effort) -> Iterator[Row]:
    """All targets of this module."""
    yield from filtering(effort)
    yield filtering_with_sts(effort)
    yield two_threads(effort)
    yield mapping(effort)
    yield growth_in_frames(effort)
    yield growth_in_taps(effort, "echoes", made.echoes)
    yield growth_in_taps(effort, "combs", made.comb)


def filtering(effort: Effort) -> Iterator[Row]:
    """`paper-filtering` against the naive script and the floor in C, without STS."""
    capture = made.approach(effort.frames(made.FRAMES), sts=False)
    whole = capture.frames()
    detector = load_detector("paper-filtering")
    found = detector.run(capture)
    check(naive.filtering(capture, whole), found)
    contenders = {
        "naive": lambda: partial(naive.filtering, capture, whole),
        "ours": batch(detector, capture, whole),
    }
    title = f"paper-filtering, {len(whole):,} frames, one thread"
    with tempfile.TemporaryDirectory() as folder:
        if compiler() is None:
            spent = interleaved(contenders, effort.rounds(25))
            floor_rows = [missing("  ours / exact C", "<= 2", "no C compiler")]
        else:
            floor = Floor(Path(folder))
            for entry in ENTRIES:
                compiled = floor.detector(capture.radar, len(whole), entry)
                check_equal(compiled(whole.preamble), found)
                contenders[entry] = partial(partial, compiled, whole.preamble)
            spent = interleaved(contenders, effort.rounds(25))
            floor_rows = _against_floor(spent, len(whole), floor.instructions)
    against_naive = ratio(spent["naive"], spent["ours"])
    note = f"{per_frame(spent['ours'], len(whole)):.3g} us a frame; naive {per_frame(spent['naive'], len(whole)):.3g}"
    yield at_least(f"{title}: naive / ours", 100, against_naive, note=note)
    yield at_least("  stretch", 200, against_naive)
    yield from floor_rows


def _against_floor(spent: dict[str, FloatArray], frames: int, instructions: str) -> list[Row]:
    fastest, plain = spent["detect_first"], spent["detect_first_plain"]
    return [
        at_most(
            "  ours / exact C",
            2,
            ratio(spent["ours"], fastest),
            note=f"{instructions}, {per_frame(fastest, frames):.3g} us a frame",
        ),
        told("  ours / the same in plain C", ratio(spent["ours"], plain), "times"),
        told("  naive / exact C: all that there is to gain", ratio(spent["naive"], fastest), "times"),
    ]


def filtering_with_sts(effort: Effort) -> Row:
    """`paper-filtering` with the filter on the phase difference."""
    capture = made.approach(effort.frames(made.FRAMES))
    whole = capture.frames()
    detector = load_detector("paper-filtering")
    check(naive.filtering_with_sts(capture, whole), detector.run(capture))
    contenders = {
        "naive": lambda: partial(naive.filtering_with_sts, capture, whole),
        "ours": batch(detector, capture, whole),
    }
    spent = interleaved(contenders, effort.rounds(15))
    note = f"{per_frame(spent['ours'], len(whole)):.3g} us a frame"
    return at_least("  with STS and the filter on phase", 100, ratio(spent["naive"], spent["ours"]), note=note)


def two_threads(effort: Effort) -> Row:
    """`paper-filtering` on two threads against the naive script, which has one."""
    capture = made.approach(effort.frames(made.FRAMES), sts=False)
    whole = capture.frames()
    detector = load_detector("paper-filtering")
    contenders = {
        "naive": lambda: partial(naive.filtering, capture, whole),
        "one": batch(detector, capture, whole),
        "two": batch(detector, capture, whole, threads=2),
    }
    check_equal(joined(contenders["two"]()), joined(contenders["one"]()))
    spent = interleaved(contenders, effort.rounds(25), cores=2, clock=perf_counter)
    note = f"{ratio(spent['one'], spent['two']).value:.3g} times one thread"
    return at_least("  two threads: naive / ours", 180, ratio(spent["naive"], spent["two"]), note=note)


def mapping(effort: Effort) -> Row:
    """`paper` with its map against the naive script that runs scikit-learn's DBSCAN after every 50 points."""
    capture = made.tour(effort.frames(made.FRAMES))
    whole = capture.frames()
    detector = load_detector("paper")
    found = detector.run(capture)
    expected, mapper = naive.mapping(capture, whole)
    order = np.argsort(found.frame, kind="stable")
    check(expected, found.take(order))
    points_m = np.stack([found["x_m"], found["y_m"]], axis=1)[order]
    if not np.allclose(points_m, mapper.points, rtol=0, atol=1e-5):
        raise Disagreement("paper: world points differ from the naive script's")
    contenders = {
        "naive": lambda: partial(naive.mapping, capture, whole),
        "ours": batch(detector, capture, whole),
    }
    spent = interleaved(contenders, effort.rounds(7))
    note = f"{len(found):,} points; {per_frame(spent['ours'], len(whole)):.3g} us a frame"
    title = f"paper with map, {len(whole):,} frames: naive with scikit-learn / ours"
    return at_least(title, 200, ratio(spent["naive"], spent["ours"]), note=note)


def growth_in_frames(effort: Effort) -> Row:
    """Power of the number of frames with which the time grows."""
    counts = FRAME_COUNTS[:2] if effort.quick else FRAME_COUNTS
    longest = made.lengthened(made.approach(min(DISTINCT, counts[-1]), sts=False), counts[-1])
    whole = longest.frames()
    detector = load_detector("paper-filtering")
    contenders = {str(count): batch(detector, longest, whole.part(0, count)) for count in counts}
    spent = interleaved(contenders, effort.rounds(9))
    note = f"{per_frame(spent[str(counts[-1])], counts[-1]):.3g} us a frame at {counts[-1]:,}"
    title = f"exponent in frames, {counts[0]:,} to {counts[-1]:,}"
    return at_most(title, 1.02, exponent(counts, np.stack(list(spent.values()), axis=1)), unit="", note=note)


def growth_in_taps(effort: Effort, name: str, make: Callable[[int, int], Capture]) -> Row:
    """Power of the number of taps with which the time grows."""
    counts = TAP_COUNTS[::2] if effort.quick else TAP_COUNTS
    detector = load_detector("paper-filtering")
    contenders: dict[str, Callable[[], Run]] = {}
    scripts = []
    for taps in counts:
        capture = make(effort.frames(2000), taps)
        whole = capture.frames()
        few = whole.part(0, 100)
        check(naive.filtering(capture, few), joined(batch(detector, capture, few)()))
        contenders[str(taps)] = batch(detector, capture, whole)
        contenders[f"naive {taps}"] = partial(partial, naive.filtering, capture, few)
        scripts.append(f"naive {taps}")
    spent = interleaved(contenders, effort.rounds(11))
    found = exponent(counts, np.stack([spent[str(taps)] for taps in counts], axis=1))
    script = exponent(counts, np.stack([spent[name] for name in scripts], axis=1))
    last = per_frame(spent[str(counts[-1])], effort.frames(2000))
    note = f"{last:.3g} us a frame at {counts[-1]}; exponent of naive {script.value:.3g}"
    return at_most(f"exponent in taps, {counts[0]} to {counts[-1]}, {name}", 1.1, found, unit="", note=note)


def batch(detector: Pipeline, capture: Capture, whole: Frames, **how: int) -> Callable[[], Run]:
    """Prepare a batch: the opened stream, and blocks of frames that nobody has used."""

    def prepare() -> Run:
        stream, blocks = detector.open(capture, **how), cut(whole, BATCH_FRAMES)
        return lambda: [*map(stream.step, blocks), stream.flush()]

    return prepare


def cut(whole: Frames, size: int) -> list[Frames]:
    """Fresh consecutive blocks of frames."""
    return [whole.part(start, min(start + size, len(whole))) for start in range(0, len(whole), size)]


def joined(run: Run) -> Detections:
    """What a batch found, in one table."""
    return Detections.join(run())


def per_frame(seconds: FloatArray, frames: int) -> float:
    """Microseconds a frame, the median over the rounds; for people, as times do not travel."""
    return float(np.median(seconds)) * 1e6 / frames


def check(expected: Sequence[naive.Found | None], found: Detections) -> None:
    """Refuse to time detectors that keep other peaks than the naive script.

    Raises
    ------
    Disagreement
    """
    kept = [(frame, peak) for frame, peak in enumerate(expected) if peak is not None]
    if [(frame, peak.tap) for frame, peak in kept] != list(
        zip(found.frame.tolist(), found["tap"].tolist(), strict=True)
    ):
        raise Disagreement("other peaks than the naive script's")
    for name in ("prominence", "width_taps", "range_m"):
        values = [getattr(peak, name) for _, peak in kept]
        if not np.allclose(values, found[name], rtol=1e-3, atol=1e-5):  # the script works in single precision
            raise Disagreement(f"{name} differs from the naive script's by {np.abs(values - found[name]).max():.1e}")


def check_equal(other: Detections, found: Detections) -> None:
    """Refuse to time detectors that differ by more than the rounding of a logarithm.

    Raises
    ------
    Disagreement
    """
    for name in ("frame", "tap", "amplitude", "prominence", "width_taps"):
        if not np.array_equal(other[name], found[name]):
            raise Disagreement(f"{name} is not the same to the last bit")
    for name in ("score_db", "delay_s", "range_m"):
        if not np.allclose(other[name], found[name], rtol=1e-12, atol=0):
            raise Disagreement(f"{name} differs")
