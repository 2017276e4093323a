"""The units of two runs that can be compared: the same detector on the same content."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from uwbbench.api.capture import CaptureHeader
from uwbbench.api.detections import Detections
from uwbbench.run.folder.folder import RunFolder
from uwbbench.run.folder.journal import Entry


@dataclass(frozen=True)
class Unit:
    """One detector on one capture, in both runs.

    Attributes
    ----------
    folders : (RunFolder, RunFolder)
    entries : (Entry, Entry)
    """

    folders: tuple[RunFolder, RunFolder]
    entries: tuple[Entry, Entry]

    @property
    def detector(self) -> str:
        """Name of the detector."""
        return self.entries[0].detector

    @property
    def dataset(self) -> str:
        """Label of the dataset."""
        return self.entries[0].dataset

    @property
    def capture(self) -> str:
        """Name of the capture."""
        return self.entries[0].capture

    @property
    def scene(self) -> str:
        """Scene that the capture is of, by the run that knows which captures repeat it."""
        known = [folder.scene(self.dataset, self.capture) for folder in self.folders]
        return known[0] if known[0] != self.capture else known[1]

    @cached_property
    def header(self) -> CaptureHeader:
        """The capture without its samples."""
        return self.folders[0].header(self.entries[0].capture_id)

    @cached_property
    def detections(self) -> tuple[Detections, Detections]:
        """What was detected, before and after."""
        first, second = (folder.detections(e.unit) for folder, e in zip(self.folders, self.entries, strict=True))
        return first, second


def shared(first: RunFolder, second: RunFolder) -> tuple[list[Unit], list[str]]:
    """Units that both runs did on the same content, and why others are left out, one line for each reason."""
    sides = [
        {(e.detector, e.dataset, e.capture): e for e in folder.entries() if e.kind == "accuracy"}
        for folder in (first, second)
    ]
    units, counts = [], dict[str, int]()
    for key in dict.fromkeys([*sides[0], *sides[1]]):
        before, after = sides[0].get(key), sides[1].get(key)
        if before is None or after is None:
            reason = "only in the second run" if before is None else "only in the first run"
        elif before.status != "done" or after.status != "done":
            failed = [name for name, e in (("first", before), ("second", after)) if e.status != "done"]
            reason = f"failed in the {' and the '.join(failed)} run"
        elif first.content(before.capture_id) != second.content(after.capture_id):
            reason = "the capture has other content"
        else:
            units.append(Unit((first, second), (before, after)))
            continue
        counts[reason] = counts.get(reason, 0) + 1
    return units, [f"{count} units not compared: {reason}" for reason, count in counts.items()]
