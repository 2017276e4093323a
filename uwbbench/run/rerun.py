"""Whether detectors still find what a run folder says that they found: some units are run again and compared.

That a folder is consistent proves that its numbers follow from its detections. Where these come from, only running the
detectors again shows.

Conventions
-----------
* Units are drawn by the operating system's random numbers: who forges a folder cannot know which.
* The detector is made of the manifest's configuration and of the stages that are installed here; its identity, and the
  hash of the capture's content, must be those of the run: the same detector on the same data.
* Times are not measured again: they never repeat.
"""

from __future__ import annotations

import random
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uwbbench.api.detections import Detections
from uwbbench.api.errors import UwbbenchError
from uwbbench.api.interruption import listening
from uwbbench.api.text import one_line, printable
from uwbbench.api.yaml_file import YamlFile
from uwbbench.config.detector import DetectorConfig, check_detector
from uwbbench.config.identity import from_results
from uwbbench.config.source import CaptureRef, RunRef
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.accuracy.rules import rules_on
from uwbbench.measure.latency.machine import usable_cores
from uwbbench.run.accuracy import AccuracyPass
from uwbbench.run.crew import crew_of
from uwbbench.run.folder import RunFolder
from uwbbench.run.folder.journal import Entry
from uwbbench.run.folder.scored import rules_of
from uwbbench.run.limits import Allowance, LimitsModel
from uwbbench.run.plan import LONGEST_REASON, Unit
from uwbbench.run.unit import Finished, Job

RELATIVE, ABSOLUTE = 1e-6, 1e-9
"""Numbers that differ by less are equal: another processor may round otherwise."""


@dataclass(frozen=True)
class Rerun:
    """What running units again has shown.

    Attributes
    ----------
    units : tuple of str
        Those that were drawn: detector, dataset and capture.
    identical : int
        How many of them gave the same, bit for bit.
    equal : int
        How many gave the same up to rounding.
    problems : tuple of str
        One line for each of the others.
    """

    units: tuple[str, ...]
    identical: int
    equal: int
    problems: tuple[str, ...]


def rerun(folder: RunFolder, number: int, roots: Sequence[Path]) -> Rerun:
    """Run some finished units again, drawn at random, and compare what they find.

    Parameters
    ----------
    folder : RunFolder
        A consistent one.
    number : int
        Of units; all, where there are fewer.
    roots : sequence of Path
        Folders to search for captures.

    Returns
    -------
    Rerun
    """
    read_only = {one["name"] for one in folder.manifest["experiment"]["detectors"] if from_results(one)}
    done = [e for e in folder.entries() if e.kind == "accuracy" and e.status == "done" and e.detector not in read_only]
    drawn = random.SystemRandom().sample(done, min(number, len(done)))
    outcomes: dict[str, str | None] = {}
    jobs = []
    session = uuid.uuid4().hex
    for entry in sorted(drawn, key=lambda one: (one.dataset, one.capture)):
        try:
            jobs.append(_job(folder, entry, roots, session))
        except (UwbbenchError, StopIteration, KeyError, TypeError, ValueError) as error:
            outcomes[entry.unit] = f"cannot be run again: {one_line(error, LONGEST_REASON)}"
    limits, entries = LimitsModel(), {entry.unit: entry for entry in drawn}
    with listening(), crew_of(usable_cores(), limits.memory_mb) as hands:
        for again in AccuracyPass(hands, jobs, Allowance(limits)).finished():
            entry = entries[again.entry.unit]
            try:
                outcomes[entry.unit] = _different(folder, entry, again)
            except (UwbbenchError, KeyError, TypeError, ValueError) as error:
                outcomes[entry.unit] = f"cannot be compared: {one_line(error, LONGEST_REASON)}"
    problems = tuple(f"{_about(entry)}: {text}" for entry in drawn if (text := outcomes[entry.unit]))
    return Rerun(
        units=tuple(map(_about, drawn)),
        identical=sum(outcome is None for outcome in outcomes.values()),
        equal=sum(outcome == "" for outcome in outcomes.values()),
        problems=problems if drawn else ("holds no unit that could be run again",),
    )


def _job(folder: RunFolder, entry: Entry, roots: Sequence[Path], session: str) -> Job:
    """A unit as the manifest describes it, with what is installed here.

    Raises
    ------
    UwbbenchError
        If its detector is not installed, or its unit has another name.
    """
    experiment = folder.manifest["experiment"]
    unit = Unit("accuracy", _detector(experiment, entry.detector), entry.dataset, _reference(folder, entry, roots))
    if unit.id != entry.unit:
        raise UwbbenchError("its unit is not the one that the manifest describes")
    rules = tuple(rules_on(rules_of(experiment), entry.dataset))
    return Job(unit, rules, session, Pipeline(unit.detector).identity)


def _detector(experiment: Mapping[str, Any], name: str) -> DetectorConfig:
    config = next(one for one in experiment["detectors"] if one["name"] == name)
    return check_detector(config, YamlFile("manifest.json", config, {}))


def _reference(folder: RunFolder, entry: Entry, roots: Sequence[Path]) -> CaptureRef | RunRef:
    """Capture or run of an entry, as it can be opened here."""
    used = next(one for one in folder.manifest["experiment"]["datasets"] if one["label"] == entry.dataset)
    captures = folder.manifest.get("runs", {}).get(entry.dataset, {}).get(entry.capture)
    places = tuple(map(str, roots))
    if captures is not None and folder.has_poses(entry.unit):
        return RunRef(used["use"], used["params"], places, entry.capture, tuple(captures))
    return CaptureRef(used["use"], used["params"], places, entry.capture)


def _different(folder: RunFolder, entry: Entry, again: Finished) -> str | None:
    """What differs from the stored unit; empty where it is rounding alone, None where nothing does."""
    now = again.entry
    if now.status != "done" or again.found is None:
        return f"failed: {now.reason}"
    if again.sha256 != folder.manifest["data"][entry.capture_id]:
        return "its capture has other content here"
    if now.identity != entry.identity:
        return "its detector is another one here: other sources or versions"
    stored = folder.detections(entry.unit)
    if not np.array_equal(stored.processed, again.found.processed) or len(stored) != len(again.found):
        return f"found {len(again.found)} detections, stored are {len(stored)}"
    for name, column in _columns(again.found).items():
        if not _close(_columns(stored).get(name), column):
            return f"'{name}' of its detections differs"
    for row, other in zip(entry.scores, now.scores, strict=True):
        for name, value in other.items():
            if isinstance(value, float) and not _close(row.get(name), value):
                return f"{name} of its scores is {value}, stored is {row.get(name)}"
    pairs = ((_columns(stored)[name], column) for name, column in _columns(again.found).items())
    return None if all(np.array_equal(*pair, equal_nan=True) for pair in pairs) else ""


def _columns(detections: Detections) -> dict[str, Any]:
    """Columns of numbers."""
    return {name: column for name, column in detections.columns.items() if np.asarray(column).dtype.kind in "fiub"}


def _close(stored: Any, again: Any) -> bool:
    if stored is None:
        return again is None or bool(np.all(np.isnan(again)))
    return bool(np.allclose(stored, again, rtol=RELATIVE, atol=ABSOLUTE, equal_nan=True))


def _about(entry: Entry) -> str:
    return " ".join(printable(name, 80) for name in (entry.detector, entry.dataset, entry.capture))
