"""What changed in scores and times between two runs.

Conventions
-----------
* Both runs are judged again under the rules of the first one, so that what differs is what was detected.
* Differences are second minus first, on the same captures, with intervals over scenes; p-values are adjusted after
  Holm over the detectors of a dataset, scoring and table, for each metric.
* Of times only the ratio to the reference is compared, and only where both used the same reference and timed the same.
  Its interval is that of two independent log-normal values, each inside its run; it does not know how much processes
  differ.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from uwbbench.api.errors import ScoringError
from uwbbench.api.metric import Metric, Outcome
from uwbbench.measure.accuracy.boards import holm
from uwbbench.measure.accuracy.metrics.choice import MetricChoice
from uwbbench.measure.accuracy.rules import rules_on
from uwbbench.measure.accuracy.scoring import ScoringRules, outcomes
from uwbbench.measure.accuracy.stats import Difference, evaluate, paired_difference
from uwbbench.results.comparison.units import Unit
from uwbbench.results.pareto import NORMAL_975, Speed, speeds_of_run
from uwbbench.results.slices import Board
from uwbbench.results.times import WORDS
from uwbbench.run.folder.folder import RunFolder


@dataclass(frozen=True)
class ScoreChange:
    """One metric of one detector on one board.

    Attributes
    ----------
    board : Board
    detector, metric : str
    captures : int
    before, after : float
    difference : Difference
        After minus before.
    adjusted : float
        The p-value after Holm; NaN within the recordings of one to three scenes.
    """

    board: Board
    detector: str
    metric: str
    captures: int
    before: float
    after: float
    difference: Difference
    adjusted: float

    @property
    def changed(self) -> bool:
        """Whether it differs by more than sums that were rounded otherwise; undefined is not zero."""
        undefined = math.isnan(self.before), math.isnan(self.after)
        if any(undefined):
            return not all(undefined)
        return not math.isclose(self.before, self.after, rel_tol=1e-9, abs_tol=1e-12)


@dataclass(frozen=True)
class TimeChange:
    """Time ratio to the reference of one detector on one dataset.

    Attributes
    ----------
    dataset, detector : str
    before, after : Speed
    factor, low, high : float
        After over before, with the ends of a 95 % interval.
    """

    dataset: str
    detector: str
    before: Speed
    after: Speed
    factor: float
    low: float
    high: float


def score_changes(
    units: Sequence[Unit],
    rules: Sequence[ScoringRules],
    metrics: MetricChoice,
    settings: Mapping[str, Any],
) -> tuple[list[ScoreChange], list[str]]:
    """Every metric of every board, and what could not be judged.

    Parameters
    ----------
    units : sequence of Unit
    rules : sequence of ScoringRules
    metrics : MetricChoice
    settings : mapping
        ``confidence`` of the intervals.
    """
    boards: dict[Board, dict[str, list[tuple[Outcome, Outcome, str]]]] = defaultdict(lambda: defaultdict(list))
    missing: dict[str, None] = {}
    for unit in units:
        for rule in rules_on(rules, unit.dataset):
            try:
                before, after = (outcomes(detections, unit.header, rule) for detections in unit.detections)
            except ScoringError as error:
                missing[f"not judged by {rule.scoring}: {error}"] = None
                continue
            for table in before:
                if table in after:
                    board = unit.dataset, unit.header.source, rule.scoring, table
                    boards[board][unit.detector].append((before[table], after[table], unit.scene))
    every = [
        change
        for board, members in boards.items()
        for change in _changes(board, members, metrics.of(board[2]), settings)
    ]
    return every, list(missing)


def _changes(
    board: Board,
    members: Mapping[str, list[tuple[Outcome, Outcome, str]]],
    metrics: Mapping[str, type[Metric]],
    settings: Mapping[str, Any],
) -> Iterator[ScoreChange]:
    for name, metric in metrics.items():
        rows = []
        for detector, pairs in members.items():
            before, after, scenes = (list(part) for part in zip(*pairs, strict=True))
            difference = paired_difference(metric, after, before, scenes, confidence=settings["confidence"])
            rows.append((detector, len(pairs), evaluate(metric, before), evaluate(metric, after), difference))
        adjusted = holm([row[-1].p_value for row in rows]).tolist()
        for (detector, captures, old, new, difference), p_value in zip(rows, adjusted, strict=True):
            if not (math.isnan(old) and math.isnan(new)):
                yield ScoreChange(board, detector, name, captures, old, new, difference, p_value)


def time_changes(first: RunFolder, second: RunFolder) -> tuple[list[TimeChange], list[str]]:
    """Time ratios that both runs measured, and what could not be compared."""
    sides = [speeds_of_run(folder.entries()) for folder in (first, second)]
    identities = [folder.manifest.get("reference") for folder in (first, second)]
    compared, missing = [], dict[str, None]()
    for (dataset, detector), before in sides[0].items():
        after = sides[1].get((dataset, detector))
        if after is None:
            continue
        if before.timed != after.timed:
            kinds = WORDS[before.timed], WORDS[after.timed]
            missing[f"times not compared: those of the first run are {kinds[0]}, of the second {kinds[1]}"] = None
            continue
        if before.reference != after.reference or identities[0] != identities[1]:
            missing["times not compared: the references differ"] = None
            continue
        middle = math.log(after.ratio / before.ratio)
        reach = NORMAL_975 * math.hypot(before.spread, after.spread)
        reach = math.nan if math.isnan(before.low) or math.isnan(after.low) else reach
        ends = [math.exp(value) for value in (middle, middle - reach, middle + reach)]
        compared.append(TimeChange(dataset, detector, before, after, *ends))
    return compared, list(missing)
