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

import os
import random
import uuid
from collections.abc import Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uwbbench.api.detections import Detections
from uwbbench.api.errors import UwbbenchError
from uwbbench.api.text import one_line, printable
from uwbbench.api.yaml_file import YamlFile
from uwbbench.config.detector import DetectorConfig, check_detector
from uwbbench.config.identity import from_results
from uwbbench.config.source import CaptureRef, RunRef
from uwbbench.measure.accuracy.rules import rules_on
from uwbbench.run.folder import RunFolder
from uwbbench.run.folder.journal import Entry
from uwbbench.run.folder.scored import rules_of
from uwbbench.run.plan import Unit
from uwbbench.run.unit import Finished, Job, run_unit

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
    problems, identical, equal = [], 0, 0
    if not drawn:
        problems.append("holds no unit that could be run again")
    for entry in drawn:
        try:
            found = _again(folder, entry, roots)
            different = _different(folder, entry, found)
        except (UwbbenchError, KeyError, TypeError, ValueError) as error:
            different = f"was not run again: {one_line(error, 400)}"
        if different is None:
            identical += 1
        elif different == "":
            equal += 1
        else:
            problems.append(f"{_about(entry)}: {different}")
    return Rerun(tuple(map(_about, drawn)), identical, equal, tuple(problems))


def _again(folder: RunFolder, entry: Entry, roots: Sequence[Path]) -> Finished:
    """What a unit gives here and now, in a process that it may take down."""
    from joblib import Parallel, delayed

    experiment = folder.manifest["experiment"]
    unit = Unit("accuracy", _detector(experiment, entry.detector), entry.dataset, _reference(folder, entry, roots))
    rules = tuple(rules_on(rules_of(experiment), entry.dataset))
    job = Job(unit, rules, uuid.uuid4().hex, os.getpid())
    try:
        finished: Finished = Parallel(n_jobs=2)([delayed(run_unit)(job)])[0]
    except BrokenProcessPool as error:
        raise UwbbenchError("its process died") from error
    return finished


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
