"""Scoring a run again from its stored detections, without running anything."""

from __future__ import annotations

from collections.abc import Sequence

from uwbbench.measure.accuracy.scoring import ScoringRules
from uwbbench.run.folder.folder import RunFolder
from uwbbench.run.folder.scored import score_rows, table_of, with_metrics


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
        entry.unit: score_rows(folder.detections(entry.unit), folder.header(entry.capture_id), chosen)
        for entry in entries
        if entry.kind == "accuracy" and entry.status == "done"
    }
    rows = with_metrics(folder, scored, chosen, folder.manifest["experiment"]["metrics"])
    folder.write_scores(table_of(entries, rows), chosen)
