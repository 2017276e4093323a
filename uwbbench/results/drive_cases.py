"""The run of each dataset that is looked at: what every mapper made of it.

Conventions
-----------
* It is the run in the middle: of the leading detector's runs, by the metric that ranks, the one that as many are better
  than as are worse; of two such the better one. One run for each dataset keeps a page small, and the middle flatters
  nobody.
* Poses are those handed out on the way, with the start on the true one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from uwbbench.measure.accuracy.metrics.choice import MetricChoice
from uwbbench.measure.accuracy.stats import evaluate
from uwbbench.results.cases import MOST_DATASETS
from uwbbench.results.drives import MappedDrive
from uwbbench.results.results import Scored
from uwbbench.run.folder.folder import RunFolder
from uwbbench.run.folder.journal import Entry


@dataclass(frozen=True)
class DriveCase:
    """A run to be looked at.

    Attributes
    ----------
    dataset, source, run : str
    runs : int
        Of the dataset.
    leader : str
        The detector whose middle run it is.
    scoring, metric : str
        By which scoring and metric.
    score : float
    drives : dict of str to MappedDrive
        By detector; at least one.
    """

    dataset: str
    source: str
    run: str
    runs: int
    leader: str
    scoring: str
    metric: str
    score: float
    drives: dict[str, MappedDrive]


def drive_cases(
    folder: RunFolder,
    entries: Sequence[Entry],
    scored: Sequence[Scored],
    leaders: dict[tuple[str, str], str],
    metrics: MetricChoice,
) -> Iterator[DriveCase]:
    """The middle run of each dataset that has any.

    Parameters
    ----------
    folder : RunFolder
    entries : sequence of Entry
        Accuracy entries that were done.
    scored : sequence of Scored
    leaders : dict
        Leading detector of each dataset and source.
    metrics : MetricChoice
        Of the run.
    """
    found = 0
    for (dataset, source), leader in leaders.items():
        there = [one for one in scored if (one.dataset, one.source, one.table) == (dataset, source, "filtering")]
        there = [one for one in there if one.outcome.of_run]
        if not there or found == MOST_DATASETS:
            continue
        names = {one.detector for one in there}
        first = leader if leader in names else there[0].detector
        scoring = next(rule.scoring for rule in folder.rules if any(one.scoring == rule.scoring for one in there))
        ranking = metrics.of(scoring).ranking(exhaustive=all(one.outcome.exhaustive for one in there))
        metric = metrics[ranking]
        rows = [
            (evaluate(metric, [one.outcome]), one.capture)
            for one in there
            if (one.detector, one.scoring) == (first, scoring)
        ]
        ranked = sorted(
            (row for row in rows if not math.isnan(row[0])), key=lambda row: (-metric.merit(row[0]), row[1])
        )
        if not ranked:
            continue
        score, run = ranked[(len(ranked) - 1) // 2]
        drives = dict(_drives(folder, [one for one in entries if (one.dataset, one.capture) == (dataset, run)]))
        if drives:
            found += 1
            yield DriveCase(dataset, source, run, len(ranked), first, scoring, ranking, score, drives)


def _drives(folder: RunFolder, entries: Sequence[Entry]) -> Iterator[tuple[str, MappedDrive]]:
    for entry in entries:
        detections = folder.detections(entry.unit)
        mapped = detections.mapped
        if mapped is not None and len(mapped.poses):
            yield entry.detector, MappedDrive(folder.header(entry.capture_id), detections, mapped, mapped.poses)
