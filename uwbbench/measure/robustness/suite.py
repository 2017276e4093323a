"""All hard cases put to one detector."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from uwbbench.api.errors import ConfigError, nearest
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.robustness import clustering, clutter, geometry, peaks, samples, sequence, spread, thresholds
from uwbbench.measure.robustness.case import Case, Outcome
from uwbbench.measure.robustness.compare import hit_share
from uwbbench.measure.robustness.subject import Subject

GROUPS: tuple[ModuleType, ...] = (samples, peaks, thresholds, geometry, clutter, clustering, sequence, spread)


def all_cases() -> tuple[Case, ...]:
    """Every hard case, group by group, in the order in which they are written."""
    return tuple(thing for group in GROUPS for thing in vars(group).values() if isinstance(thing, Case))


@dataclass(frozen=True)
class Stability:
    """How one detector stood the hard cases.

    Attributes
    ----------
    detector : str
    usual_hits : float
        Share of the frames of the undisturbed capture in which it finds the echo; where that is 0, as for a detector
        that never detects, most cases are passed easily.
    outcomes : tuple of Outcome
    """

    detector: str
    usual_hits: float
    outcomes: tuple[Outcome, ...]

    def count(self, status: str) -> int:
        """Cases with this status."""
        return sum(outcome.status == status for outcome in self.outcomes)

    @property
    def passed(self) -> bool:
        """Whether no case failed."""
        return self.count("failed") == 0

    @property
    def largest_error_m(self) -> float | None:
        """Largest range error of all passed cases that compare ranges with a reference; None if there are none."""
        return max((outcome.error_m for outcome in self.outcomes if outcome.error_m is not None), default=None)

    @property
    def largest_error_ulp(self) -> float | None:
        """Largest error, in units in the last place, of all passed cases that compare computed values; or None."""
        return max((outcome.error_ulp for outcome in self.outcomes if outcome.error_ulp is not None), default=None)

    def flips(self, case: Case) -> float | None:
        """Share of the detections that come or go in one case; None if it was not put to the detector."""
        return next((outcome.flips for outcome in self.outcomes if outcome.case == case.name), None)

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
        return {**self.summary(), "cases": [outcome.to_dict() for outcome in self.outcomes]}


def case_named(name: str) -> Case:
    """Find a hard case by name.

    Raises
    ------
    ConfigError
        If there is none of that name.
    """
    known = {one.name: one for one in all_cases()}
    if name not in known:
        raise ConfigError(f"no hard case named '{name}'.{nearest(name, known)}")
    return known[name]


def examine(pipeline: Pipeline, cases: Sequence[Case] | None = None) -> Stability:
    """Put hard cases to a detector.

    Parameters
    ----------
    pipeline : Pipeline
    cases : sequence of Case, optional
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
        outcomes=tuple(one.judge(subject) for one in chosen),
    )
