"""Rules and scores of a run as it stores them: the same for a fresh run, for scoring it again and for verifying it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from uwbbench.api.capture import CaptureHeader
from uwbbench.api.detections import Detections
from uwbbench.api.errors import ScoringError
from uwbbench.config.rules import RegionModel
from uwbbench.measure.accuracy.scoring import Region, ScoringRules, score
from uwbbench.run.folder.journal import Entry


def rules_of(experiment: Mapping[str, Any]) -> tuple[ScoringRules, ...]:
    """Scoring rules of an experiment as the manifest holds it, one for each scoring."""
    region = Region(**RegionModel.model_validate(experiment["region"]).limits)
    return tuple(
        ScoringRules(scoring, experiment["gate_m"], region, experiment["strongest"])
        for scoring in experiment["scoring"]
    )


def score_rows(found: Detections, header: CaptureHeader, rules: Iterable[ScoringRules]) -> list[dict[str, Any]]:
    """One row for each scoring and table; a scoring that is impossible here is a row with the reason."""
    rows: list[dict[str, Any]] = []
    for rule in rules:
        about = {"scoring": rule.scoring, "table": "filtering"}
        try:
            scores = score(found, header, rule.scoring, rule.gate_m, rule.region, rule.strongest)
        except ScoringError as error:
            rows.append({**about, "status": "unscored", "reason": str(error)})
            continue
        for table, block in (("filtering", scores.filtering), ("mapping", scores.mapping)):
            if block is not None:
                rows.append({**about, "table": table, "status": "scored", "reason": "", **block.to_dict()})
    return rows


def table_of(entries: Iterable[Entry], rows_of: Mapping[str, list[dict[str, Any]]]) -> list[dict[str, Any]]:
    """Rows of all units, failed ones included, each with what it belongs to; in the order of names.

    Parameters
    ----------
    entries : iterable of Entry
    rows_of : mapping
        Rows of each unit that was done.
    """
    table = []
    for entry in sorted(entries, key=lambda entry: (entry.dataset, entry.capture, entry.detector)):
        if entry.kind in ("latency", "stability") or (entry.kind == "listing" and entry.status == "done"):
            continue
        about = {"detector": entry.detector, "dataset": entry.dataset, "capture": entry.capture}
        about["source"] = entry.facts.get("source", "")
        failed = [{"scoring": "", "table": "", "status": "failed", "reason": entry.reason}]
        rows = failed if entry.status == "failed" else rows_of[entry.unit]
        table += [{**about, **row} for row in rows]
    return table
