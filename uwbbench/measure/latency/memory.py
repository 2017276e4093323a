"""Memory of the process that measures: its peak, and what a long stream keeps."""

from __future__ import annotations

import gc
import os
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

from uwbbench.api.capture import Capture
from uwbbench.api.frames import Frames
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.latency.loops import endless

SETTLING_FRAMES = 300
"""Frames after which a stream's buffers have their size."""

MEASURED_FRAMES = 1000
LIMIT_S = 1.5
"""A slow detector is watched for this long instead, after a third of it for settling."""


def peak_bytes() -> int:
    """Largest resident size so far, by the operating system; 0 where it does not report it."""
    try:
        import resource
    except ImportError:  # Windows
        return 0
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


def resident_bytes() -> int | None:
    """Resident size now, in whole pages; None where the operating system does not report it."""
    statm = Path("/proc/self/statm")
    if not statm.is_file():
        return None
    return int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def growth(pipeline: Pipeline, capture: Capture, preloaded: Frames) -> dict[str, float | int | None]:
    """What one long stream keeps of every thousand frames once it has settled.

    Two streams are run, as watching allocations takes memory itself: one for the resident size, one for the objects.
    A detector that builds a map keeps its points, and is expected to grow by them.

    Parameters
    ----------
    pipeline : Pipeline
        Warmed up before.
    capture : Capture
    preloaded : Frames
        Of the capture; gone through again and again.

    Returns
    -------
    dict
        ``memory_growth_bytes``: live objects of Python and numpy (by tracemalloc), for 1 000 frames;
        ``resident_growth_bytes``: resident size of the process, which has the grain of pages and holds what the
        allocator keeps, None where unknown; ``growth_frames``: frames between the two readings of the first.
    """
    resident, _ = _grown(pipeline, capture, preloaded, resident_bytes)
    tracemalloc.start()
    try:
        held, frames = _grown(pipeline, capture, preloaded, lambda: tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    return {"memory_growth_bytes": held, "resident_growth_bytes": resident, "growth_frames": frames}


def _grown(
    pipeline: Pipeline, capture: Capture, preloaded: Frames, reading: Callable[[], int | None]
) -> tuple[float | None, int]:
    """Growth of a reading for 1 000 frames of one stream, and the frames that it was seen over."""
    stream = pipeline.open(capture)
    step = stream.step
    source = endless(preloaded, 1 / capture.radar.frame_rate_hz, renumbered="truth" not in stream.needs)

    def run(frames: int, limit_s: float) -> int:
        until = perf_counter() + limit_s
        done = 0
        while done < frames and (perf_counter() < until or not done):  # one at least, whoever has the core meanwhile
            step(next(source))
            done += 1
        gc.collect()
        return done

    run(SETTLING_FRAMES, LIMIT_S / 3)
    before = reading()
    frames = run(MEASURED_FRAMES, LIMIT_S)
    after = reading()
    return (None if before is None or after is None else (after - before) * 1000 / frames), frames
