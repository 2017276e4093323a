"""The process that measures: reads what to measure from standard input, writes the result as JSON.

Run as ``python -m uwbbench.timing.worker``. Threads of numerical libraries are limited by environment variables,
which the parent sets, as some libraries read them only when they are imported.
"""

from __future__ import annotations

import json
import os
import sys
from time import perf_counter
from typing import Any

import yaml


def main() -> int:
    """Measure once."""
    from uwbbench.api.errors import UwbbenchError

    answer = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever a plugin prints must not end up in the answer
    spec = yaml.safe_load(sys.stdin)
    pinned = _pin()
    try:
        result = _measured(spec)
    except UwbbenchError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    with answer:
        json.dump({**result, "pinned": pinned}, answer)
    return 0


def _pin() -> bool:
    """Keep this process on one core, so that it never moves to a cold cache."""
    if not hasattr(os, "sched_setaffinity"):
        return False
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(cores)})  # interrupts tend to be served by the first
    return True


def _measured(spec: dict[str, Any]) -> dict[str, Any]:
    from uwbbench.api.errors import CaptureError
    from uwbbench.config.source import CaptureRef
    from uwbbench.timing import latency, loops

    pipeline = _pipeline(spec["detector"])
    opening = perf_counter()
    capture = CaptureRef(**{**spec["capture"], "roots": tuple(spec["capture"]["roots"])}).open()
    whole = capture.frames(0, spec["frames"])
    opening_s = perf_counter() - opening
    if len(whole) == 0:
        raise CaptureError(f"capture '{capture.name}' has no frames; there is nothing to time")
    stream = pipeline.open(capture)
    stream.step(whole.part(0, 1))
    startup_s = perf_counter() - spec["started"] - opening_s

    warmed = loops.warm_up(pipeline, capture, whole, spec["warmup_windows"])
    times_us, clustered, flush_us = loops.stream_pass(pipeline, capture, whole)
    peak_memory_bytes = _peak_memory_bytes()
    batch_us = loops.batch_times_us(pipeline, capture, whole)
    notes = [] if warmed else ["warm-up windows never agreed within 5 %"]
    if len(capture) > len(whole):
        notes.append(f"timed the first {len(whole)} of {len(capture)} frames")
    ratio = None
    if spec["reference"] is not None:
        reference = _pipeline(spec["reference"])
        loops.warm_up(reference, capture, whole, spec["warmup_windows"])
        pair = loops.alternating(pipeline, reference, capture, whole)
        ratio = {"reference": reference.name, **latency.ratio_summary(*pair)}
    null = _pipeline(NULL)
    overhead_us, _, _ = loops.stream_pass(null, capture, whole)
    threads = _threads()
    if threads > 1:
        notes.append(f"a numerical library would use {threads} threads")
    return {
        **latency.call_summary(times_us, 1e6 / capture.radar.frame_rate_hz),
        "throughput_us": sorted(batch_us)[len(batch_us) // 2],
        "throughput_best_us": min(batch_us),
        "amortised_us": float(times_us.sum() + flush_us) / len(times_us),
        "overhead_us": sorted(overhead_us)[len(overhead_us) // 2],
        "startup_s": startup_s,
        "peak_memory_bytes": peak_memory_bytes,
        "clustering": latency.clustering_summary(times_us, clustered),
        "ratio_to_reference": ratio,
        "warmed": warmed,
        "threads": threads,
        "notes": notes,
        "times_us": times_us.tolist(),
    }


NULL = {"schema": 1, "name": "null", "pipeline": [{"use": "reference.nothing"}]}


def _pipeline(data: dict[str, Any]) -> Any:
    from uwbbench.api.yaml_file import YamlFile
    from uwbbench.config.detector import check_detector
    from uwbbench.pipeline import Pipeline

    return Pipeline(check_detector(data, YamlFile(f"detector '{data['name']}'", data, {})))


def _peak_memory_bytes() -> int:
    """Largest resident size so far, by the operating system; 0 where it does not tell."""
    try:
        import resource
    except ImportError:  # Windows
        return 0
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


def _threads() -> int:
    """Most threads that any loaded numerical library would use."""
    from threadpoolctl import threadpool_info

    return max((int(pool["num_threads"]) for pool in threadpool_info()), default=1)


if __name__ == "__main__":
    sys.exit(main())
