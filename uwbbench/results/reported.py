"""What the sources of methods report of them, beside what a run gives: no target, and mostly not the same quantity."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from uwbbench.measure.accuracy.stats import Estimate

if TYPE_CHECKING:
    from uwbbench.results.report import Report


@dataclass(frozen=True)
class Reported:
    """Figures of a source, and those of a run on one board.

    Attributes
    ----------
    detector : str
    figures, of, source : str
        As the detector's file has them.
    board : mapping
        ``dataset``, ``source`` (measured or simulated), ``scoring`` and ``captures``; empty where no board has a value
        of any of the metrics.
    here : dict of str to Estimate
        By metric.
    """

    detector: str
    figures: str
    of: str
    source: str
    board: Mapping[str, Any]
    here: dict[str, Estimate]

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        here = {name: {"value": one.value, "low": one.low, "high": one.high} for name, one in self.here.items()}
        facts = {"detector": self.detector, "figures": self.figures, "of": self.of, "reported_by": self.source}
        return {**facts, "board": dict(self.board), "here": here}


def reported(report: Report) -> Iterator[Reported]:
    """Every figure that a source reports of a detector of the run, once for each board with a value of a like metric.

    Parameters
    ----------
    report : Report
    """
    by_detector: Mapping[str, list[dict[str, Any]]] = report.folder.manifest.get("reported", {})
    for detector, figures in by_detector.items():
        for one in figures:
            about = detector, one["figures"], one["of"], one["source"]
            boards = [
                Reported(*about, {key: row[key] for key in ("dataset", "source", "scoring", "captures")}, here)
                for row, estimates in report.estimates
                if row["detector"] == detector
                and row["table"] == "filtering"
                and (here := _defined(estimates, one["metrics"]))
            ]
            yield from boards or [Reported(*about, {}, {})]


def _defined(estimates: Mapping[str, Estimate], metrics: list[str]) -> dict[str, Estimate]:
    """Estimates of some metrics: those that have a value, as an error has none where nothing was to be found."""
    return {name: estimates[name] for name in metrics if name in estimates and not math.isnan(estimates[name].value)}
