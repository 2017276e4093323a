"""Starting a measurement in a fresh process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import asdict
from time import perf_counter
from typing import Any

import yaml

from uwbbench.api.errors import UwbbenchError
from uwbbench.config.detector import DetectorConfig, read_detector
from uwbbench.config.source import CaptureRef, RunRef
from uwbbench.measure.latency.latency import Latency
from uwbbench.measure.latency.settings import LatencyModel

ONE_THREAD = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "BLIS_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMEXPR_NUM_THREADS",
        "NUMBA_NUM_THREADS",
    ),
    "1",
)


class LatencyError(UwbbenchError):
    """A detector could not be timed."""


def measure(ref: CaptureRef | RunRef, detector: DetectorConfig, settings: LatencyModel | None = None) -> Latency:
    """Time a detector on a capture, in a fresh process with one thread on one core.

    Parameters
    ----------
    ref : CaptureRef or RunRef
        A run where the detector has a mapper; times are then of a step: of all frames of one moment.
    detector : DetectorConfig
    settings : LatencyModel, optional

    Returns
    -------
    Latency

    Raises
    ------
    LatencyError
        If the process fails, or takes longer than allowed; its last words are a note of the exception.
    ConfigError
        If there is no such reference detector.
    """
    settings = settings or LatencyModel()
    reference = None if settings.reference is None else read_detector(settings.reference).here()
    spec: dict[str, Any] = {
        "detector": detector.here(),
        "capture": {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(ref).items()},
        "frames": settings.frames,
        "warmup_windows": settings.warmup_windows,
        "blocks": settings.blocks,
        "paced_s": settings.paced_s,
        "rate_hz": settings.rate_hz,
        "reference": reference,
        # The clock is the same in all processes of a machine.
        "started": perf_counter(),
    }
    # YAML, not JSON: the keys of a table by channel are numbers. -P: a file of the current folder is no module.
    command = [sys.executable, "-P", "-m", "uwbbench.measure.latency.worker"]
    try:
        done = subprocess.run(  # noqa: S603 - our own interpreter and module
            command,
            input=yaml.safe_dump(spec, sort_keys=False),
            capture_output=True,
            text=True,
            timeout=settings.timeout_s + (settings.paced_s or 0.0),
            env={**os.environ, **ONE_THREAD},
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise LatencyError(f"detector '{detector.name}' was not timed within {settings.timeout_s:g} s") from None
    if done.returncode != 0 or not done.stdout:  # a plugin may end the process as if all were well
        raise _failure(detector.name, done)
    return Latency.from_dict(json.loads(done.stdout))


def _failure(name: str, done: subprocess.CompletedProcess[str]) -> LatencyError:
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    how = f"killed by signal {-done.returncode}" if done.returncode < 0 else f"exit code {done.returncode}"
    said = lines[-1] if lines else "it said nothing"
    error = LatencyError(f"detector '{name}' could not be timed ({how}): {said}")
    error.add_note("\n".join(lines[-30:]))
    return error
