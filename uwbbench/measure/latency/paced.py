"""Frames handed out at the radar's own rate, as on a robot: the process sleeps in between, and its caches go cold.

Conventions
-----------
* A frame is due at a fixed time. The loop sleeps until shortly before, then watches the clock, as a sleep alone ends
  some 0.1 ms late. What it starts late nevertheless is the harness's lateness: kept apart, never the detector's.
* The call of a frame begins with its raw samples, as a driver has just received them, and ends with its rows as plain
  records.
* The deadline of a frame is the next frame. A detector that takes longer makes the next frame wait, and the wait
  counts: the response of a frame is its call and what earlier calls left undone when it was due.
"""

from __future__ import annotations

import time
from time import perf_counter_ns
from typing import Any

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.measure.latency.latency import call_summary, miss_summary
from uwbbench.measure.latency.loops import quiet
from uwbbench.measure.latency.played import Played, Timed
from uwbbench.measure.latency.received import laps

SPIN_S = 0.3e-3
"""The clock is watched for this long: longer than sleeps end late, short enough that the loop leaves caches alone."""

LATE_START_US = 10.0
"""A frame started later than this was started late by the harness."""


def paced_pass(
    pipeline: Timed, capture: Played, frames: Played, rate_hz: float, seconds: float
) -> tuple[FloatArray, FloatArray]:
    """Hand out frames at a rate, for a while, to one stream.

    Parameters
    ----------
    pipeline : Timed
        Warmed up before.
    capture : Played
        That the stream is opened for.
    frames : Played
        Received frames of it; they start again where they are shorter than that.
    rate_hz, seconds : float

    Returns
    -------
    times_us : (frames,) array
        Time of every call; a run is handed out once, so that there are no more than it has.
    lateness_us : (frames,) array
        From the moment at which the call could have started (the frame was due and the detector free) to its start.
    """
    stream = pipeline.open(capture)
    count = max(1, round(seconds * rate_hz))
    source, numbers = laps(frames, count, renumbered="truth" not in stream.needs)
    step, receive, sts = stream.step, source.frames, "sts" in stream.needs
    period_ns, spin_ns = 1e9 / rate_hz, min(SPIN_S, 0.25 / rate_hz) * 1e9
    times_ns, lateness_ns = np.empty(len(numbers)), np.empty(len(numbers))
    with quiet():
        begin = perf_counter_ns() + int(period_ns)
        ended = begin
        for number, frame in enumerate(numbers):
            due = begin + int(number * period_ns)
            idle_ns = due - perf_counter_ns() - spin_ns
            if idle_ns > 0:
                time.sleep(idle_ns * 1e-9)
            start = perf_counter_ns()
            while start < due:
                start = perf_counter_ns()
            step(receive(frame, frame + 1, sts=sts)).records()
            free, ended = max(due, ended), perf_counter_ns()
            times_ns[number], lateness_ns[number] = ended - start, start - free
    return times_ns * 1e-3, lateness_ns * 1e-3


def responses_us(times_us: FloatArray, period_us: float) -> FloatArray:
    """Time (frames,) from each frame being due to its answer, as if every start had been on time.

    A queue with one server and a fixed rate of arrival; its waiting times follow from the calls alone (D. V. Lindley,
    The theory of queues with a single server, 1952).

    Examples
    --------
    >>> responses_us(np.array([1.0, 15.0, 1.0, 1.0]), period_us=10.0).tolist()
    [1.0, 15.0, 6.0, 1.0]
    """
    answers_us = np.empty(len(times_us))
    left_us = 0.0
    for number, time_us in enumerate(times_us):
        answers_us[number] = left_us + time_us
        left_us = max(0.0, answers_us[number] - period_us)
    return answers_us


def paced_summary(times_us: FloatArray, lateness_us: FloatArray, rate_hz: float) -> dict[str, Any]:
    """Numbers of a paced pass.

    Parameters
    ----------
    times_us, lateness_us : (frames,) array
        As :func:`paced_pass` returns them.
    rate_hz : float
        At which the frames were handed out.

    Returns
    -------
    dict
        Those of :func:`~uwbbench.measure.latency.latency.call_summary` with missed deadlines by response, ``rate_hz``,
        ``p50_period_share`` and ``p99_period_share`` of the frame period, ``late_starts`` of the harness, and
        ``lateness_p50_us``, ``lateness_p99_us``, ``lateness_max_us``.
    """
    period_us = 1e6 / rate_hz
    summary = call_summary(times_us, period_us) | miss_summary(responses_us(times_us, period_us), period_us)
    p99_us = summary["p99_us"]
    return {
        "rate_hz": rate_hz,
        **summary,
        "p50_period_share": summary["p50_us"] / period_us,
        "p99_period_share": None if p99_us is None else p99_us / period_us,
        "late_starts": int((lateness_us > LATE_START_US).sum()),
        "lateness_p50_us": float(np.median(lateness_us)),
        "lateness_p99_us": float(np.percentile(lateness_us, 99)),
        "lateness_max_us": float(lateness_us.max()),
    }
