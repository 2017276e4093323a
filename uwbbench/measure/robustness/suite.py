"""All hard cases, and what one detector makes of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from uwbbench.api import registry
from uwbbench.api.case import CheckResult, Examination, HardCase, cases_of, select
from uwbbench.api.errors import PluginError
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.robustness import peaks, samples, sequence, spread
from uwbbench.measure.robustness.compare import hit_share
from uwbbench.measure.robustness.subject import Subject


def all_cases() -> tuple[HardCase, ...]:
    """Every hard case, group by group: those of all detectors, and those that packages bring for their stages.

    Raises
    ------
    PluginError
        If what a package brings cannot be loaded, or bears a name that is taken.
    """
    brought = [case for name in registry.entries("cases") for case in registry.load_object("cases", name)]
    cases = [*cases_of(samples, peaks), *brought, *cases_of(sequence, spread)]
    names = [case.name for case in cases]
    double = next((name for name in names if names.count(name) > 1), None)
    if double:
        raise PluginError(f"two hard cases are named '{double}'; uninstall one of the packages that bring them")
    groups = list(dict.fromkeys(case.group for case in cases))
    return tuple(sorted(cases, key=lambda case: groups.index(case.group)))


@dataclass(frozen=True)
class Stability(Examination):
    """How one detector took the hard cases.

    Attributes
    ----------
    results : tuple of CheckResult
    detector : str
    usual_hits : float
        Share of the frames of the undisturbed capture in which it finds the echo; where that is 0, as for a detector
        that never detects, most cases are passed easily.
    """

    detector: str
    usual_hits: float

    @property
    def largest_error_m(self) -> float | None:
        """Largest range error of all passed cases that compare ranges with a reference; None if there are none."""
        return max((result.error_m for result in self.results if result.error_m is not None), default=None)

    @property
    def largest_error_ulp(self) -> float | None:
        """Largest error, in units in the last place, of all passed cases that compare computed values; or None."""
        return max((result.error_ulp for result in self.results if result.error_ulp is not None), default=None)

    def flips(self, case: HardCase) -> float | None:
        """Share of the detections that come or go in one case; None if the case was not tried."""
        return next((result.flips for result in self.results if result.check.name == case.name), None)

    def summary(self) -> dict[str, Any]:
        """One row of figures."""
        return {
            "detector": self.detector,
            "usual_hits": self.usual_hits,
            "passed": self.count("passed"),
            "failed": self.count("failed"),
            "not_applicable": self.count("not applicable"),
            "largest_error_m": self.largest_error_m,
            "largest_error_ulp": self.largest_error_ulp,
            "flips_float32": self.flips(samples.single_precision),
            "flips_one_ulp": self.flips(samples.one_ulp_noise),
        }

    def to_dict(self) -> dict[str, Any]:
        """Figures and all cases as plain values, for JSON."""
        return {**self.summary(), "cases": [_row(result) for result in self.results]}


def _row(result: CheckResult) -> dict[str, Any]:
    about = {key: getattr(result.check, key) for key in ("group", "expectation", "statement")}
    figures = {key: getattr(result, key) for key in ("error_m", "error_ulp", "flips")}
    detail = result.detail or result.found
    return {"case": result.check.name, **about, "status": result.status, "detail": detail, **figures}


def case_named(name: str) -> HardCase:
    """Find a hard case by name.

    Raises
    ------
    ConfigError
        If there is none of that name.
    """
    return select(all_cases(), [name], "hard case")[0]


def examine(pipeline: Pipeline, cases: Sequence[HardCase] | None = None) -> Stability:
    """Examine a detector with hard cases.

    Parameters
    ----------
    pipeline : Pipeline
    cases : sequence of HardCase, optional
        All of them if not given.

    Raises
    ------
    UwbbenchError
        If the detector cannot run on the undisturbed capture (channel 9, 50 taps, STS), so that nothing can be said.
    """
    subject = Subject(pipeline)
    pipeline.open(subject.capture)  # a detector that refuses the capture says why, instead of failing every case
    chosen = all_cases() if cases is None else cases
    return Stability(
        detector=pipeline.name,
        usual_hits=hit_share(subject.usual, subject.capture),
        results=tuple(case.judge(subject) for case in chosen),
    )
