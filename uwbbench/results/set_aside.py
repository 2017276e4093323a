"""Detections that a scoring never looked at: where it set aside most of what a detector found, its scores flatter.

``frame`` judges the strongest detection of each frame, and ``strongest`` so many of them. A detector that reports half
of all taps can be right with its strongest one every time: F1 near 1, and thousands of false alarms a minute that
nobody counted.
"""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from uwbbench.measure.accuracy.judge import judge
from uwbbench.measure.accuracy.metrics.detection import FalseAlarmsPerMinute, Precision
from uwbbench.measure.accuracy.rules import outcome_of
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.scoring import ScoringRules
from uwbbench.measure.accuracy.stats import evaluate
from uwbbench.results.results import Scored
from uwbbench.run.folder.folder import RunFolder
from uwbbench.run.folder.journal import Entry

MOST = 0.5
"""Share of the detections in the region from which their being set aside is worth a warning."""


@dataclass(frozen=True)
class SetAside:
    """One detector on one dataset under a scoring that looks at few of its detections.

    Attributes
    ----------
    detector, dataset, source, scoring : str
    frames : int
        Scored ones.
    found, judged : int
        Detections in the region, and those that the scoring looked at.
    precision, false_alarms_per_minute : float
        Of all of them, by ``object``; NaN where the truth is not exhaustive.
    """

    detector: str
    dataset: str
    source: str
    scoring: str
    frames: int
    found: int
    judged: int
    precision: float
    false_alarms_per_minute: float

    @property
    def share(self) -> float:
        """Share of the detections that the scoring did not look at."""
        return 1 - self.judged / self.found


def set_aside(folder: RunFolder, entries: Sequence[Entry], scored: Sequence[Scored]) -> list[SetAside]:
    """Every detector and dataset of which a scoring looked at less than half of the detections, after filtering.

    Parameters
    ----------
    folder : RunFolder
    entries : sequence of Entry
        Accuracy entries that were done.
    scored : sequence of Scored
        What was scored of them.
    """
    few: dict[str, ScoringRules] = {
        rule.scoring: rule
        for rule in folder.rules
        if (rule.scoring == "frame" or rule.strongest is not None) and not outcome_of(rule.scoring).of_run
    }
    units = {(entry.detector, entry.dataset, entry.capture): entry for entry in entries}
    boards: dict[tuple[str, str, str, str], list[Scored]] = defaultdict(list)
    for one in scored:
        if one.scoring in few and one.table == "filtering":
            boards[one.detector, one.dataset, one.source, one.scoring].append(one)
    kept = []
    for about, members in boards.items():
        judged = sum(len(one.outcome.error_m) for one in members)
        found = [folder.detections(units[one.detector, one.dataset, one.capture].unit) for one in members]
        if sum(map(len, found)) * (1 - MOST) <= judged:  # in the region there are no more of them
            continue
        rule = dataclasses.replace(few[about[3]].of(about[1]), scoring="object", strongest=None)
        headers = [folder.header(units[one.detector, one.dataset, one.capture].capture_id) for one in members]
        every = [
            judge(detections, Scene.of(detections, header), rule, "filtering").outcome
            for detections, header in zip(found, headers, strict=True)
        ]
        total = sum(len(outcome.error_m) for outcome in every)
        if total * (1 - MOST) > judged:
            frames = sum(len(outcome.group) for outcome in every)
            rates = evaluate(Precision, every), evaluate(FalseAlarmsPerMinute, every)
            kept.append(SetAside(*about, frames, total, judged, *rates))
    return kept
