"""Pictures of where errors come from, and of detectors without their thresholds, for the page of a dataset."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from uwbbench.measure.accuracy.intervals import CONFIDENCE
from uwbbench.measure.accuracy.ranked import RankedCounts
from uwbbench.results.error_causes import error_causes
from uwbbench.results.leaderboard.ranking import Ranking, Standing
from uwbbench.results.ranked_curves import RankedCurve, ranked_curve
from uwbbench.show.charts import cause_chart, curve_charts
from uwbbench.show.charts.chart import Spec
from uwbbench.show.text.error_sheets import main_causes


def error_pictures(ranking: Ranking, title: str, names: Mapping[str, str]) -> Iterator[Spec]:
    """What causes of errors cost, precision against recall, and recall against false alarms, as far as they are known.

    Parameters
    ----------
    ranking : Ranking
        The first board of the dataset.
    title : str
        Of the dataset's section; says so where captures are simulated.
    names : mapping of str to str
        Labels of contenders by key.
    """
    dataset = ranking.board[0]
    scored = [
        one
        for standing in ranking.standings
        for one in standing.contender.scored
        if (one.dataset, one.source) == ranking.board[:2]
    ]
    curves = {standing.contender.key: _curve(standing, dataset) for standing in ranking.standings}
    known = {key: curve for key, curve in curves.items() if curve is not None}
    drawn = (
        cause_chart.causes_of_errors(f"{title}: causes of errors", main_causes(error_causes(scored)), names),
        curve_charts.precision_against_recall(f"{title}: precision against recall", known, names),
        curve_charts.recall_against_false_alarms(f"{title}: recall against false alarms", known, names),
    )
    return (spec for spec in drawn if spec is not None)


def _curve(standing: Standing, dataset: str) -> RankedCurve | None:
    """Curve of the runs that count for a detector; None where they did not store what it needs."""
    parts: list[tuple[RankedCounts, str]] = []
    for (label, _), (run, entry) in sorted(standing.contender.chosen.items()):
        known = label == dataset and entry.status == "done"
        counts = run.folder.curve(entry.unit, run.rules[0].of(label)) if known else None
        if counts is not None:
            parts.append((counts, run.folder.scene(label, entry.capture)))
    return ranked_curve(parts, CONFIDENCE)
