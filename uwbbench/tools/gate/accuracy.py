"""Accuracy: metrics of the head on whole captures, against fixed limits or against a stored run.

Conventions
-----------
* A fixed limit is held against the value on these captures, which a deterministic detector gives again and again; the
  interval beside it shows how far other captures may lie.
* Against a stored run, the difference on the same captures counts, in pairs
  (:func:`uwbbench.measure.accuracy.stats.paired_difference`): a regression is a loss whose whole interval lies beyond
  the tolerance. Both are judged by the gate's own rules, and captures are recognised by their content.
* Poses and maps are judged on the runs of a dataset, everything else on its captures.
* Captures of one dataset are pooled, those of different datasets never.
"""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from uwbbench.api import registry
from uwbbench.api.capture import Capture
from uwbbench.api.detections import Detections
from uwbbench.api.drive import Drive
from uwbbench.api.errors import ScoringError
from uwbbench.api.metric import Metric, Outcome
from uwbbench.config.source import CaptureRef, RunRef
from uwbbench.measure.accuracy.rules import outcome_of
from uwbbench.measure.accuracy.scoring import Region, ScoringRules, outcomes
from uwbbench.measure.accuracy.stats import Estimate, estimated, paired_difference
from uwbbench.run.folder.mapped import read_mapped
from uwbbench.run.folder.tables import read_detections
from uwbbench.tools.gate.check import Check, GateVerdict
from uwbbench.tools.gate.config import AccuracyModel, Gate
from uwbbench.tools.gate.link import SetUpError, Worker, detect
from uwbbench.tools.gate.stored import StoredRun


@dataclass(frozen=True)
class Found:
    """What the head found on a capture.

    Attributes
    ----------
    capture : Capture or Drive
    sha256 : str
        Of its content.
    detections : Detections
    scene : str
        Scene or set-up that the capture is of.
    """

    capture: Capture | Drive
    sha256: str
    detections: Detections
    scene: str


def found_on(gate: Gate, worker: Worker, ref: CaptureRef | RunRef, scene: str) -> Found:
    """Run the head on a capture, or on a run.

    Parameters
    ----------
    gate : Gate
        Its accuracy rules decide whether the peaks before the filters, and the times of hand-out, are wanted too.
    worker : Worker
        In the environment of the head.
    ref : CaptureRef or RunRef
    scene : str
        Scene that the capture is of.

    Raises
    ------
    SetUpError
        If it cannot be run, or its environment reads another content.
    """
    candidates, handed_out = (
        any(rule.scoring in scorings for rule in gate.model.accuracy)
        for scorings in (("peak", "presence"), ("latest",))
    )
    capture = ref.open()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "detections.parquet"
        answer = detect(worker, gate.head, ref, candidates=candidates, handed_out=handed_out, to=path)
        before_filters = path.with_suffix(".candidates.parquet")
        of_run = isinstance(ref, RunRef)
        detections = read_detections(path, before_filters if candidates and not of_run else None)
        if of_run:
            made = read_mapped(path.with_suffix(".poses.parquet"), path.with_suffix(".map.npz"))
            detections = detections.annotated(mapped=made)
    if answer["sha256"] != capture.sha256:
        raise SetUpError(f"capture '{ref.name}' has another content in the environment of the head")
    return Found(capture, capture.sha256, detections, scene)


def accuracy_check(gate: Gate, rule: AccuracyModel, label: str, found: list[Found]) -> Check:
    """One limit on one dataset.

    Parameters
    ----------
    gate : Gate
    rule : AccuracyModel
        Metric, and its limit or the stored run to compare with.
    label : str
        Name of the dataset, for people.
    found : list of Found
        What the head found on each capture of the dataset.

    Raises
    ------
    ScoringError, StoreError, ConfigError
        If nothing can be said: there is no truth, or the stored run is not what it should be.
    """
    source = ", SIMULATED" if any(one.capture.header.source == "simulated" for one in found) else ""
    metric: type[Metric] = registry.load_plugin("metrics", rule.metric)
    title = metric.title or rule.metric
    name = f"{title} ({rule.scoring} scoring, {rule.table}) on {label}{source}"
    samples = "runs" if metric.of.of_run else "errors" if metric.merge == "stack" else "frames"
    blank = Check(
        kind="accuracy", name=name, verdict=GateVerdict.INVALID, quantity=title, unit=metric.unit, counted=samples
    )
    outcome = partial(_outcome, gate, rule)
    mine = [outcome(one.capture, one.detections) for one in found]
    scenes, confidence = [one.scene for one in found], gate.model.intervals.confidence
    if rule.no_worse_than is None:
        return _limited(blank, rule, estimated(metric, mine, scenes, confidence=confidence))
    head_name = _name_of(gate)
    stored = StoredRun(gate.folder / rule.no_worse_than, rule.detector, head_name)
    theirs = [outcome(one.capture, stored.detections(one.capture.name, one.sha256)) for one in found]
    check = replace(blank, name=f"{name}, against {stored.detector} of {rule.no_worse_than}")
    difference = paired_difference(metric, mine, theirs, scenes, confidence=confidence)
    return _compared(check, rule, metric.better, difference)


def _name_of(gate: Gate) -> str:
    """Name under which a run would store the head."""
    from uwbbench.config.detector import read_detector

    if gate.head.python is not None:
        return Path(gate.head.detector).stem
    return read_detector(gate.head.detector, None, gate.head.set).name


def _outcome(gate: Gate, rule: AccuracyModel, capture: Capture | Drive, found: Detections) -> Outcome:
    region = Region(**gate.model.region.limits)
    rules = ScoringRules(rule.scoring, gate.model.gate_m, region, gate.model.strongest)
    tables = outcomes(found, capture.header, rules)
    if rule.table not in tables:
        why = "does not look back" if outcome_of(rule.scoring).of_run else "does not cluster positions"
        raise ScoringError(f"capture '{capture.name}': nothing after mapping: the detector {why}")
    return tables[rule.table]


def _limited(check: Check, rule: AccuracyModel, found: Estimate) -> Check:
    """A value against a fixed limit."""
    bound: Any = "minimum" if rule.maximum is None else "maximum"
    limit = rule.minimum if rule.maximum is None else rule.maximum
    assert limit is not None  # noqa: S101 - the model has made sure
    check = replace(_with(check, found), limit=limit, bound=bound)
    if math.isnan(found.value):
        return _undefined(check, found)
    kept = found.value >= limit if bound == "minimum" else found.value <= limit
    if kept:
        return replace(check, verdict=GateVerdict.PASS)
    advice = "see which frames are lost with 'uwbbench plot', or state another limit"
    return replace(check, verdict=GateVerdict.REGRESSION, reason="beyond the limit", advice=advice)


def _compared(check: Check, rule: AccuracyModel, better: str, found: Estimate) -> Check:
    """A difference, head minus stored run, against no loss at all, or the tolerated one."""
    sign = 1.0 if better == "higher" else -1.0
    bound: Any = "minimum" if better == "higher" else "maximum"
    check = replace(
        _with(check, found), quantity=f"{check.quantity} difference", limit=-sign * rule.tolerance, bound=bound
    )
    if math.isnan(found.value):
        return _undefined(check, found)
    if -sign * found.value <= rule.tolerance:
        return replace(check, verdict=GateVerdict.PASS)
    if math.isnan(found.low):
        evidence = "runs" if outcome_of(rule.scoring).of_run else "scenes"
        return replace(
            check,
            verdict=GateVerdict.INCONCLUSIVE,
            reason=f"worse, but {found.groups} {evidence} are too few for an interval",
            advice="gate on more scenes, or on captures of half a minute; or allow a tolerance",
        )
    least_loss = -found.high if better == "higher" else found.low
    if least_loss <= rule.tolerance:
        return replace(check, verdict=GateVerdict.PASS, reason="worse, but within the interval")
    return replace(
        check,
        verdict=GateVerdict.REGRESSION,
        reason="worse by more than the interval",
        advice="compare with the stored run",
    )


def _with(check: Check, found: Estimate) -> Check:
    """Check with a value, its interval and what is behind it."""
    value, low, high = (None if math.isnan(part) else part for part in (found.value, found.low, found.high))
    return replace(
        check, value=value, low=low, high=high, n=found.n, counted=f"{check.counted} in {found.groups} groups"
    )


def _undefined(check: Check, found: Estimate) -> Check:
    """Check of a number that is undefined: too few samples can be helped by more, none at all cannot."""
    if found.n:
        reason = f"{found.n} samples are too few"
        return replace(check, verdict=GateVerdict.INCONCLUSIVE, reason=reason, advice="gate on more or longer captures")
    reason = "undefined: nothing was retained, nothing was to be found, or the truth is not exhaustive"
    return replace(check, reason=reason, advice="see the same numbers with 'uwbbench score'")
