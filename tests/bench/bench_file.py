"""A million frames of a capture file in bounded memory.

Run through ``python tests/bench/run.py file``. The file is written by the project's own writer into a temporary folder
and is gone afterwards; it holds 400 MB of samples.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from time import perf_counter

import frames as made
from harness import Effort, Row, alone, at_most, once, told

from uwbbench.api.capture_file import open_capture
from uwbbench.api.capture_writing import write_capture
from uwbbench.api.frames import BATCH_FRAMES
from uwbbench.detect.pipeline import load_detector

FRAMES = 1_000_000
DISTINCT = 20_000
LIMIT_MB = 64
"""More than a few blocks of frames and what is made of them, and far less than the samples."""


def rows(effort: Effort) -> list[Row]:
    """All targets of this module."""
    count = 50_000 if effort.quick else FRAMES
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.h5"
        write_capture(path, made.lengthened(made.approach(DISTINCT, sts=False), count))
        return _measured(path, count)


def _measured(path: Path, count: int) -> list[Row]:
    size_mb = path.stat().st_size / 1e6
    capture = open_capture(path)
    detector = load_detector("paper-filtering")
    warm = detector.open(capture)
    warm.step(capture.frames(0, BATCH_FRAMES))
    with alone():
        stream = detector.open(capture)
        before = _anonymous_mb()
        peak, found = before, 0
        start = perf_counter()
        for frames in capture.blocks(BATCH_FRAMES):
            found += len(stream.step(frames))
            peak = max(peak, _anonymous_mb())
        found += len(stream.flush())
        seconds = perf_counter() - start
    note = f"{size_mb:,.0f} MB file, {found:,} detections"
    title = f"{count:,} frames of a file"
    return [
        at_most(f"{title}: memory beyond the first block's", LIMIT_MB, once(peak - before), unit="MB", note=note),
        told("  reading and detecting, a frame", once(seconds / count * 1e6), "us"),
    ]


def _anonymous_mb() -> float:
    """Memory of the process that no file stands behind: what the system could not take back."""
    status = Path("/proc/self/status").read_text()
    kilobytes = next(text for text in status.splitlines() if text.startswith("RssAnon")).split()[1]
    return int(kilobytes) / 1e3
