"""One contributed run, checked before anything of it is believed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from uwbbench.api.errors import StoreError, UwbbenchError
from uwbbench.measure.accuracy.scoring import ScoringRules
from uwbbench.results.report import read_safely
from uwbbench.results.results import Scored, scored
from uwbbench.run.folder.folder import RunFolder
from uwbbench.run.folder.identity import canonical, latency_identity
from uwbbench.run.folder.journal import Entry
from uwbbench.run.folder.verify import verify


class Unverified(UwbbenchError):
    """Runs do not hold what they claim.

    Parameters
    ----------
    problems : mapping of str to sequence of str
        What does not hold, by run folder.
    """

    def __init__(self, problems: Mapping[str, Sequence[str]]) -> None:
        lines = [f"{run}: {problem}" for run, listed in problems.items() for problem in listed]
        super().__init__("\n".join(["these runs do not verify, so nothing was written:", *lines]))
        self.problems = {run: list(listed) for run, listed in problems.items()}


@dataclass(frozen=True)
class Run:
    """A verified run.

    Attributes
    ----------
    name : str
        Of its folder; distinct among the runs of a leaderboard.
    folder : RunFolder
    entries : tuple of Entry
    scored : tuple of Scored
    rules : tuple of ScoringRules
        Of its stored scores.
    checked : mapping of str to int
        What was verified.
    """

    name: str
    folder: RunFolder
    entries: tuple[Entry, ...]
    scored: tuple[Scored, ...]
    rules: tuple[ScoringRules, ...]
    checked: Mapping[str, int]

    @property
    def manifest(self) -> Mapping[str, Any]:
        """Its manifest."""
        return self.folder.manifest

    @property
    def experiment(self) -> Mapping[str, Any]:
        """Its resolved experiment."""
        experiment: Mapping[str, Any] = self.manifest["experiment"]
        return experiment

    @property
    def started(self) -> str:
        """When its last session started; orders runs by age."""
        return str(self.manifest["sessions"][-1]["started"])

    @cached_property
    def scored_by_unit(self) -> dict[tuple[str, str, str], list[Scored]]:
        """What was scored, by detector, dataset and capture."""
        by_unit: dict[tuple[str, str, str], list[Scored]] = {}
        for one in self.scored:
            by_unit.setdefault((one.detector, one.dataset, one.capture), []).append(one)
        return by_unit

    def machine_of(self, entry: Entry) -> str:
        """The machine that a latency unit was measured on, as one line."""
        sha256 = self.manifest["data"].get(entry.capture_id, "")
        detector, settings = self.manifest["detectors"][entry.detector], self.experiment["latency"]
        for session in self.manifest["sessions"]:
            if latency_identity(detector, sha256, settings, session["machine"]) == entry.identity:
                return machine_name(session["machine"])
        raise StoreError(f"{self.folder.path}: no session measured {entry.detector} on {entry.capture}")

    @property
    def machines(self) -> tuple[str, ...]:
        """Machines of its sessions, each as one line."""
        return tuple(dict.fromkeys(machine_name(session["machine"]) for session in self.manifest["sessions"]))


def machine_name(machine: Mapping[str, Any]) -> str:
    """A machine as one line; machines that differ in anything that is known have different lines."""
    return f"{machine['cpu']}, {machine['usable_cores']} of {machine['cores']} cores, {machine['os']}"


def read_runs(paths: Sequence[Path], progress: Callable[[str], None] | None = None) -> list[Run]:
    """Read and verify runs, the oldest first.

    Parameters
    ----------
    paths : sequence of Path
    progress : callable, optional
        Called with what is about to be done.

    Raises
    ------
    StoreError
        If a path is no run folder, or two are the same run.
    Unverified
        If something in them does not hold; all of them are looked at first.
    """
    folders = [RunFolder(path) for path in paths]
    problems: dict[str, Sequence[str]] = {}
    checked = []
    for folder in folders:
        if progress is not None:
            progress(f"verifying {folder.path}")
        verification = verify(folder)
        checked.append(verification.checked)
        if not verification.passed:
            problems[str(folder.path)] = verification.problems
    if problems:
        raise Unverified(problems)
    _distinct(folders)
    names = _names([folder.path for folder in folders])
    runs = [_read_run(*verified) for verified in zip(folders, names, checked, strict=True)]
    return sorted(runs, key=lambda run: (run.started, run.manifest["seal"]))


def _read_run(folder: RunFolder, name: str, checked: Mapping[str, int]) -> Run:
    with read_safely(folder.path):
        return Run(name, folder, tuple(folder.entries()), tuple(scored(folder)), tuple(folder.rules), checked)


def _distinct(folders: Sequence[RunFolder]) -> None:
    """Refuse a run that was given twice, perhaps as a copy: its results would count twice as evidence."""
    seen: dict[str, RunFolder] = {}
    for folder in folders:
        key = canonical([folder.manifest["seal"]])
        if key in seen:
            raise StoreError(f"{folder.path}: is the same run as {seen[key].path}; give it once")
        seen[key] = folder


def _names(paths: Sequence[Path]) -> list[str]:
    """Distinct names: the folder's, with as many parents as it takes to distinguish it from the others."""
    all_parts = [path.resolve().parts for path in paths]
    names = []
    for parts in all_parts:
        length = next(
            (n for n in range(1, len(parts)) if sum(other[-n:] == parts[-n:] for other in all_parts) == 1), len(parts)
        )
        names.append("/".join(part for part in parts[-length:] if part != "/"))
    return names
