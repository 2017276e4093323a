"""Scoring a run again from its stored detections, without running anything."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from uwbbench.measure.accuracy.rules import rules_on
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.scoring import ScoringRules
from uwbbench.run.folder.folder import RunFolder
from uwbbench.run.folder.journal import Entry
from uwbbench.run.folder.scored import CAUSES, rules_of, scorable, score_rows, table_of, with_causes, with_metrics


def rescore(folder: RunFolder, rules: Sequence[ScoringRules] | None = None) -> None:
    """Compute all scores again and store them.

    Parameters
    ----------
    folder : RunFolder
    rules : sequence of ScoringRules, optional
        Other rules; by default those of the stored scores.

    Raises
    ------
    PluginError
        If a metric that the experiment lists raises anything.
    StoreError
        If stored detections are missing or broken, or the scores cannot be written.
    """
    chosen = folder.rules if rules is None else list(rules)
    entries = folder.entries()
    scored = {
        entry.unit: _scored_again(folder, entry, chosen)
        for entry in entries
        if entry.kind == "accuracy" and entry.status == "done"
    }
    rows = with_metrics(folder, scored, chosen, folder.manifest["experiment"]["metrics"])
    folder.write_scores(table_of(entries, rows), chosen)


def _scored_again(folder: RunFolder, entry: Entry, rules: Sequence[ScoringRules]) -> list[dict[str, Any]]:
    """Rows of a unit; where its candidates are not stored, causes of misses are those that its run has found.

    These hold under the rules of the run alone; under others they are not known.
    """
    detections, header = folder.detections(entry.unit), folder.header(entry.capture_id)
    rules = rules_on(rules, entry.dataset)
    of_run = rules_on(rules_of(folder.manifest["experiment"]), entry.dataset)
    rows = score_rows(detections, header, rules)
    if scorable(rows):
        rows = with_causes(rows, detections, Scene.of(detections, header), rules)
    if detections.candidates is None:
        same = {rule.scoring for rule in set(rules) & set(of_run)}
        known = {(row["scoring"], row["table"]): row[CAUSES] for row in entry.scores if CAUSES in row}
        for row in rows:
            key = row["scoring"], row["table"]
            if row["scoring"] in same and key in known:
                row[CAUSES] = known[key]
    return rows
