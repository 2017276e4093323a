"""The hard cases of :mod:`uwbbench.measure.robustness`, each as a check of detectors."""

from __future__ import annotations

import dataclasses

from uwbbench.api.case import Check, Evidence, HardCase
from uwbbench.measure.robustness import all_cases
from uwbbench.tools.check.detector import DetectorSubject


def hard_checks() -> tuple[Check, ...]:
    """Checks of a detector, one for each hard case."""
    return tuple(_as_check(case) for case in all_cases())


def _as_check(case: HardCase) -> Check:
    def run(subject: DetectorSubject) -> Evidence | str | None:
        return case.run(subject.hardened)

    command = f"uwbbench stability --case {case.name} --detector NAME"
    return dataclasses.replace(case, name=f"hard-{case.name}", run=run, read_more=command)
