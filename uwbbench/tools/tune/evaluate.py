"""Scoring one detector on the captures of a group, in the ordinary way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uwbbench.api.detections import Detections
from uwbbench.api.errors import ScoringError
from uwbbench.api.metric import Outcome
from uwbbench.config.rules import IntervalModel
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.accuracy.metrics.detection import F1
from uwbbench.measure.accuracy.scoring import ScoringRules, outcomes
from uwbbench.measure.accuracy.stats import Estimate, estimated
from uwbbench.tools.tune.captures import Labelled
from uwbbench.tools.tune.sweep.scores import RATIOS, SetScores, set_scores
from uwbbench.tools.tune.sweep.sweep import Swept


@dataclass(frozen=True)
class Result:
    """Scores of one detector on some captures.

    Attributes
    ----------
    captures, frames : int
        Captures, and scored frames of them.
    scores : SetScores
        Of one set.
    f1 : Estimate or None
        F1 with its interval over scenes; None where it was not asked for.
    """

    captures: int
    frames: int
    scores: SetScores
    f1: Estimate | None

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "captures": self.captures,
            "frames": self.frames,
            **figures(self.scores, 0),
            "f1_low": None if self.f1 is None else self.f1.low,
            "f1_high": None if self.f1 is None else self.f1.high,
        }


def figures(scores: SetScores, index: int) -> dict[str, Any]:
    """Scores of one set as plain values."""
    counts = {name: int(getattr(scores, name)[index]) for name in ("tp", "fp", "fn")}
    ratios = {name: float(getattr(scores, name)[index]) for name in RATIOS}
    return {**ratios, **counts}


def outcomes_of(
    detector: Pipeline, captures: Sequence[Labelled], rules: ScoringRules, table: str = "filtering"
) -> list[Outcome]:
    """Outcome of each capture.

    Parameters
    ----------
    detector : Pipeline
    captures : sequence of Labelled
    rules : ScoringRules
    table : str
        Table of results, ``filtering`` or ``mapping``.

    Raises
    ------
    ScoringError
        If a capture cannot be scored as asked, or its truth is not exhaustive, so that F1 is undefined.
    """
    return [_judged(detector.run(one.capture), one, rules, table) for one in captures]


def _judged(found: Detections, one: Labelled, rules: ScoringRules, table: str) -> Outcome:
    tables = outcomes(found, one.capture.header, rules)
    if table not in tables:
        raise ScoringError(f"{one.text}: the detector maps nothing, so that there is no table '{table}'")
    if not tables[table].exhaustive:
        raise ScoringError(f"{one.text}: its truth is not exhaustive, so that precision and F1 are undefined")
    return tables[table]


def scores_of_sets(swept: Swept, one: Labelled, rules: ScoringRules) -> SetScores:
    """Scores of all sets of a sweep on one capture: together where each retains one detection a frame, else in turn.

    Parameters
    ----------
    swept : Swept
        Sweep over the peaks of the capture.
    one : Labelled
        The capture.
    rules : ScoringRules

    Raises
    ------
    ScoringError
        As :func:`outcomes_of`.
    """
    if swept.count == 1:
        return set_scores(swept, one.capture, rules)
    if rules.scoring == "peak":
        _ = swept.found.candidates  # found once, here, and then handed on to each set's detections
    sets = range(len(swept.sweep))
    return SetScores.stacked([scores_of(_judged(swept.detections(index), one, rules, "filtering")) for index in sets])


def result_of(found: Sequence[Outcome], scenes: Sequence[str], intervals: IntervalModel | None) -> Result:
    """Result over all outcomes together, with an interval where one is asked for.

    Parameters
    ----------
    found : sequence of Outcome
        One a capture.
    scenes : sequence of str
        Scene of each: captures of one scene repeat one another.
    intervals : IntervalModel or None
        How the interval of F1 is estimated; None for no interval.
    """
    estimate = None
    if intervals is not None:
        estimate = estimated(F1, found, scenes, confidence=intervals.confidence)
    frames = sum(len(outcome.tp) for outcome in found)
    return Result(len(found), frames, SetScores.merged([scores_of(outcome) for outcome in found]), estimate)


def scores_of(outcome: Outcome) -> SetScores:
    """Scores of one set on one capture."""
    error_m = np.abs(outcome.error_m[np.isfinite(outcome.error_m)])
    counts = [np.array([part.sum()]) for part in (outcome.tp, outcome.fp, outcome.fn)]
    sums = [np.array([error_m.sum()]), np.array([np.sum(error_m**2)])]
    return SetScores(counts[0], counts[1], counts[2], np.array([len(error_m)]), sums[0], sums[1])
