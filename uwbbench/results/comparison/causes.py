"""Which causes of errors grew between two runs.

Conventions
-----------
* Causes are those that both runs stored, after filtering, added up over the captures that both did. They can be
  compared only where both were found under the same rules.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from uwbbench.measure.accuracy.causes import NOT_KNOWN
from uwbbench.measure.accuracy.rules import outcome_of
from uwbbench.measure.accuracy.scoring import ScoringRules
from uwbbench.results.comparison.units import Unit
from uwbbench.results.error_causes import Error
from uwbbench.run.folder.folder import RunFolder
from uwbbench.run.folder.scored import causes_of

Counts = Counter[tuple[str, Error, str]]
"""Errors by detector, kind of error and cause."""


@dataclass(frozen=True)
class CauseChange:
    """Errors of one cause, in both runs.

    Attributes
    ----------
    detector : str
    error : {"missed", "false"}
    cause : str
    before, after : int
    """

    detector: str
    error: Error
    cause: str
    before: int
    after: int

    @property
    def growth(self) -> int:
        """By how many they became more."""
        return self.after - self.before


def cause_changes(
    folders: tuple[RunFolder, RunFolder], units: Sequence[Unit], rule: ScoringRules
) -> tuple[list[CauseChange], list[str]]:
    """Causes whose count changed, those that grew most first, and what could not be compared.

    Parameters
    ----------
    folders : (RunFolder, RunFolder)
    units : sequence of Unit
        Those that both runs did.
    rule : ScoringRules
        Of the first run.
    """
    if not units or outcome_of(rule.scoring).of_run:
        return [], []
    if rule not in folders[1].rules:
        return [], ["causes of errors not compared: the runs were scored by different rules"]
    sides = [_stored(folder, rule) for folder in folders]
    before, after = Counts(), Counts()
    missing = 0
    for unit in units:
        key = unit.detector, unit.dataset, unit.capture
        found = [side.get(key) for side in sides]
        if None in found:
            missing += 1
            continue
        for into, counts in zip((before, after), found, strict=True):
            into.update(counts)
    changed = [CauseChange(*key, before[key], after[key]) for key in {**before, **after} if before[key] != after[key]]
    notes = [f"causes of errors of {missing} units not compared: they are not stored"] if missing else []
    return sorted(changed, key=lambda one: (-one.growth, one.detector, one.error, one.cause)), notes


def _stored(folder: RunFolder, rule: ScoringRules) -> dict[tuple[str, str, str], Counts]:
    """Counts of each unit whose causes are known."""
    made = {}
    rows: list[dict[str, Any]] = folder.scores().to_dict("records")  # type: ignore[assignment]
    for row in rows:
        causes = causes_of(row)
        if (
            causes is None
            or NOT_KNOWN in causes.misses
            or (row["scoring"], row["table"]) != (rule.scoring, "filtering")
        ):
            continue
        counts = Counts({(row["detector"], "missed", cause): count for cause, count in causes.misses.items()})
        counts.update({(row["detector"], "false", kind): count for kind, count in causes.false.items()})
        made[row["detector"], row["dataset"], row["capture"]] = counts
    return made
