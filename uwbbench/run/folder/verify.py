"""Whether a run folder still holds what its run wrote: everything that can be computed again is.

Conventions
-----------
* Files are compared with the hashes that the run noted when it ended, the manifest with its own.
* Names, identities and counts of the journal are computed again from the manifest, the captures and the tables;
  scores from the stored detections, and percentiles from the stored times. No detector is run.
* What cannot be computed again is taken as it is: the detections themselves, the truth, time ratios (their blocks are
  not kept), peak memory, the hard cases, and the machine.
* A hash reveals damage and careless editing. Who forges detections and all that follows from them is not found out: a
  folder that passes is consistent, no more. :mod:`uwbbench.run.rerun` runs detectors again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from uwbbench.api.errors import UwbbenchError
from uwbbench.api.text import one_line, printable
from uwbbench.config.identity import RESULTS, detector_identity, from_results
from uwbbench.measure.accuracy.metrics.choice import MetricChoice, names_of
from uwbbench.measure.accuracy.rules import rules_on
from uwbbench.measure.accuracy.scoring import column_of
from uwbbench.run.folder.folder import RunFolder
from uwbbench.run.folder.identity import (
    accuracy_identity,
    capture_name,
    latency_identity,
    listing_name,
    stability_identity,
    stability_name,
    unit_name,
)
from uwbbench.run.folder.journal import Entry
from uwbbench.run.folder.reported import REPORTED_FACT, RESULTS_FACT, reported_times
from uwbbench.run.folder.scored import causes_of, rules_of, score_rows, table_of, with_metrics

if TYPE_CHECKING:
    import pandas as pd

RELATIVE, ABSOLUTE = 1e-9, 1e-12
"""Numbers that differ by less are equal: sums may round otherwise on another processor."""

LONGEST_NAME = 80


@dataclass(frozen=True)
class Verification:
    """What was checked, and what does not hold.

    Attributes
    ----------
    checked : mapping of str to int
        How many of each were looked at.
    problems : tuple of str
        One line each; none if everything holds.
    notes : tuple of str
        What a reader should know although everything holds.
    """

    checked: Mapping[str, int]
    problems: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether everything holds."""
        return not self.problems


def verify(folder: RunFolder) -> Verification:
    """Check a run folder against itself.

    Parameters
    ----------
    folder : RunFolder

    Returns
    -------
    Verification
    """
    return _Verifier(folder).verified()


class _Verifier:
    """Checks that add to one list of problems."""

    def __init__(self, folder: RunFolder) -> None:
        self.folder, self.manifest = folder, folder.manifest
        self.problems: list[str] = []
        self.notes: list[str] = []
        self.checked: dict[str, int] = {}
        self.entries: list[Entry] = []
        self.sound: dict[str, list[dict[str, Any]]] = {}
        """Rows of the accuracy units whose stored detections could be scored again, under the stored rules."""

    def verified(self) -> Verification:
        with self._checking("journal.jsonl"):
            self.entries = self.folder.entries()
        for check in (self._files, self._detectors, self._entries, self._completeness, self._scores):
            with self._checking("manifest.json"):
                check()
        return Verification(self.checked, tuple(dict.fromkeys(self.problems)), tuple(self.notes))

    @contextmanager
    def _checking(self, where: str) -> Iterator[None]:
        """Turn whatever goes wrong over values that no run writes into a problem."""
        try:
            yield
        except UwbbenchError as error:
            self._problem(where, str(error).removeprefix(f"{self.folder.path}/"))
        except KeyError as error:
            self._problem(where, f"does not hold what a run of this version writes: no {error}")
        except (TypeError, ValueError, AttributeError, IndexError, OverflowError, RecursionError) as error:
            self._problem(where, f"does not hold what a run of this version writes: {type(error).__name__}: {error}")

    def _problem(self, where: str, what: str) -> None:
        line = one_line(what)
        self.problems.append(f"{where}: {line}" if not line.startswith(f"{where}:") else line)

    def _count(self, what: str) -> None:
        self.checked[what] = self.checked.get(what, 0) + 1

    # Files -----------------------------------------------------------------------------------------------------

    def _files(self) -> None:
        """Every file of results against its hash, and the manifest against its seal."""
        files = self.manifest.get("files")
        if not isinstance(files, dict) or not self.folder.sealed:
            self._problem(
                "manifest.json",
                "has no seal: the run did not end, or an earlier version made it; continuing it with --resume seals it",
            )
            return
        if not self.folder.intact:
            self._problem("manifest.json", "was changed after the run ended: its seal does not fit")
        there = set(self.folder.result_files())
        for name in sorted(there | set(files)):
            if name not in there:
                self._problem(name, "is missing")
            elif name not in files:
                self._problem(name, "was added after the run ended")
            elif self.folder.hash_of(name) != files[name]:
                self._problem(name, "was changed after the run ended")
            self._count("files")
        torn = self.folder.damage
        self.notes += torn if "journal.jsonl" not in "".join(self.problems) else []

    # Manifest --------------------------------------------------------------------------------------------------

    def _detectors(self) -> None:
        """Identities of detectors from their configuration and the hashes of their sources; captures by content."""
        identities, sources = self.manifest["detectors"], self.manifest["sources"]
        configs = {config["name"]: config for config in self.manifest["experiment"]["detectors"]}
        for name in sorted({*identities, *configs}):
            with self._checking(f"manifest.json, detector {_shown(name)}"):
                if detector_identity(configs[name], sources) != identities[name]:
                    self._problem("manifest.json", f"identity of detector {_shown(name)} is not that of its steps")
            self._count("detectors")
        for capture_id, sha256 in self.manifest["data"].items():
            with self._checking(f"captures/{_shown(capture_id)}.json"):
                if self.folder.content(capture_id) != sha256:
                    self._problem(f"captures/{capture_id}.json", "states another content than the manifest")
            self._count("captures")

    # Journal ---------------------------------------------------------------------------------------------------

    def _entries(self) -> None:
        for entry in self.entries:
            with self._checking(f"journal.jsonl, {_about(entry)}"):
                self._entry(entry)
            self._count("units")

    def _entry(self, entry: Entry) -> None:
        where = f"journal.jsonl, {_about(entry)}"
        if entry.status not in ("done", "failed"):
            self._problem(where, f"status must be done or failed, not {_shown(entry.status)}")
        if entry.kind == "listing":
            expected = listing_name(entry.dataset)
        elif entry.kind == "stability":
            expected = stability_name(entry.detector)
        elif entry.kind in ("accuracy", "latency"):
            expected = unit_name(entry.kind, entry.detector, entry.dataset, self._capture_name(entry))
        else:
            self._problem(where, f"no kind of unit '{_shown(entry.kind)}'")
            return
        if entry.unit != expected:
            self._problem(where, "the name of its files is not that of what it is about")
            return
        if entry.detector and entry.detector not in self.manifest["detectors"]:
            self._problem(where, "the manifest has no such detector")
        elif entry.status == "done" and entry.kind != "listing":
            {"accuracy": self._accuracy, "latency": self._latency, "stability": self._stability}[entry.kind](entry)

    def _capture_name(self, entry: Entry) -> str:
        for used in self.manifest["experiment"]["datasets"]:
            if used["label"] == entry.dataset:
                runs = self.manifest.get("runs", {}).get(entry.dataset, {})
                return capture_name(used["use"], used["params"], entry.capture, runs.get(entry.capture, ()))
        raise ValueError(f"the manifest has no dataset {_shown(entry.dataset)}")

    def _stability(self, entry: Entry) -> None:
        identity = self.manifest["detectors"][entry.detector]
        expected = [
            stability_identity(identity, session["versions"]["uwbbench"], session.get("case_packages", ()))
            for session in self.manifest["sessions"]
        ]
        self._identity(entry, expected)

    def _accuracy(self, entry: Entry) -> None:
        sha256 = self._content(entry)
        rules = rules_on(rules_of(self.manifest["experiment"]), entry.dataset)
        self._identity(entry, [accuracy_identity(self._detector_of(entry), sha256, rules)])
        detections, header = self.folder.detections(entry.unit), self.folder.header(entry.capture_id)
        counts = {"frames": len(header), "processed": len(detections.processed), "detections": len(detections)}
        for name, count in counts.items():
            if entry.facts[name] != count:
                self._problem(
                    f"journal.jsonl, {_about(entry)}", f"states {entry.facts[name]} {name}, stored are {count}"
                )
        if entry.facts["source"] != header.source:
            self._problem(f"journal.jsonl, {_about(entry)}", f"its capture is {header.source}")
        again = score_rows(detections, header, rules)
        self._same(f"journal.jsonl, {_about(entry)}", entry.scores, again)
        for row in entry.scores:
            self._causes(f"journal.jsonl, {_about(entry)}", row)
        stored = rules_on(self.folder.rules, entry.dataset)
        self.sound[entry.unit] = again if stored == rules else score_rows(detections, header, stored)
        self._count("units scored again")
        if REPORTED_FACT in entry.facts:
            times = reported_times(self.folder.times_us(entry.unit))
            self._same(f"journal.jsonl, {_about(entry)}", [entry.facts[REPORTED_FACT]], [times])

    def _detector_of(self, entry: Entry) -> str:
        """Identity of the detector; where results were read, by what was read for this unit."""
        config = next(c for c in self.manifest["experiment"]["detectors"] if c["name"] == entry.detector)
        if not from_results(config):
            return str(self.manifest["detectors"][entry.detector])
        return detector_identity(config, {f"{RESULTS}{entry.detector}": entry.facts[RESULTS_FACT]["sha256"]})

    def _latency(self, entry: Entry) -> None:
        sha256 = self._content(entry) if entry.capture_id else ""
        detector, settings = self.manifest["detectors"][entry.detector], self.manifest["experiment"]["latency"]
        machines = [session["machine"] for session in self.manifest["sessions"]]
        self._identity(entry, [latency_identity(detector, sha256, settings, machine) for machine in machines])
        times_us = self.folder.times_us(entry.unit)
        late = times_us > entry.facts["deadline_us"]
        again = {"n": len(times_us), "p50_us": float(np.median(times_us)), "mean_us": float(times_us.mean())}
        again |= {"max_us": float(times_us.max()), "missed": int(late.sum()), "missed_share": float(late.mean())}
        stored = {key: entry.facts[key] for key in again}
        if entry.facts.get("step") is not None:  # earlier versions timed the step alone
            step_us = self.folder.step_times_us(entry.unit)
            again |= {"step p50_us": float(np.median(step_us)), "step max_us": float(step_us.max())}
            stored |= {f"step {key}": entry.facts["step"][key] for key in ("p50_us", "max_us")}
        self._same(f"journal.jsonl, {_about(entry)}", [stored], [again])
        self._count("times summed up again")

    def _content(self, entry: Entry) -> str:
        if entry.capture_id != self._capture_name(entry):
            raise ValueError("its capture is not the one that it names")
        return str(self.manifest["data"][entry.capture_id])

    def _identity(self, entry: Entry, allowed: list[str]) -> None:
        if entry.identity not in allowed:
            self._problem(
                f"journal.jsonl, {_about(entry)}",
                "its identity is not that of its detector, capture, rules and machine",
            )

    def _completeness(self) -> None:
        """Every detector in every way that any of them was measured: a line that somebody took out is missed.

        Mappers are measured on runs, others on captures.
        """
        experiment, detectors = self.manifest["experiment"], self.manifest["detectors"]
        units = {(e.kind, e.detector, e.dataset, e.capture) for e in self.entries if e.kind != "listing"}
        read_only = {config["name"] for config in experiment["detectors"] if from_results(config)}
        mappers = {config["name"] for config in experiment["detectors"] if "mapper" in config}
        mappers |= {e.detector for e in self.entries if self.folder.has_poses(e.unit)}
        expected = {(kind, dataset, capture, name in mappers) for kind, name, dataset, capture in units}
        if experiment["stability"]:
            expected |= {("stability", "", "", of_runs) for of_runs in (False, True)}
        if experiment["latency"]["enabled"] and set(detectors) > read_only:
            timed = {unit[2] for unit in units if unit[0] == "latency"}
            untimed = {used["label"] for used in experiment["datasets"] if used.get("latency") is False}
            for dataset in sorted({unit[2] for unit in units if unit[0] == "accuracy"} - timed - untimed):
                self._problem("journal.jsonl", f"no line about times on {_shown(dataset)}")
        for kind, dataset, capture, of_runs in sorted(expected):
            for detector in detectors:
                if (detector in read_only and kind != "accuracy") or (detector in mappers) != of_runs:
                    continue
                if (kind, detector, dataset, capture) not in units:
                    about = " ".join(_shown(name) for name in (kind, detector, dataset, capture) if name)
                    self._problem("journal.jsonl", f"no line about {about}")

    # Scores ----------------------------------------------------------------------------------------------------

    def _scores(self) -> None:
        """Stored scores against those of the stored detections."""
        with self._checking("scores.parquet"):
            done = {e.unit for e in self.entries if e.kind == "accuracy" and e.status == "done"}
            if done - set(self.sound):
                return  # said already: what they would be compared with cannot be made
            table = self.folder.scores()
            scored = with_metrics(self.folder, self.sound, self.folder.rules, self._stored_metrics(table))
            expected = {_key(row): row for row in table_of(self.entries, scored)}
            rows: list[dict[str, Any]] = table.to_dict("records")  # type: ignore[assignment]
            stored = {_key(row): row for row in rows}
            for key in sorted({*expected, *stored}):
                where = "scores.parquet, " + ", ".join(_shown(part) for part in key if part)
                if key not in stored:
                    self._problem(where, "the row is missing")
                elif key not in expected:
                    self._problem(where, "no unit gave this row")
                else:
                    self._same(where, [stored[key]], [expected[key]])
                    self._causes(where, stored[key])
                self._count("rows of scores")

    def _causes(self, where: str, row: Mapping[str, Any]) -> None:
        """Causes against the errors that they explain; those of misses cannot be made again without candidates."""
        stored = causes_of(row)
        counts = {} if stored is None else {"fn": stored.misses, "fp": stored.false}
        for name, parts in counts.items():
            if sum(parts.values()) != row[name]:
                self._problem(where, f"the causes of {name} add up to {sum(parts.values())}, not to {row[name]}")

    def _stored_metrics(self, table: pd.DataFrame) -> list[str]:
        """Listed metrics that were stored, which version 0.1.0 did not, and are installed."""
        listed = names_of(self.manifest["experiment"]["metrics"])
        metrics = MetricChoice(listed, [rule.scoring for rule in self.folder.rules])
        self.notes += [
            f"metric {_shown(name)} is not installed: its values were not checked" for name in metrics.absent
        ]
        there = [name for name in metrics.listed if name not in metrics.absent]
        return [name for name in there if column_of(name, metrics[name].unit) in table]

    def _same(self, where: str, stored: list[Any], again: list[dict[str, Any]]) -> None:
        """Rows that were stored and computed again."""
        if len(stored) != len(again):
            self._problem(where, f"has {len(stored)} rows of scores, its detections give {len(again)}")
            return
        for row, expected in zip(stored, again, strict=True):
            other = [name for name, value in expected.items() if not _equal(row.get(name), value)]
            if other:
                differences = ", ".join(
                    f"{name} {_shown(row.get(name))}, not {_shown(expected[name])}" for name in other[:3]
                )
                more = f" and {len(other) - 3} more" if len(other) > 3 else ""
                of = " ".join(str(expected[key]) for key in ("scoring", "table") if expected.get(key))
                cause = "edited, or made by another version; 'uwbbench rescore' makes scores again"
                self._problem(where, f"{of + ': ' if of else ''}{differences}{more}: {cause}")


def _key(row: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(_text(row.get(name) or "") for name in ("detector", "dataset", "capture", "scoring", "table"))


def _text(value: Any) -> str:
    """Text as a table holds it: bytes of a file name that are no text are escapes there."""
    return str(value).encode("utf-8", "backslashreplace").decode()


def _equal(stored: Any, again: Any) -> bool:
    """Whether two values are the same: NaN, null and a missing value are."""
    missing = [value is None or (isinstance(value, float) and math.isnan(value)) for value in (stored, again)]
    if any(missing):
        return all(missing) or (again in ("", None) and missing[0])
    if isinstance(stored, int | float | np.number | np.bool_) and isinstance(again, int | float):
        return math.isclose(float(stored), float(again), rel_tol=RELATIVE, abs_tol=ABSOLUTE)
    return _text(stored) == _text(again)


def _about(entry: Entry) -> str:
    names = (entry.kind, entry.detector, entry.dataset, entry.capture)
    return " ".join(_shown(name) for name in names if name)


def _shown(value: Any) -> str:
    """Value on one line, cut where it is long."""
    return printable(value, LONGEST_NAME)
