"""What a latency pass gave, and the numbers made of its calls.

Conventions
-----------
* Times are wall-clock microseconds of single calls, one frame a call. Reading and slicing frames is not part of them.
* A percentile needs enough calls for a two-sided 95 % interval: 36 for P90, 72 for P95, 368 for P99; with fewer it is
  None.
* Times hold on the machine that they were measured on. What travels is ``ratio_to_reference``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray

SAMPLES_NEEDED = {90: 36, 95: 72, 99: 368}


@dataclass(frozen=True, kw_only=True)
class Latency:
    """Speed of one detector on one capture, on one machine.

    Attributes
    ----------
    p50_us, p90_us, p95_us, p99_us, mean_us, max_us : float or None
        Of single calls, one frame each.
    n : int
        Calls behind them.
    throughput_us, throughput_best_us : float
        Median and best time a frame of repeated batch runs.
    amortised_us : float
        Mean time a frame of the stream, the final flush included: rare expensive frames are spread over all.
    overhead_us : float
        Median time a frame of the null detector in the same loop: what the measurement itself costs.
    startup_s : float
        From the start of the process to the first frame's answer, without opening the capture.
    peak_memory_bytes : int
        Largest memory of the process up to the end of the timed pass, the preloaded frames included.
    deadline_us : float
        Frame period of the capture.
    missed : int
        Calls that took longer.
    missed_share : float
    longest_burst : int
        Most calls in a row that took longer.
    clustering : dict or None
        Calls in which the detector clustered (``n``, ``share``, ``p50_us``, ``mean_us``); None where it does not tell.
    ratio_to_reference : dict or None
        Median over alternating blocks of the time relative to a reference detector: ``reference``, ``ratio``, ``low``
        and ``high`` (95 % bootstrap over blocks, None below eight blocks), ``blocks``.
    warmed : bool
        Whether two windows of warm-up agreed within 5 %.
    threads : int
        Most threads that any numerical library would use, as found after the measurement.
    pinned : bool
        Whether the process was kept on one core.
    cpu : str
    notes : list of str
    times_us : (n,) array
        Every call.
    """

    p50_us: float
    p90_us: float | None
    p95_us: float | None
    p99_us: float | None
    mean_us: float
    max_us: float
    n: int
    throughput_us: float
    throughput_best_us: float
    amortised_us: float
    overhead_us: float
    startup_s: float
    peak_memory_bytes: int
    deadline_us: float
    missed: int
    missed_share: float
    longest_burst: int
    clustering: dict[str, Any] | None
    ratio_to_reference: dict[str, Any] | None
    warmed: bool
    threads: int
    pinned: bool
    cpu: str
    notes: list[str] = field(default_factory=list)
    times_us: FloatArray = field(repr=False, default_factory=lambda: np.empty(0))

    def to_dict(self) -> dict[str, Any]:
        """Plain values without the single calls."""
        values = asdict(self)
        del values["times_us"]
        return values

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Latency:
        """Latency from plain values."""
        return cls(**{**values, "times_us": np.asarray(values.get("times_us", ()), dtype=np.float64)})


def call_summary(times_us: FloatArray, deadline_us: float) -> dict[str, Any]:
    """Percentiles and missed deadlines of the calls (n,)."""
    late = times_us > deadline_us
    return {
        "p50_us": float(np.median(times_us)),
        **{f"p{q}_us": percentile(times_us, q) for q in SAMPLES_NEEDED},
        "mean_us": float(times_us.mean()),
        "max_us": float(times_us.max()),
        "n": len(times_us),
        "deadline_us": deadline_us,
        "missed": int(late.sum()),
        "missed_share": float(late.mean()),
        "longest_burst": longest_run(late),
    }


def percentile(times_us: FloatArray, q: int) -> float | None:
    """Percentile q of the calls; None where there are too few of them."""
    return float(np.percentile(times_us, q)) if len(times_us) >= SAMPLES_NEEDED[q] else None


def longest_run(marked: BoolArray) -> int:
    """Most marked calls in a row.

    Examples
    --------
    >>> longest_run(np.array([True, False, True, True]))
    2
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], marked.astype(np.int8), [0]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def clustering_summary(times_us: FloatArray, clustered: BoolArray | None) -> dict[str, Any] | None:
    """Time of the calls that clustered."""
    if clustered is None:
        return None
    found = times_us[clustered]
    return {
        "n": len(found),
        "share": float(clustered.mean()),
        "p50_us": float(np.median(found)) if len(found) else None,
        "mean_us": float(found.mean()) if len(found) else None,
    }


def ratio_summary(ours_s: FloatArray, reference_s: FloatArray, resamples: int = 1000) -> dict[str, Any]:
    """Ratio of two detectors from the times of alternating blocks (blocks,): exp of the median log ratio."""
    logs = np.log(ours_s / reference_s)
    low = high = None
    if len(logs) >= 8:
        drawn = np.random.default_rng(0).integers(len(logs), size=(resamples, len(logs)))
        low, high = (float(np.exp(end)) for end in np.quantile(np.median(logs[drawn], axis=1), [0.025, 0.975]))
    return {"ratio": float(np.exp(np.median(logs))), "low": low, "high": high, "blocks": len(logs)}
