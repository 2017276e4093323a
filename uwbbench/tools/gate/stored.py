"""Detections of a stored run, as far as they can be trusted to be what was once measured."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from uwbbench.api.detections import Detections
from uwbbench.api.errors import ConfigError, StoreError, nearest
from uwbbench.measure.accuracy.rules import rules_on
from uwbbench.run.folder.folder import RunFolder
from uwbbench.run.folder.journal import Entry
from uwbbench.run.folder.scored import score_rows


class StoredRun:
    """What one detector found in a stored run.

    Parameters
    ----------
    path : Path
        Run folder.
    detector : str or None
        Its name in that run; if None, ``head`` or, where the run has a single detector, that.
    head : str
        Name of the detector under test.

    Raises
    ------
    ConfigError, StoreError
        If it is no run folder, or has no such detector.
    """

    def __init__(self, path: Path, detector: str | None, head: str) -> None:
        self.folder = RunFolder(path)
        done = [e for e in self.folder.entries() if e.kind == "accuracy" and e.status == "done"]
        names = {entry.detector for entry in done}
        only = next(iter(names)) if len(names) == 1 else head
        self.detector = detector or (head if head in names else only)
        if self.detector not in names:
            hint = nearest(self.detector, names) or " It holds no detections."
            raise ConfigError(f"{path}: that run has nothing of detector '{self.detector}'.{hint}")
        self._entries = [entry for entry in done if entry.detector == self.detector]

    def detections(self, capture: str, sha256: str) -> Detections:
        """What was found on a capture of this content.

        Raises
        ------
        StoreError
            If there is nothing, or the scores stored with it do not follow from it.
        """
        path = self.folder.path
        try:
            entry = next((e for e in self._entries if self.folder.content(e.capture_id) == sha256), None)
            if entry is None:
                damage = "".join(f" {note}." for note in self.folder.damage)
                raise StoreError(f"{path}: that run has no capture with the content of '{capture}'.{damage}")
            detections = self.folder.detections(entry.unit)
            self._check(entry, detections)
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise StoreError(f"{path}: is damaged: {type(error).__name__}: {error}") from error
        return detections

    def _check(self, entry: Entry, found: Detections) -> None:
        """Score the detections again, and compare with the stored scores: an edit of either shows."""
        header = self.folder.header(entry.capture_id)
        about = {"detector": entry.detector, "dataset": entry.dataset, "capture": entry.capture}
        table = self.folder.scores().to_dict("records")
        stored = [row for row in table if all(row[key] == value for key, value in about.items())]
        again = score_rows(found, header, rules_on(self.folder.rules, entry.dataset))
        if len(stored) != len(again):
            self._refuse(entry, f"{len(stored)} rows of scores for {len(again)}")
        for row in again:
            keys = ("scoring", "table")
            match = next((other for other in stored if all(other[key] == row[key] for key in keys)), None)
            wrong = "all" if match is None else next((key for key in row if not _same(match.get(key), row[key])), None)
            if wrong is not None:
                self._refuse(entry, f"{wrong} ({row['scoring']}, {row['table']}) differs")

    def _refuse(self, entry: Entry, what: str) -> None:
        raise StoreError(
            f"{self.folder.path}: the stored scores of '{entry.detector}' on '{entry.capture}' do not follow from its "
            f"stored detections ({what}): edited by hand, or scored by another version; run it again"
        )


def _same(stored: Any, again: Any) -> bool:
    """Equality of two scores; undefined ones are equal, and the last digits may differ between versions of numpy."""
    values = [math.nan if value is None else value for value in (stored, again)]
    if all(isinstance(value, int | float) for value in values):
        one, other = values
        return (math.isnan(one) and math.isnan(other)) or math.isclose(one, other, rel_tol=1e-9, abs_tol=1e-12)
    return bool(stored == again)
