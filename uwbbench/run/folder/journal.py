"""The journal: one line for each finished unit, on disk before the next one is taken."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, Literal

from uwbbench.run.folder.files import disk_errors
from uwbbench.run.folder.identity import plain

Kind = Literal["accuracy", "stability", "latency", "listing"]
Status = Literal["done", "failed"]


@dataclass(frozen=True)
class Entry:
    """What became of one unit.

    Attributes
    ----------
    unit : str
        Identifier, also the name of the unit's files.
    kind : {"accuracy", "stability", "latency", "listing"}
        Stability is a detector's alone, without a capture; a listing that fails stands for the captures that it would
        have named.
    detector, dataset, capture : str
        Names; empty where they do not apply.
    status : {"done", "failed"}
    identity : str
        Hash of all that the result depends on; a resumed run repeats a unit whose identity has changed.
    capture_id : str
        File name of the stored capture header; empty where the capture could not be opened.
    reason, traceback : str
        Why it failed: one line, and all of it.
    scores : list of dict
        One row for each scoring and table.
    facts : dict
        Counts, notes and times.
    """

    unit: str
    kind: Kind
    detector: str
    dataset: str
    capture: str
    status: Status
    identity: str = ""
    capture_id: str = ""
    reason: str = ""
    traceback: str = ""
    scores: list[dict[str, Any]] = field(default_factory=list)
    facts: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Entry:
        """Entry of a parsed line; keys of later versions are ignored."""
        known = {item.name for item in fields(cls)}
        return cls(**{key: value for key, value in data.items() if key in known})


def append(path: Path, entry: Entry) -> None:
    """Add one line and wait until it is on disk.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    line = json.dumps(plain(asdict(entry)), allow_nan=False).encode() + b"\n"
    with disk_errors(path, "written"), path.open("ab+") as file:
        if file.tell():
            file.seek(-1, os.SEEK_END)
            if file.read(1) != b"\n":  # a line torn by a crash stays alone
                line = b"\n" + line
        file.write(line)
        file.flush()
        os.fsync(file.fileno())


def read(path: Path) -> tuple[dict[str, Entry], list[str]]:
    """Last entry of each unit, in the order of their first lines, and notes about lines that cannot be read.

    A run that was killed while it wrote leaves a torn line; its unit counts as not done.
    """
    last: dict[str, Entry] = {}
    notes = []
    with disk_errors(path, "read"):
        lines = path.read_bytes().split(b"\n") if path.exists() else []
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            entry = Entry.from_dict(json.loads(line))
            last[entry.unit] = entry
        except (ValueError, TypeError, AttributeError, RecursionError):
            notes.append(f"{path.name} line {number} is torn or damaged and was ignored")
    return last, notes
