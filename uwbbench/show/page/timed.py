"""Columns of times beside the scores: what each detector took, as the page's leaderboard shows it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from uwbbench.show.text.numbers import significant

if TYPE_CHECKING:
    from uwbbench.show.page.content import Content

COLUMNS = ("time ratio", "P50 (us)", "P99 (us)")

TimedCell = tuple[str, str, float | None, str]
"""Text, its second line, what it is sorted by, and more about it."""


def timed_cells(content: Content, dataset: str) -> dict[str, list[TimedCell]]:
    """One cell for each column, by detector; without detectors that were not timed on the dataset."""
    cells = {}
    for detector in content.report.detectors:
        facts = [entry.facts for entry in content.report.measured(dataset, detector)]
        if facts:
            calls = f"n = {sum(one['n'] for one in facts)} calls"
            median = [_median(facts, "p50_us", calls), _median(facts, "p99_us", f"{calls}; needs 368")]
            cells[detector] = [_ratio(content, dataset, detector, calls), *median]
    return cells


def _ratio(content: Content, dataset: str, detector: str, calls: str) -> TimedCell:
    speed = content.speeds.get(dataset, {}).get(detector)
    if speed is None:
        return "n/a", "", None, "not compared with a reference"
    ends = "" if math.isnan(speed.low) else f"[{significant(speed.low)}, {significant(speed.high)}]"
    return significant(speed.ratio), ends, speed.ratio, f"{calls}, against {speed.reference}"


def _median(facts: Sequence[Mapping[str, Any]], key: str, about: str) -> TimedCell:
    known = [one[key] for one in facts if one[key] is not None]
    value = float(np.median(known)) if known else None
    return significant(value, 3), "", value, about
