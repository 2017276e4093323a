"""Memory of the process that measures: its peak, and what a long stream keeps."""

from __future__ import annotations

import gc
import os
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

from uwbbench.measure.latency.played import Played, Timed
from uwbbench.measure.latency.received import laps

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


def growth(pipeline: Timed, capture: Played, frames: Played) -> dict[str, float | int | None]:
    """What one long stream keeps of every thousand frames once it has settled.

    Two streams are run, as watching allocations takes memory itself: one for the resident size, one for the objects.
    A detector that builds a map keeps its points, and is expected to grow by them.

    Parameters
    ----------
    pipeline : Timed
        Warmed up before.
    capture : Played
        That streams are opened for.
    frames : Played
        Received frames of it; gone through again and again.

    Returns
    -------
    dict
        ``memory_growth_bytes``: live objects of Python and numpy (by tracemalloc), for 1 000 frames;
        ``resident_growth_bytes``: resident size of the process, which has the grain of pages and holds what the
        allocator keeps, None where unknown; ``growth_frames``: frames between the two readings of the first.
    """
    resident, _ = _grown(pipeline, capture, frames, resident_bytes)
    tracemalloc.start()
    try:
        held, count = _grown(pipeline, capture, frames, lambda: tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    return {"memory_growth_bytes": held, "resident_growth_bytes": resident, "growth_frames": count}


def _grown(
    pipeline: Timed, capture: Played, frames: Played, reading: Callable[[], int | None]
) -> tuple[float | None, int]:
    """Growth of a reading for 1 000 frames of one stream, and the frames that it was seen over."""
    stream = pipeline.open(capture)
    source, numbers = laps(frames, SETTLING_FRAMES + MEASURED_FRAMES, renumbered="truth" not in stream.needs)
    step, receive, sts = stream.step, source.frames, "sts" in stream.needs
    settling = min(SETTLING_FRAMES, len(numbers) // 3)
    coming = iter(numbers)

    def run(most: int, limit_s: float) -> int:
        until = perf_counter() + limit_s
        done = 0
        while done < min(most, len(numbers) - settling) and (
            perf_counter() < until or not done
        ):  # one at least, whoever has the core meanwhile
            frame = next(coming)
            step(receive(frame, frame + 1, sts=sts)).records()
            done += 1
        gc.collect()
        return done

    run(settling, LIMIT_S / 3)
    before = reading()
    count = run(MEASURED_FRAMES, LIMIT_S)
    after = reading()
    return (None if before is None or after is None else (after - before) * 1000 / count), count
