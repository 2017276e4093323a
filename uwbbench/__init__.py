"""uwbbench: a benchmark of UWB radar detectors, on the same captures, with the same metrics, speed against error.

Examples
--------
>>> import uwbbench
>>> capture = uwbbench.open_capture("run.h5")  # doctest: +SKIP
>>> detector = uwbbench.load_detector("paper")
>>> found = detector.run(capture)  # doctest: +SKIP
>>> scores = uwbbench.score(found, capture, scoring="frame", gate_m=0.20)  # doctest: +SKIP
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from uwbbench.api.capture_file import open_capture, write_capture
    from uwbbench.detect.pipeline import load_detector
    from uwbbench.measure.accuracy.scoring import score
    from uwbbench.measure.calibration import calibrate

__version__ = "0.1.0"
__all__ = ["__version__", "calibrate", "load_detector", "open_capture", "score", "write_capture"]

_HOME = {
    "open_capture": "uwbbench.api.capture_file",
    "write_capture": "uwbbench.api.capture_file",
    "calibrate": "uwbbench.measure.calibration",
    "load_detector": "uwbbench.detect.pipeline",
    "score": "uwbbench.measure.accuracy.scoring",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'uwbbench' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOME[name]), name)
