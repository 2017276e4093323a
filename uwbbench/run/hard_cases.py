"""The hard cases as part of a run: what each detector makes of them, whatever the captures."""

from __future__ import annotations

import dataclasses
import traceback

from uwbbench import __version__
from uwbbench.api.errors import UwbbenchError
from uwbbench.api.interruption import by_plugin
from uwbbench.config.detector import DetectorConfig
from uwbbench.detect.pipeline import Pipeline
from uwbbench.run.environment import case_packages
from uwbbench.run.folder.identity import stability_identity, stability_name
from uwbbench.run.folder.journal import Entry
from uwbbench.run.plan import reason_of


def identity_of(detector: DetectorConfig) -> str:
    """Hash of all that the result depends on: the detector with its sources, and the versions of the cases."""
    return stability_identity(Pipeline(detector).identity, __version__, case_packages())


def examined(detector: DetectorConfig) -> Entry:
    """Entry of a detector.

    One that refuses the capture of the cases is no failure: its reason is all there is. One that breaks is.
    """
    from threadpoolctl import threadpool_limits

    from uwbbench.measure.robustness import examine

    try:
        with threadpool_limits(1):
            facts = examine(Pipeline(detector)).to_dict()
    except UwbbenchError as error:
        facts = {"refused": str(error)}
    except BaseException as error:  # a plugin may raise anything; the other detectors are still examined
        if not by_plugin(error):
            raise
        return failed(detector, reason_of(error), traceback.format_exc())
    return dataclasses.replace(failed(detector), status="done", identity=identity_of(detector), facts=facts)


def failed(detector: DetectorConfig, reason: str = "", trace: str = "") -> Entry:
    """Entry of a detector that could not be examined.

    Parameters
    ----------
    detector : DetectorConfig
    reason : str
        In one line.
    trace : str
        Traceback of what it raised.
    """
    return Entry(
        unit=stability_name(detector.name),
        kind="stability",
        detector=detector.name,
        dataset="",
        capture="",
        status="failed",
        reason=reason,
        traceback=trace,
    )
