"""Runs combined: those of one experiment on the same captures under the same rules.

Conventions
-----------
* A suite is the name of an experiment. Its version is a hash of the content of its captures and of its scoring rules:
  only what was measured in the same version is compared. Where the experiment was frozen, the version is that of all
  its captures but those of optional datasets, and every run has checked them.
* The public half of a suite, private halves by their seeds, and quick runs of each are never put together.
* A capture that a run could not open has no known content there; such a run belongs to the version whose other
  captures it shares.
* A detector is its name with its identity (steps, parameters and sources). The same name with another identity is
  another version of it, with a row and a page of its own.
* The same detector on the same capture in several runs: the newest run in which it worked counts. Where an older one
  gave other scores, that is noted.
"""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from uwbbench.measure.accuracy.metrics.choice import MetricChoice, combined
from uwbbench.results.leaderboard.runs import Run
from uwbbench.results.results import Scored
from uwbbench.run.folder.identity import canonical, digest, suite_version
from uwbbench.run.folder.journal import Entry

CaptureKey = tuple[str, str]
"""Dataset and capture."""


@dataclass
class Contender:
    """One version of a detector in a suite.

    Attributes
    ----------
    name, identity : str
    config : mapping
        Its resolved file.
    runs : list of Run
        Runs that it took part in, the oldest first.
    chosen : dict
        By dataset and capture: the run and the entry that count.
    timed : list of (Run, Entry)
        Latency units that worked, of all runs.
    stability : mapping or None
        Its results in the hard cases, from the newest run that has any.
    disagreements : list of str
        Where an older run gave other scores.
    """

    name: str
    identity: str
    config: Mapping[str, Any]
    runs: list[Run] = field(default_factory=list)
    chosen: dict[CaptureKey, tuple[Run, Entry]] = field(default_factory=dict)
    timed: list[tuple[Run, Entry]] = field(default_factory=list)
    stability: Mapping[str, Any] | None = None
    disagreements: list[str] = field(default_factory=list)

    @property
    def key(self) -> str:
        """What distinguishes it from all others."""
        return digest([self.name, self.identity])

    @property
    def bound(self) -> bool:
        """Whether it is no detector, but bounds what detectors can reach."""
        return any(self.name in run.folder.bounds for run in self.runs)

    @cached_property
    def scored(self) -> list[Scored]:
        """What counts, with the key as the detector's name."""
        counted = []
        for (dataset, capture), (run, entry) in sorted(self.chosen.items()):
            if entry.status == "done":
                rows = run.scored_by_unit.get((self.name, dataset, capture), [])
                counted += [dataclasses.replace(one, detector=self.key) for one in rows]
        return counted


@dataclass
class Suite:
    """One version of an experiment, with all that took part.

    Attributes
    ----------
    name, version : str
    runs : list of Run
        The oldest first.
    captures : dict
        Content of each capture; empty where nobody could open it.
    contenders : list of Contender
    """

    name: str
    version: str
    runs: list[Run]
    captures: dict[CaptureKey, str]
    contenders: list[Contender]

    @property
    def part(self) -> Mapping[str, Any]:
        """Which part of a frozen suite it is: ``version``, ``quick`` and the hash of ``seeds``, as runs store them."""
        return _part(self.newest)

    def is_public_half_of(self, other: Suite) -> bool:
        """Whether another suite has the same scenes and rules, drawn from secret seeds."""
        mine, its = dict(self.part), dict(other.part)
        alike = self.name == other.name and not mine.pop("seeds") and bool(its.pop("seeds"))
        return alike and mine == its

    @property
    def newest(self) -> Run:
        """The run whose description is shown."""
        return self.runs[-1]

    def captures_of(self, dataset: str) -> list[str]:
        """Captures of a dataset."""
        return [capture for label, capture in self.captures if label == dataset]

    @property
    def scorings(self) -> list[str]:
        """Scorings, in the order of the experiment."""
        return [rule.scoring for rule in self.newest.rules]

    @cached_property
    def metrics(self) -> MetricChoice:
        """Metrics that its runs show; what the newest run lists comes first."""
        return combined([run.experiment["metrics"] for run in reversed(self.runs)], self.scorings)

    @property
    def datasets(self) -> list[str]:
        """Datasets, in the order of the newest run."""
        order = [used["label"] for used in self.newest.experiment["datasets"]]
        there = {label for label, _ in self.captures}
        return [label for label in order if label in there]


def suites(runs: Sequence[Run]) -> list[Suite]:
    """Suites of verified runs, in the order of names, the newest version of each first.

    Parameters
    ----------
    runs : sequence of Run
        The oldest first.
    """
    versions = [_suite(name, members, captures) for name, members, captures in _versions(runs)]
    versions.sort(key=lambda suite: suite.newest.started, reverse=True)
    return sorted(versions, key=lambda suite: suite.name)


def _versions(runs: Sequence[Run]) -> Iterator[tuple[str, list[Run], dict[CaptureKey, str]]]:
    """Runs that belong together, with the content of their captures."""
    alike: dict[str, list[tuple[Run, dict[CaptureKey, str]]]] = defaultdict(list)
    for run in runs:
        captures = _captures(run)
        rules = [rule.to_dict() for rule in run.rules]
        compared = [key for key in captures if key[0] not in _optional(run)]
        alike[canonical([run.experiment["name"], rules, sorted(compared), _part(run)])].append((run, captures))
    for members in alike.values():
        versions: list[tuple[list[Run], dict[CaptureKey, str]]] = []
        for run, captures in sorted(members, key=lambda one: list(one[1].values()).count("")):
            for into, known in versions:
                if all(not content or known.get(key, "") in ("", content) for key, content in captures.items()):
                    into.append(run)
                    known.update({key: content for key, content in captures.items() if content or key not in known})
                    break
            else:
                versions.append(([run], dict(captures)))
        for into, known in versions:
            yield into[0].experiment["name"], [run for run in runs if run in into], known


def _part(run: Run) -> Mapping[str, Any]:
    """Which part of a suite a run is of; of experiments that were not frozen, and of older runs, all of it."""
    part: Mapping[str, Any] = run.experiment.get("suite", {"version": "", "quick": False, "seeds": ""})
    return part


def _optional(run: Run) -> set[str]:
    """Datasets of a run that others need not have."""
    return {used["label"] for used in run.experiment["datasets"] if used.get("optional")}


def _captures(run: Run) -> dict[CaptureKey, str]:
    """Content of each capture of a run; empty where it was not opened.

    Of a frozen capture, which the run has checked, it is what was frozen: another processor may differ in last bits.
    """
    contents: dict[CaptureKey, str] = {}
    frozen = run.manifest.get("frozen", {})
    for entry in run.entries:
        if entry.kind == "accuracy":
            content = run.manifest["data"].get(entry.capture_id, "")
            content = content and frozen.get(entry.dataset, {}).get(entry.capture, content)
            contents[entry.dataset, entry.capture] = content or contents.get((entry.dataset, entry.capture), "")
    return contents


def _suite(name: str, runs: list[Run], captures: dict[CaptureKey, str]) -> Suite:
    optional = {label for run in runs for label in _optional(run)}
    compared = {key: content for key, content in captures.items() if key[0] not in optional}
    version = suite_version(compared, [rule.to_dict() for rule in runs[0].rules])
    contenders: dict[tuple[str, str], Contender] = {}
    for run in runs:
        configs = {config["name"]: config for config in run.experiment["detectors"]}
        for detector, identity in run.manifest["detectors"].items():
            contender = contenders.setdefault((detector, identity), Contender(detector, identity, configs[detector]))
            contender.runs.append(run)
            _take(contender, run, [entry for entry in run.entries if entry.detector == detector])
    order = sorted(contenders.values(), key=lambda one: (one.name, one.runs[0].started, one.identity))
    return Suite(name, version, runs, dict(sorted(captures.items())), order)


def _take(contender: Contender, run: Run, entries: Iterable[Entry]) -> None:
    """Let a newer run count, without losing what worked in an older one."""
    for entry in entries:
        if entry.kind == "accuracy":
            key = entry.dataset, entry.capture
            before = contender.chosen.get(key)
            if before is None or entry.status == "done":
                contender.chosen[key] = run, entry
            if before is not None and before[1].status == entry.status == "done":
                other = _difference(before[0], run, entry)
                contender.disagreements += [other] if other else []
        elif entry.status == "done" and entry.kind == "latency":
            contender.timed.append((run, entry))
        elif entry.status == "done" and entry.kind == "stability":
            contender.stability = entry.facts


def _difference(old: Run, new: Run, entry: Entry) -> str:
    """Sentence about scores of the same unit that differ; empty where they agree."""
    key = entry.detector, entry.dataset, entry.capture
    pairs = zip(old.scored_by_unit.get(key, []), new.scored_by_unit.get(key, []), strict=False)
    for before, after in pairs:
        same = all(
            np.array_equal(getattr(before.outcome, name), getattr(after.outcome, name)) for name in ("tp", "fp", "fn")
        )
        if not same:
            return (
                f"{entry.capture} of {entry.dataset}: run {old.name} gave other {before.scoring} scores than run "
                f"{new.name}, which counts"
            )
    return ""
