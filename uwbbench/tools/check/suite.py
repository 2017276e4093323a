"""All checks of each kind of plugin, and what one of them makes of them."""

from __future__ import annotations

import unittest
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from uwbbench.api import registry
from uwbbench.api.case import STATUSES, Check, CheckResult, Examination, HardCase, select
from uwbbench.api.errors import PluginError, nearest
from uwbbench.api.locate import shipped
from uwbbench.api.registry import AUTHORED_KINDS, AuthoredKind
from uwbbench.config.detector import read_detector
from uwbbench.measure.robustness import all_cases
from uwbbench.tools.check import (
    conduct,
    dataset,
    declaration,
    detector,
    mapper,
    mapping,
    metric,
    source,
    stage_inputs,
    stage_ports,
    stage_stream,
)
from uwbbench.tools.check.dataset import DatasetSubject
from uwbbench.tools.check.detector import DetectorSubject
from uwbbench.tools.check.mapper import MapperSubject
from uwbbench.tools.check.mapping import MappingSubject
from uwbbench.tools.check.metric import MetricSubject
from uwbbench.tools.check.stage_subject import StageSubject
from uwbbench.tools.check.subject import Subject

_SUBJECTS: dict[AuthoredKind, type[Subject]] = {
    "stage": StageSubject,
    "mapper": MapperSubject,
    "detector": DetectorSubject,
    "dataset": DatasetSubject,
    "metric": MetricSubject,
}
_CHECKS: dict[AuthoredKind, tuple[Check, ...]] = {
    "stage": (
        *declaration.CHECKS,
        declaration.origin_is_stated,
        *source.CHECKS,
        *stage_ports.CHECKS,
        *stage_stream.CHECKS,
        *conduct.CHECKS,
        *stage_inputs.CHECKS,
    ),
    "mapper": (
        *declaration.CHECKS,
        declaration.origin_is_stated,
        *source.CHECKS,
        *mapper.CHECKS,
        *conduct.CHECKS,
    ),
    "detector": (*detector.CHECKS, *conduct.CHECKS),
    "dataset": (*declaration.CHECKS, *source.CHECKS, *dataset.CHECKS, *conduct.CHECKS),
    "metric": (declaration.docstring_says_what_it_is, *source.CHECKS, *metric.CHECKS, *conduct.CHECKS),
}
_OF_RUNS: tuple[Check, ...] = (*mapping.CHECKS, *conduct.CHECKS)
"""Checks of a detector that has a mapper."""


@dataclass(frozen=True)
class Conformance(Examination):
    """How one plugin took the checks of its kind.

    Attributes
    ----------
    results : tuple of CheckResult
    kind, name : str
    """

    kind: AuthoredKind
    name: str

    def to_dict(self) -> dict[str, Any]:
        """All results as plain values, for JSON."""
        counts = {status.replace(" ", "_"): self.count(status) for status in STATUSES}
        about = {"kind": self.kind, "name": self.name}
        return {**about, **counts, "checks": [_row(result) for result in self.results]}


def _row(result: CheckResult) -> dict[str, Any]:
    about = {"check": result.check.name, "statement": result.check.asked, "read_more": result.check.read_more}
    return about | {key: getattr(result, key) for key in ("status", "detail", "expected", "found", "trace")}


def all_checks(kind: AuthoredKind) -> tuple[Check, ...]:
    """Every check of a kind of plugin, in order; of a detector, of one without a mapper."""
    return _CHECKS[kind] + (tuple(_of_detectors(case) for case in all_cases()) if kind == "detector" else ())


def checks_of(subject: Subject) -> tuple[Check, ...]:
    """Every check of a plugin, in order."""
    return _OF_RUNS if isinstance(subject, MappingSubject) else all_checks(subject.kind)


def _of_detectors(case: HardCase) -> Check:
    """A hard case as a check of detectors."""
    command = f"uwbbench stability --case {case.name} --detector NAME"
    return replace(case, name=f"hard-{case.name}", run=lambda subject: case.run(subject.hardened), read_more=command)


def kinds_of(name: str) -> tuple[AuthoredKind, ...]:
    """Kinds of plugin that bear a name; a path of a YAML file is a detector.

    Raises
    ------
    PluginError
        If none does.
    """
    if name.endswith((".yaml", ".yml")):
        return ("detector",)
    known = {kind: list(registry.entries(f"{kind}s")) for kind in AUTHORED_KINDS}
    known["detector"] += shipped("detectors")
    kinds = tuple(kind for kind in AUTHORED_KINDS if name in known[kind])
    if not kinds:
        every = [other for names in known.values() for other in names]
        raise PluginError(f"no stage, mapper, detector, dataset or metric named '{name}'.{nearest(name, every)}")
    return kinds


def subject_of(
    kind: AuthoredKind, name: str, params: Mapping[str, Any] | None = None, roots: Sequence[Path] = ()
) -> Subject:
    """Plugin to be examined.

    Parameters
    ----------
    kind : {"stage", "mapper", "detector", "dataset", "metric"}
    name : str
        Registered name; of a detector, also the path of its YAML file.
    params : mapping, optional
        Parameters to examine it with; of a detector, values to change by path.
    roots : sequence of Path
        Folders that a dataset searches.

    Raises
    ------
    PluginError, ConfigError
        If it is unknown or cannot be loaded.
    """
    if kind == "detector" and read_detector(name, changes=params).mapper is not None:
        return MappingSubject(name, params, tuple(roots))
    return _SUBJECTS[kind](name, params, tuple(roots))


def examine(subject: Subject, names: Sequence[str] | None = None) -> Conformance:
    """Hold a plugin against the checks of its kind.

    Parameters
    ----------
    subject : Subject
    names : sequence of str, optional
        Only these checks.

    Raises
    ------
    ConfigError
        If there is no check of such a name.
    """
    checks = checks_of(subject)
    chosen = checks if names is None else select(checks, names, f"check of {subject.kind}s")
    return Conformance(tuple(one.judge(subject) for one in chosen), subject.kind, subject.name)


def checks_for(
    kind: AuthoredKind, name: str, params: Mapping[str, Any] | None = None, roots: Sequence[Path] = ()
) -> list[tuple[str, Callable[[], None]]]:
    """Checks of a plugin as tests: pairs of a name and a function to call.

    Parameters
    ----------
    kind : {"stage", "mapper", "detector", "dataset", "metric"}
    name : str
        Registered name.
    params : mapping, optional
        Parameters to examine it with, where the defaults will not do.
    roots : sequence of Path
        Folders that a dataset searches.

    Returns
    -------
    list of (str, callable)
        A function raises AssertionError with an explanation where the check fails, and ``unittest.SkipTest``, which
        pytest understands, where it does not apply.

    Raises
    ------
    PluginError, ConfigError
        If the plugin is unknown or cannot be loaded.

    Examples
    --------
    >>> checks = dict(checks_for("metric", "recall"))
    >>> checks["unit-is-given"]()
    """
    subject = subject_of(kind, name, params, roots)
    return [(one.name, partial(assert_conforms, one, subject)) for one in checks_of(subject)]


def assert_conforms(one: Check, subject: Subject) -> None:
    """Hold a plugin against one check, as a test does.

    Raises
    ------
    AssertionError
        If it fails; the message explains.
    unittest.SkipTest
        If it does not apply.
    """
    result = one.judge(subject)
    if result.status == "not applicable":
        raise unittest.SkipTest(f"{one.name}: {result.detail}")
    if not result.passed:
        raise AssertionError(f"{subject.kind} '{subject.name}': {result.explain()}\n{result.trace}".rstrip())
