"""Rules and scores of a run as it stores them: the same for a fresh run, for scoring it again and for verifying it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from uwbbench.api.capture import CaptureHeader
from uwbbench.api.detections import Detections
from uwbbench.api.errors import PluginError, ScoringError
from uwbbench.api.interruption import by_plugin
from uwbbench.api.metric import Metric, Outcome
from uwbbench.config.rules import RegionModel
from uwbbench.measure.accuracy.causes import Causes, causes
from uwbbench.measure.accuracy.metrics.choice import MetricChoice, Metrics
from uwbbench.measure.accuracy.rules import has_causes
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.scoring import Region, ScoringRules, column_of, outcomes, score_scene
from uwbbench.measure.accuracy.stats import evaluate
from uwbbench.run.folder.folder import RunFolder
from uwbbench.run.folder.identity import canonical
from uwbbench.run.folder.journal import Entry

CAUSES = "causes"
"""Column of scores that holds where errors come from."""


def rules_of(experiment: Mapping[str, Any]) -> tuple[ScoringRules, ...]:
    """Scoring rules of an experiment as the manifest holds it, one for each scoring."""
    region = _region(experiment["region"])
    datasets = experiment["datasets"]
    regions = tuple((used["label"], _region(used["region"])) for used in datasets if "region" in used)
    some = any("scoring" in used for used in datasets)

    def only(scoring: str) -> tuple[str, ...] | None:
        """Datasets that are scored like this; None where no dataset says how it is scored."""
        return tuple(used["label"] for used in datasets if scoring in used.get("scoring", [scoring])) if some else None

    return tuple(
        ScoringRules(
            scoring,
            experiment["gate_m"],
            region,
            experiment["strongest"],
            experiment.get("surface", "outline"),
            regions,
            tuple((used["label"], used["gate_m"]) for used in datasets if "gate_m" in used),
            only(scoring),
        )
        for scoring in experiment["scoring"]
    )


def _region(stored: Mapping[str, Any]) -> Region:
    """Region as an experiment's file has it."""
    return Region(**RegionModel.model_validate(stored).limits)


def score_rows(detections: Detections, header: CaptureHeader, rules: Iterable[ScoringRules]) -> list[dict[str, Any]]:
    """One row for each scoring and table; a scoring that is impossible here is a row with the reason.

    Parameters
    ----------
    detections : Detections
    header : CaptureHeader
        Of the capture that they are of.
    rules : iterable of ScoringRules

    Returns
    -------
    list of dict
        With ``scoring``, ``table``, ``status`` and ``reason``; where scored, the figures of a
        :class:`~uwbbench.measure.accuracy.scoring.ScoreBlock` too.
    """
    rows: list[dict[str, Any]] = []
    scene: Scene | None = None
    for rule in rules:
        about = {"scoring": rule.scoring, "table": "filtering"}
        try:
            scene = scene or Scene.of(detections, header)
            scores = score_scene(detections, scene, rule)
        except ScoringError as error:
            rows.append({**about, "status": "unscored", "reason": str(error)})
            continue
        for table, block in (("filtering", scores.filtering), ("mapping", scores.mapping)):
            if block is not None:
                rows.append({**about, "table": table, "status": "scored", "reason": "", **block.to_dict()})
    return rows


def with_causes(
    rows: Iterable[Mapping[str, Any]], detections: Detections, scene: Scene, rules: Iterable[ScoringRules]
) -> list[dict[str, Any]]:
    """Rows with the causes of their errors, as JSON text under ``causes``.

    Parameters
    ----------
    rows : iterable of mapping
        Of :func:`score_rows`; those that are not scored stay as they are, and so do those by the latest answer, whose
        errors may be those of another frame, or of presence and whole runs, which have none.
    detections : Detections
        With their candidates; without them the causes of misses are not known.
    scene : Scene
        Of the same capture and detections.
    rules : iterable of ScoringRules
        That gave the rows.
    """
    by_name = {rule.scoring: rule for rule in rules}
    completed = [dict(row) for row in rows]
    for row in completed:
        if row["status"] == "scored" and has_causes(row["scoring"]):
            row[CAUSES] = canonical(causes(detections, scene, by_name[row["scoring"]], row["table"]).to_dict())
    return completed


def scorable(rows: Iterable[Mapping[str, Any]]) -> bool:
    """Whether any scoring was possible, so that there is a :class:`Scene` too."""
    return any(row["status"] == "scored" for row in rows)


def causes_of(row: Mapping[str, Any]) -> Causes | None:
    """Causes of the errors of a stored row; None where an earlier version stored none."""
    text = row.get(CAUSES)
    return Causes(**json.loads(text)) if isinstance(text, str) else None


def with_metrics(
    folder: RunFolder,
    rows_of: Mapping[str, list[dict[str, Any]]],
    rules: Sequence[ScoringRules],
    chosen: Metrics,
) -> dict[str, list[dict[str, Any]]]:
    """Rows with values of the metrics that an experiment lists, where these are installed.

    Parameters
    ----------
    folder : RunFolder
        That holds the detections.
    rows_of : mapping
        Rows of units that were done, of :func:`score_rows`.
    rules : sequence of ScoringRules
        That gave the rows.
    chosen : sequence or mapping
        As the experiment has them.

    Raises
    ------
    PluginError
        If a metric raises anything.
    StoreError
        If stored detections are missing or broken.
    """
    metrics = MetricChoice(chosen, [rule.scoring for rule in rules])
    columns = {name: column_of(name, metrics[name].unit) for name in metrics.listed if name not in metrics.absent}
    completed = {unit: list(rows) for unit, rows in rows_of.items()}
    for entry in folder.entries() if columns else ():
        rows = completed.get(entry.unit, []) if entry.kind == "accuracy" else []
        scored = {row["scoring"] for row in rows if row["status"] == "scored"}
        if not scored:
            continue
        detections, header = folder.detections(entry.unit), folder.header(entry.capture_id)
        tables = {
            rule.scoring: outcomes(detections, header, rule.of(entry.dataset))
            for rule in rules
            if rule.scoring in scored
        }
        for place, row in enumerate(rows):
            if row["status"] == "scored":
                outcome = tables[row["scoring"]][row["table"]]
                here = metrics.of(row["scoring"])
                values = {
                    column: _value(name, here[name], outcome) if name in here else None
                    for name, column in columns.items()
                }
                rows[place] = values | row  # what is stored for every run anyway stays
    return completed


def _value(name: str, metric: type[Metric], outcome: Outcome) -> float | None:
    try:
        value = evaluate(metric, [outcome])
    except BaseException as error:
        if not by_plugin(error):
            raise
        raise PluginError(
            f"metric '{name}' fails: {type(error).__name__}: {error}; what was detected is stored: mend the metric and "
            "continue the run with --resume"
        ) from error
    return None if math.isnan(value) else value


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
