"""The hard cases of :mod:`uwbbench.measure.robustness`, each as a check of detectors."""

from __future__ import annotations

from functools import lru_cache

from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.robustness import Case, all_cases
from uwbbench.measure.robustness.subject import Subject as HardCaseSubject
from uwbbench.tools.check.check import Check, Nonconformity, NotApplicable
from uwbbench.tools.check.detector import DetectorSubject


@lru_cache(maxsize=1)
def _examined(pipeline: Pipeline) -> HardCaseSubject:
    """The detector as the hard cases want it; its undisturbed run is shared by them."""
    examined = HardCaseSubject(pipeline)
    pipeline.open(examined.capture)  # a detector that refuses the capture says why
    return examined


def _as_check(case: Case) -> Check:
    def run(subject: DetectorSubject) -> str:
        outcome = case.judge(_examined(subject.pipeline))
        if outcome.status == "not applicable":
            raise NotApplicable(outcome.detail)
        if outcome.status == "failed":
            raise Nonconformity(f"{case.expectation}: {case.statement}", outcome.detail)
        return outcome.detail

    command = f"uwbbench stability --case {case.name} --detector NAME"
    return Check(f"hard-{case.name}", f"{case.expectation}: {case.statement}", command, run)


CHECKS = tuple(_as_check(case) for case in all_cases())
