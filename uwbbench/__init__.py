"""uwbbench: a benchmark of UWB radar detectors, on the same captures, with the same metrics, speed against error.

Examples
--------
>>> import uwbbench
>>> capture = uwbbench.open_capture("run.h5")  # doctest: +SKIP
>>> detector = uwbbench.load_detector("paper")
>>> found = detector.run(capture)  # doctest: +SKIP
>>> scores = uwbbench.score(found, capture, scoring="frame", gate_m=0.20)  # doctest: +SKIP
>>> run = uwbbench.run("demo", out="first")  # doctest: +SKIP
>>> run.leaderboard[["detector", "f1", "f1_low", "f1_high"]]  # doctest: +SKIP
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from uwbbench.api.capture_file import open_capture
    from uwbbench.api.capture_writing import write_capture
    from uwbbench.api.registry import register
    from uwbbench.detect.mapping import load_mapper
    from uwbbench.detect.pipeline import detector_from_yaml, load_detector
    from uwbbench.detect.results_file import read_results
    from uwbbench.measure.accuracy.scoring import score
    from uwbbench.measure.calibration import calibrate
    from uwbbench.tools.fit.library import fit_scene
    from uwbbench.tools.library import compare, gate, leaderboard, open_dataset, open_run, plot, run, tune
    from uwbbench.tools.stored_run import Run

__version__ = "0.1.0"
__all__ = [
    "Run",
    "__version__",
    "calibrate",
    "compare",
    "detector_from_yaml",
    "fit_scene",
    "gate",
    "leaderboard",
    "load_detector",
    "load_mapper",
    "open_capture",
    "open_dataset",
    "open_run",
    "plot",
    "read_results",
    "register",
    "run",
    "score",
    "tune",
    "write_capture",
]

_LIBRARY = "uwbbench.tools.library"
_HOME = {
    "open_capture": "uwbbench.api.capture_file",
    "write_capture": "uwbbench.api.capture_writing",
    "register": "uwbbench.api.registry",
    "calibrate": "uwbbench.measure.calibration",
    "detector_from_yaml": "uwbbench.detect.pipeline",
    "load_detector": "uwbbench.detect.pipeline",
    "load_mapper": "uwbbench.detect.mapping",
    "read_results": "uwbbench.detect.results_file",
    "score": "uwbbench.measure.accuracy.scoring",
    "fit_scene": "uwbbench.tools.fit.library",
    "Run": "uwbbench.tools.stored_run",
    **dict.fromkeys(("compare", "gate", "leaderboard", "open_dataset", "open_run", "plot", "tune"), _LIBRARY),
}


def __getattr__(name: str) -> Any:
    if name == "run":
        return importlib.import_module("uwbbench.run")
    if name not in _HOME:
        raise AttributeError(f"module 'uwbbench' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)


# ``uwbbench.run`` is two things: the room that carries out experiments, and what a user calls to run one. Whoever
# imports a module of the room makes Python set the attribute ``run`` of this module to that room, at a moment that
# nobody controls, so a function of this name would be gone by then. Hence the room itself is made callable, here and
# not in the room, which must not know what is built on it. ``import uwbbench.run.execute``, ``from uwbbench.run import
# run_experiment`` and ``uwbbench.run(...)`` all work, in any order; type checkers see the function.


class _PickledByName(ModuleType):
    """A module that is pickled as its name, as cloudpickle does with modules that have no class of their own."""

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return importlib.import_module, (self.__name__,)


class _RunRoom(_PickledByName):
    """The package ``uwbbench.run``; to call it is to call :func:`uwbbench.tools.library.run`."""

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Run an experiment into a run folder; see :func:`uwbbench.tools.library.run`."""
        return self._function()(*args, **kwargs)

    @property
    def __signature__(self) -> Any:
        import inspect  # only where somebody asks; it takes longer than all else here

        return inspect.signature(self._function())

    @staticmethod
    def _function() -> Any:
        return importlib.import_module(_LIBRARY).run


class _Package(_PickledByName):
    """The package ``uwbbench``; makes its room ``run`` callable when the import system attaches it."""

    def __setattr__(self, name: str, value: object) -> None:
        if name == "run" and isinstance(value, ModuleType):
            value.__class__ = _RunRoom
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
