"""Carrying out a gate: every check in turn; one that cannot be made is a verdict too."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from time import perf_counter

from uwbbench.api.errors import UwbbenchError
from uwbbench.api.interruption import by_plugin
from uwbbench.config.detector import read_detector
from uwbbench.config.source import CaptureRef, RunRef
from uwbbench.measure.accuracy.rules import outcome_of
from uwbbench.measure.latency.machine import machine
from uwbbench.run.leaks import refuse_trained_on
from uwbbench.run.plan import reason_of
from uwbbench.tools.gate.accuracy import Found, accuracy_check, found_on
from uwbbench.tools.gate.check import Aspect, Check, GateResult, GateVerdict
from uwbbench.tools.gate.config import AccuracyModel, Captures, Gate
from uwbbench.tools.gate.deadline import deadline_checks
from uwbbench.tools.gate.latency import Progress, latency_checks
from uwbbench.tools.gate.link import worker_of

Listed = Mapping[str, Sequence[tuple[CaptureRef, str]]]
"""Captures of each dataset, each with its scene."""


def run_gate(gate: Gate, progress: Progress = lambda _: None) -> GateResult:
    """Make all checks of a gate: accuracy, deadlines, then speed against the base.

    Parameters
    ----------
    gate : Gate
    progress : callable
        Called with what is being done.

    Returns
    -------
    GateResult
        What could not be measured is a check with the verdict ``invalid``.

    Raises
    ------
    ConfigError
        If the head was trained on captures of the gate.
    """
    checks: list[Check] = []
    listed = _listed(gate, checks)
    _refuse_trained_on(gate, listed)
    model = gate.model
    runs = _runs_of(gate, listed)
    for label, refs in listed.items():
        checks += _accuracy(gate, label, refs, progress, of_runs=False)
        checks += _accuracy(gate, label, runs.get(label, ()), progress, of_runs=True)
    if model.deadline is not None:
        deadline = model.deadline
        for label, ref in _timed(listed, deadline.captures):
            progress(f"deadlines on {label}")
            checks += _made("deadline", label, partial(deadline_checks, gate, deadline, label, ref))
    if model.latency is not None and gate.base is not None:
        latency, base = model.latency, gate.base
        for label, ref in _timed(listed, latency.captures):
            checks += _made("latency", label, partial(latency_checks, gate, base, latency, label, ref, progress))
    return GateResult(gate.name, gate.head.text, "" if gate.base is None else gate.base.text, tuple(checks), machine())


def _listed(gate: Gate, checks: list[Check]) -> dict[str, list[tuple[CaptureRef, str]]]:
    """Captures of each dataset; one that cannot list them becomes a check."""
    listed = {}
    for source in gate.datasets:
        try:
            references = source.references()
            scenes = source.scenes([ref.name for ref in references])
            listed[source.label] = [(ref, scenes[ref.name]) for ref in references]
        except BaseException as error:  # an adapter may raise anything; the other datasets still count
            if not by_plugin(error):
                raise
            checks.append(_invalid("captures", source.label, reason_of(error)))
    return listed


def _runs_of(gate: Gate, listed: Listed) -> dict[str, list[tuple[RunRef, str]]]:
    """Runs of each dataset that was listed, each of a scene of its own; none where nothing is asked of runs."""
    if not any(outcome_of(rule.scoring).of_run for rule in gate.model.accuracy):
        return {}
    return {
        source.label: [(run, run.name) for run in source.runs()] for source in gate.datasets if source.label in listed
    }


def _refuse_trained_on(gate: Gate, listed: Listed) -> None:
    """Refuse a head of this environment that was trained on captures on which its accuracy would be judged."""
    if not gate.model.accuracy or gate.head.python is not None:
        return
    head = read_detector(gate.head.detector, None, gate.head.set)
    refuse_trained_on([head], ((f"{label}: {ref.name}", ref) for label, refs in listed.items() for ref, _ in refs))


def _timed(listed: Listed, captures: Captures) -> list[tuple[str, CaptureRef]]:
    """Captures that are timed, each with a name for people."""
    return [
        (f"{label}, {ref.name}", ref)
        for label, refs in listed.items()
        for ref, _ in (refs if captures == "all" else refs[:1])
    ]


def _accuracy(
    gate: Gate, label: str, refs: Sequence[tuple[CaptureRef | RunRef, str]], progress: Progress, *, of_runs: bool
) -> list[Check]:
    """All limits of one dataset that are of its runs, or of its captures."""
    rules = [rule for rule in gate.model.accuracy if rule.dataset in (None, label)]
    rules = [rule for rule in rules if outcome_of(rule.scoring).of_run == of_runs]
    if not rules:
        return []
    progress(f"accuracy on {label}")
    started = perf_counter()
    try:
        with worker_of(gate.head, gate.model.timeout_s) as worker:
            runs = [found_on(gate, worker, ref, scene) for ref, scene in refs]
    except UwbbenchError as error:
        return [
            _invalid("accuracy", f"{rule.metric} ({rule.scoring} scoring) on {label}", str(error)) for rule in rules
        ]
    checks: list[Check] = []
    for rule in rules:
        name = f"{rule.metric} ({rule.scoring} scoring) on {label}"
        checks += _made("accuracy", name, partial(_one_accuracy, gate, rule, label, runs))
    return [replace(check, elapsed_s=(perf_counter() - started) / len(checks)) for check in checks]


def _one_accuracy(gate: Gate, rule: AccuracyModel, label: str, found: list[Found]) -> list[Check]:
    return [accuracy_check(gate, rule, label, found)]


def _made(kind: Aspect, name: str, make: Callable[[], list[Check]]) -> list[Check]:
    """Checks with the time that they took."""
    started = perf_counter()
    try:
        checks = make()
    except UwbbenchError as error:
        checks = [_invalid(kind, name, str(error))]
    return [replace(check, elapsed_s=(perf_counter() - started) / len(checks)) for check in checks]


def _invalid(kind: Aspect, name: str, reason: str) -> Check:
    advice = "repair what the reason names; nothing was measured"
    return Check(kind=kind, name=f"{kind} of {name}", verdict=GateVerdict.INVALID, reason=reason, advice=advice)
