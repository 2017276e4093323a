"""What the times of a run are of, and which of them may be compared.

Conventions
-----------
* Times are *from samples to rows*: raw samples of a frame in, its rows as plain records out. Those of the detector's
  step alone stand beside them.
* Earlier versions stored times of the step alone, and no word of what they are of. They are shown as such, and never
  compared with times from samples to rows.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from uwbbench.run.folder.journal import Entry

ROWS, STEP = "samples to rows", "step"
WORDS = {ROWS: "from samples to rows", STEP: "of the step alone"}

_PERCENTILES = ("p50_us", "p90_us", "p95_us", "p99_us", "mean_us", "max_us")
_AGES = ("p50_frames", "p95_frames", "max_frames", "p50_s", "p95_s", "end_share")


def timed_of(facts: Mapping[str, Any]) -> str:
    """What the times of a stored measurement are of: :data:`ROWS` or :data:`STEP`."""
    return str(facts.get("timed", STEP))


def in_words(entries: Iterable[Entry]) -> str:
    """What the times of these measurements are of, for people."""
    kinds = sorted({WORDS[timed_of(entry.facts)] for entry in entries})
    return " or, where an earlier version measured, ".join(kinds) or WORDS[ROWS]


def comparable(entries: Iterable[Entry]) -> list[Entry]:
    """Those measurements that are of the same: from samples to rows, where there is any of these."""
    listed = list(entries)
    best = ROWS if any(timed_of(entry.facts) == ROWS for entry in listed) else STEP
    return [entry for entry in listed if timed_of(entry.facts) == best]


def step_columns(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Times of the step alone as columns ``step_p50_us`` and so on, whatever the other times are of."""
    step = facts.get("step") or (facts if timed_of(facts) == STEP else {})
    return {f"step_{name}": step.get(name) for name in _PERCENTILES}


def age_columns(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Ages of the answers as columns ``age_p50_frames`` and so on; None where they are not known."""
    age = facts.get("age") or {}
    return {f"age_{name}": age.get(name) for name in _AGES}


def row_of(entry: Entry) -> dict[str, Any]:
    """One stored measurement as a row of a table; what has no place in one, the JSON has."""
    facts = dict(entry.facts)
    ratio, clustering = facts.pop("ratio_to_reference") or {}, facts.pop("clustering") or {}
    columns = {"timed": timed_of(facts), **step_columns(facts), **age_columns(facts)}
    for name in ("plain", "paced", "quality", "machine", "step", "age"):  # older runs have none
        facts.pop(name, None)
    facts["notes"] = "; ".join(facts["notes"])
    about = {"detector": entry.detector, "dataset": entry.dataset, "capture": entry.capture}
    extra = {"ratio_low": ratio.get("low"), "ratio_high": ratio.get("high"), "ratio": ratio.get("ratio")}
    extra |= {"reference": ratio.get("reference"), "clustering_p50_us": clustering.get("p50_us")}
    extra |= {"total_ratio": ratio.get("total_ratio"), "missed_share_high": facts.get("missed_share_high")}
    return {**about, **facts, **columns, **extra}
