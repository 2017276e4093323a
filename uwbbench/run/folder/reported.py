"""What a run keeps of a results file beside its detections: which file it was, and times as the file reports them."""

from __future__ import annotations

from typing import Any

import numpy as np

from uwbbench.api.arrays import FloatArray

RESULTS_FACT = "results_file"
"""Fact of a unit: ``file``, as seen from the folder of results, and the ``sha256`` of what was read."""

REPORTED_FACT = "reported_times"
"""Fact of a unit: its times as the file reports them, summed up; who measured them and how is not known."""

SAMPLES_NEEDED = {"p90_us": 36, "p95_us": 72, "p99_us": 368}
"""Frames from which on a percentile has a 95 % interval: as many as measured times need."""


def reported_times(times_us: FloatArray) -> dict[str, Any]:
    """Percentiles of reported times (frames,); None where they are too few for one."""
    summary: dict[str, Any] = {"n": len(times_us), "p50_us": float(np.median(times_us))}
    for name, needed in SAMPLES_NEEDED.items():
        share = float(name.removeprefix("p").removesuffix("_us"))
        summary[name] = float(np.percentile(times_us, share)) if len(times_us) >= needed else None
    return summary | {"mean_us": float(np.mean(times_us)), "max_us": float(np.max(times_us))}
