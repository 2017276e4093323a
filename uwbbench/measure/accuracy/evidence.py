"""What detectors add to a metric, scene by scene, and the interval that the metric has by its kind."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.metric import Metric, Outcome
from uwbbench.measure.accuracy import intervals
from uwbbench.measure.accuracy.boards import RANKED_UNITS
from uwbbench.measure.accuracy.groups import BLOCKS, blocks_of
from uwbbench.measure.accuracy.intervals import INNER_UNITS, Blocks, Interval

WITHIN_SCENES = 3
"""Up to so many scenes, the interval is that of blocks of their captures."""

LEAST_RUNS = 10
"""Fewer runs have no interval, and rank nobody, where each run is one piece of evidence."""

SHORTEST_S = 30.0
"""Captures that last less together are not cut into blocks, as these would be too much alike."""

LEFT_OUT_PARTS = 40
"""A metric without a form of its own is evaluated anew without each of at most so many parts of the scenes."""


def least_units(metric: type[Metric]) -> int:
    """Fewest units of evidence, scenes or runs, that rank detectors by a metric."""
    return LEAST_RUNS if metric.of.of_run else RANKED_UNITS


def unit_of(metric: type[Metric]) -> str:
    """What people call one piece of evidence of a metric."""
    return "run" if metric.of.of_run else "scene"


def merge(metric: type[Metric], partials: Sequence[FloatArray]) -> FloatArray:
    """One partial from several, in the way that the metric merges."""
    return np.sum(partials, axis=0) if metric.merge == "sum" else np.concatenate(partials)


@dataclass(frozen=True)
class Evidence:
    """What several detectors add to a metric, scene by scene.

    Attributes
    ----------
    units : list of lists of array
        For each detector, the partial of each scene on which any of them was scored.
    blocks : list of lists of array
        For each detector, the partials of four blocks of each capture, where scenes are one to three and their captures
        long enough; else none.
    recordings : Blocks or None
        What ``blocks`` are blocks of.
    """

    units: list[list[FloatArray]]
    blocks: list[list[FloatArray]]
    recordings: Blocks | None

    @classmethod
    def of(cls, metric: type[Metric], series: Sequence[Sequence[Outcome]], scenes: Sequence[Hashable] = ()) -> Evidence:
        """Evidence of some outcomes.

        Parameters
        ----------
        metric : type of Metric
        series : sequence of sequences of Outcome
            One for each detector, and in it one for each capture, the captures in the same order.
        scenes : sequence
            What each capture is of; empty: each is of a scene of its own. A run is always one of its own.
        """
        captures = list(zip(*series, strict=True))
        names: Sequence[Hashable] = range(len(captures)) if metric.of.of_run or not scenes else scenes
        members: dict[Hashable, list[int]] = {}
        for place, (name, capture) in enumerate(zip(names, captures, strict=True)):
            if any(len(outcome.group) for outcome in capture):
                members.setdefault(name, []).append(place)
        partials = [[metric.partial(outcome) for outcome in outcomes] for outcomes in series]
        units = [[merge(metric, [parts[at] for at in places]) for places in members.values()] for parts in partials]
        chosen = [captures[at] for places in members.values() for at in places]
        lengths_s = [max(outcome.duration_s for outcome in capture) for capture in chosen]
        long_enough = sum(lengths_s) >= SHORTEST_S * (1 - 1e-9)
        cut = [blocks_of(capture) for capture in chosen] if long_enough and len(members) <= WITHIN_SCENES else []
        if not cut or not all(cut):
            return cls(units, [], None)
        blocks = [[metric.partial(block) for parts in cut for block in parts[at]] for at in range(len(series))]
        return cls(units, blocks, Blocks(len(chosen), min(lengths_s) / BLOCKS))

    def values(self, metric: type[Metric]) -> list[float]:
        """Value of each detector on all scenes together; NaN where there are none."""
        return [metric.value(merge(metric, parts)) if parts else math.nan for parts in self.units]


def interval_of(
    metric: type[Metric], parts: Sequence[FloatArray], value: float, confidence: float, within: Blocks | None = None
) -> Interval:
    """Interval of a metric, by what kind of number it is.

    Parameters
    ----------
    metric : type of Metric
    parts : sequence of array
        Partial of each unit.
    value : float
        Of all of them merged.
    confidence : float
    within : Blocks, optional
        What the units are blocks of; left out: they are scenes.
    """
    if math.isnan(value):
        return Interval(*np.full(5, np.nan))
    if metric.of.of_run:
        return _of_runs(metric, parts, value, confidence)
    if metric.kind == "quantile":
        return intervals.quantile([np.abs(part) for part in parts], metric.level, confidence=confidence, blocks=within)
    if metric.kind in ("positive", "other"):
        left, weight = left_out(metric, parts, within)
        scale: intervals.Scale = "log" if metric.kind == "positive" else "plain"
        return intervals.of_left_out(
            value, left, weight, scale=scale, enough=len(parts) >= INNER_UNITS, confidence=confidence, blocks=within
        )
    num, den = np.array([metric.parts(part) for part in parts]).T
    if metric.kind == "share":
        return intervals.share(num, den, confidence=confidence, blocks=within)
    most = metric.most(merge(metric, parts))
    return (intervals.ratio if metric.kind == "ratio" else intervals.mean)(
        num, den, most=most, confidence=confidence, blocks=within
    )


def runs_behind(metric: type[Metric], parts: Sequence[FloatArray]) -> int:
    """Runs in which a metric of runs is defined.

    Parameters
    ----------
    metric : type of Metric
    parts : sequence of array
        Partial of each run.
    """
    return sum(metric.parts(part)[1] > 0 for part in parts)


_SCALES: Mapping[str, intervals.Scale] = {"share": "logit", "ratio": "log", "positive": "log"}


def _of_runs(metric: type[Metric], parts: Sequence[FloatArray], value: float, confidence: float) -> Interval:
    """Interval of a mean over runs: Student's, on the scale of the metric; none where all runs say the same.

    Runs of one scene that differ in their random numbers are drawn alike, which scenes are not.
    """
    nothing = Interval(np.asarray(value), *np.full(4, np.nan))
    if runs_behind(metric, parts) < LEAST_RUNS:
        return nothing
    if metric.kind == "quantile":
        return intervals.quantile([np.abs(part) for part in parts], metric.level, confidence=confidence)
    left, weight = left_out(metric, parts, None)
    if np.nanmax(left) - np.nanmin(left) <= 1e-12 * abs(value):
        return nothing
    scale = _SCALES.get(metric.kind, "plain")
    return intervals.of_left_out(value, left, weight, scale=scale, enough=True, confidence=confidence)


def left_out(metric: type[Metric], parts: Sequence[FloatArray], within: Blocks | None) -> tuple[FloatArray, FloatArray]:
    """Value (units,) without each unit, and what each unit weighs; of a metric without a form of its own, by parts.

    Parameters
    ----------
    metric : type of Metric
    parts : sequence of array
        Partial of each unit.
    within : Blocks or None
        What the units are blocks of; None: they are scenes.
    """
    if metric.kind in ("share", "ratio", "mean") and parts:
        num, den = np.array([metric.parts(part) for part in parts]).T
        return intervals.delete_one(num, den), den
    if within is None and len(parts) > LEFT_OUT_PARTS:
        parts = [merge(metric, parts[at::LEFT_OUT_PARTS]) for at in range(LEFT_OUT_PARTS)]
    without = [[part for place, part in enumerate(parts) if place != at] for at in range(len(parts))]
    left = [metric.value(merge(metric, rest)) if rest else math.nan for rest in without]
    return np.array(left, float), np.array([_weight(metric, part) for part in parts], float)


def _weight(metric: type[Metric], part: FloatArray) -> float:
    """What a unit weighs: its samples; each the same where a metric counts."""
    return float(len(part)) if metric.merge == "stack" else 1.0
