"""What a latency pass gave, and the numbers made of its calls.

Conventions
-----------
* Times are wall-clock microseconds of single calls, one frame a call, *from samples to rows*: from the raw samples of
  the frame in memory to what was found as plain records. The step of the detector alone is given beside it (``step``).
  Reading from disk is not part of either. Nothing is subtracted: what uwbbench itself takes is a number of its own.
* Records that earlier versions stored are of the step alone, and say nothing of what they are of: ``timed``.
* A percentile needs enough calls for a two-sided 95 % interval: 36 for P90, 72 for P95, 368 for P99; with fewer it is
  None.
* Bounds of a share of missed deadlines are exact (Clopper and Pearson) for independent calls. Late calls tend to come
  together, which the longest burst shows; the bounds are then too narrow.
* Times hold on the machine that they were measured on. What travels is ``ratio_to_reference``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray
from uwbbench.measure.accuracy.stats import clopper_pearson

SAMPLES_NEEDED = {90: 36, 95: 72, 99: 368}

_CALLS = ("times_us", "step_us", "paced_times_us")

ROWS, STEP = "samples to rows", "step"
"""What times are of."""


@dataclass(frozen=True, kw_only=True)
class Latency:
    """Speed of one detector on one capture, on one machine.

    Attributes
    ----------
    timed : {"samples to rows", "step"}
        What all times without another word are of.
    p50_us, p90_us, p95_us, p99_us, mean_us, max_us : float or None
        Of single calls, one frame each.
    step : dict or None
        The same numbers of the step alone, measured inside the same calls; None where the times are of it anyway.
    n : int
        Calls behind them.
    throughput_us, throughput_best_us : float
        Median and best time a frame of repeated batch runs, from samples to detections.
    amortised_us : float
        Mean time a frame of the stream, the final flush included: rare expensive frames are spread over all.
    overhead_us : float
        Median time a frame of the null detector in the same loop: what uwbbench and the measurement cost by themselves.
    clock_us : float or None
        Median time between two readings of the clock with nothing between them; part of every call.
    startup_s : float
        From the start of the process to the first frame's answer, without opening the capture.
    peak_memory_bytes : int
        Largest memory of the process up to the end of the timed pass, the preloaded frames included.
    deadline_us : float
        Frame period of the capture.
    missed : int
        Calls that took longer.
    missed_share : float
    missed_share_low, missed_share_high : float or None
        Ends of its 95 % interval. With no deadline missed the upper end says how often it may happen nevertheless.
    longest_burst : int
        Most calls in a row that took longer.
    clustering, plain : dict or None
        Calls in which the detector clustered, and the others (``n``, ``share``, ``p50_us``, ``p90_us``, ``p95_us``,
        ``p99_us``, ``mean_us``, ``max_us``); None where it does not count them.
    age : dict or None
        How long after the arrival of its frame a detection was handed out
        (:func:`~uwbbench.measure.accuracy.age.age_summary`); None without detections.
    ratio_to_reference : dict or None
        Time relative to a reference detector over alternating blocks: ``reference``, and what
        :func:`~uwbbench.measure.latency.ratio.ratio_summary` gives, with ``disturbed_blocks``: in how many of the
        blocks other processes had the core for a while.
    paced : dict or None
        Frames handed out at a fixed rate (:func:`~uwbbench.measure.latency.paced.paced_summary`); None where not asked
        for.
    instructions_per_frame : float or None
        Instructions of a frame in user space, the harness's included; None where they were not counted.
    instructions_note : str
        Why they were not.
    memory_growth_bytes, resident_growth_bytes : float or None
        What one long stream keeps of 1 000 frames: live objects of Python and numpy, and resident size of the process.
    growth_frames : int or None
        Frames that the former was seen over.
    quality : dict
        Signs of a disturbed measurement: ``minor_faults``, ``major_faults``, ``voluntary_switches`` and
        ``involuntary_switches`` during the timed pass, ``compilations`` during all passes, ``load_before`` and
        ``load_after`` of the machine (waiting processes, mean of a minute), ``os_threads`` of the process.
    warmed : bool
        Whether two windows of warm-up agreed within 5 %.
    threads : int
        Most threads that any numerical library would use, as found after the measurement.
    pinned : bool
        Whether the process was kept on one core.
    cpu : str
    machine : dict
        The machine (:func:`~uwbbench.measure.latency.machine.machine`), the ``core`` that was used, and ``versions``.
    notes : list of str
    times_us, step_us : (n,) array
        Every call.
    paced_times_us : (frames,) array
        Every call of the paced pass.
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
    # Values of a record may be missing in runs that were stored before it held them: they have defaults.
    timed: str = STEP
    step: dict[str, Any] | None = None
    age: dict[str, Any] | None = None
    missed_share_low: float | None = None
    missed_share_high: float | None = None
    clock_us: float | None = None
    plain: dict[str, Any] | None = None
    paced: dict[str, Any] | None = None
    instructions_per_frame: float | None = None
    instructions_note: str = ""
    memory_growth_bytes: float | None = None
    resident_growth_bytes: float | None = None
    growth_frames: int | None = None
    quality: dict[str, Any] = field(default_factory=dict)
    machine: dict[str, Any] = field(default_factory=dict)
    times_us: FloatArray = field(repr=False, default_factory=lambda: np.empty(0))
    step_us: FloatArray = field(repr=False, default_factory=lambda: np.empty(0))
    paced_times_us: FloatArray = field(repr=False, default_factory=lambda: np.empty(0))

    def to_dict(self) -> dict[str, Any]:
        """Plain values without the single calls."""
        return {name: value for name, value in asdict(self).items() if name not in _CALLS}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Latency:
        """Latency from plain values."""
        calls = {name: np.asarray(values.get(name, ()), dtype=np.float64) for name in _CALLS}
        return cls(**{**values, **calls})


def call_summary(times_us: FloatArray, deadline_us: float) -> dict[str, Any]:
    """Percentiles and missed deadlines of the calls (n,)."""
    return {**distribution(times_us), "n": len(times_us), **miss_summary(times_us, deadline_us)}


def distribution(times_us: FloatArray) -> dict[str, float | None]:
    """Median, percentiles, mean and largest of the calls (n,); all None where there is none."""
    some = len(times_us) > 0
    return {
        "p50_us": float(np.median(times_us)) if some else None,
        **{f"p{q}_us": percentile(times_us, q) for q in SAMPLES_NEEDED},
        "mean_us": float(times_us.mean()) if some else None,
        "max_us": float(times_us.max()) if some else None,
    }


def miss_summary(times_us: FloatArray, deadline_us: float) -> dict[str, Any]:
    """How many of the calls (n,) took longer than their deadline, within which bounds, and how many in a row."""
    late = times_us > deadline_us
    low, high = clopper_pearson(int(late.sum()), len(late))
    return {
        "deadline_us": deadline_us,
        "missed": int(late.sum()),
        "missed_share": float(late.mean()),
        "missed_share_low": low,
        "missed_share_high": high,
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


def kinds_summary(times_us: FloatArray, clustered: BoolArray | None) -> dict[str, dict[str, Any] | None]:
    """Calls that clustered apart from the others; None for both where the detector does not count them."""
    if clustered is None:
        return {"clustering": None, "plain": None}
    return {
        name: {"n": int(chosen.sum()), "share": float(chosen.mean()), **distribution(times_us[chosen])}
        for name, chosen in (("clustering", clustered), ("plain", ~clustered))
    }
