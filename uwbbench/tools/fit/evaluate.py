"""What a detector gives on the draws of a cell, and how far that is from the targets."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from uwbbench.api import registry
from uwbbench.api.errors import ConfigError, nearest
from uwbbench.api.metric import Outcome
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.accuracy.counts import reach_of_mean
from uwbbench.measure.accuracy.scoring import outcomes
from uwbbench.measure.accuracy.stats import evaluate
from uwbbench.results.chains import IN_CLUSTERS, in_clusters
from uwbbench.tools.fit.config import CHAIN, Cell, Target
from uwbbench.tools.fit.files import Files, open_cell

FARTHEST = 10.0
"""Distance in tolerances that a figure has which is undefined, and at which others stop to grow."""


@dataclass(frozen=True)
class Found:
    """What a detector gave on some draws of a cell.

    Attributes
    ----------
    outcomes : dict of str to list of Outcome
        One a draw, by table.
    counts : list of dict
        Detections left behind each step, of each draw.
    """

    outcomes: dict[str, list[Outcome]] = field(default_factory=dict)
    counts: list[dict[str, int]] = field(default_factory=list)

    def value(self, target: Target) -> float:
        """Figure that a target is about, of all draws together; of counts their mean. NaN where it is undefined."""
        if target.table == CHAIN:
            return float(np.mean(self._counts(target)))
        return evaluate(registry.load_plugin("metrics", target.metric), self.outcomes.get(target.table, []))

    def per_draw(self, target: Target) -> list[float]:
        """The same of each draw alone."""
        if target.table == CHAIN:
            return self._counts(target)
        metric = registry.load_plugin("metrics", target.metric)
        return [evaluate(metric, [outcome]) for outcome in self.outcomes.get(target.table, [])]

    def ends(self, target: Target) -> tuple[float, float]:
        """Student's interval of 95 % about the figure, over draws, which are drawn alike; NaN where there is none."""
        value, reach = self.value(target), reach_of_mean(self.per_draw(target))
        return value - reach, value + reach

    def _counts(self, target: Target) -> list[float]:
        return [float(counts.get(target.metric, 0)) for counts in self.counts]


def run_cell(files: Files, cell: Cell, seeds: Sequence[int], runs: int) -> Found:
    """Simulate a cell's draws, detect on them and score.

    Parameters
    ----------
    files : mapping of str to Path
    cell : Cell
    seeds : sequence of int
    runs : int
        Runs of each seed.

    Raises
    ------
    ConfigError
        If the scene is wrong, or has no such receiver.
    ScoringError
        If a capture cannot be scored as asked.
    """
    pipeline = Pipeline(cell.detector)
    found = Found()
    for seed in seeds:
        dataset: Any = open_cell(files, cell, seed, runs)
        for run in dataset.runs():
            capture = _of_receiver(dataset.simulate(run).captures, cell)
            detections = pipeline.run(capture, candidates=True)
            for table, outcome in outcomes(detections, capture.header, cell.rules).items():
                found.outcomes.setdefault(table, []).append(outcome)
            found.counts.append({**detections.chain, IN_CLUSTERS: in_clusters(detections) or 0})
    return found


def _of_receiver(captures: Sequence[Any], cell: Cell) -> Any:
    """Capture of a cell's receiver."""
    names = [capture.radar.receiver for capture in captures]
    if cell.receiver is None and len(names) == 1:
        return captures[0]
    if cell.receiver is None:
        raise ConfigError(f"cell '{cell.name}': its scene has several receivers: {', '.join(names)}; name one")
    if cell.receiver not in names:
        raise ConfigError(f"cell '{cell.name}': no receiver '{cell.receiver}'.{nearest(cell.receiver, names)}")
    return captures[names.index(cell.receiver)]


@dataclass(frozen=True)
class Residual:
    """One target beside what the calibrated scene gives.

    Attributes
    ----------
    target : Target
    value : float
        Of all draws together; NaN where it is undefined.
    low, high : float
        Interval over draws.
    draws : tuple of float
        Value of each draw.
    """

    target: Target
    value: float
    low: float
    high: float
    draws: tuple[float, ...]

    @property
    def distance(self) -> float:
        """How far off it is, in tolerances."""
        return distance(self.target, self.value)

    @property
    def reached(self) -> bool:
        """Whether it is within its tolerance."""
        return self.distance <= 1


def residual(target: Target, found: Found) -> Residual:
    """Target beside what was found on some draws."""
    return Residual(target, found.value(target), *found.ends(target), tuple(found.per_draw(target)))


def distance(target: Target, value: float) -> float:
    """Distance of a figure from its target in tolerances, from 0 to :data:`FARTHEST`.

    Parameters
    ----------
    target : Target
    value : float
        NaN, which is no figure at all, is as far as can be.
    """
    kind = target.tolerance
    if math.isnan(value):
        return FARTHEST
    if kind.absolute is not None:
        off = abs(value - target.value) / kind.absolute
    elif kind.relative is not None:
        off = abs(value - target.value) / (kind.relative * target.value)
    else:
        assert kind.factor is not None  # noqa: S101 - the model has one of the three
        off = abs(math.log(value / target.value)) / math.log(kind.factor) if value > 0 else FARTHEST
    return min(off, FARTHEST)


def cost(target: Target, value: float) -> float:
    """What a figure adds to the cost of a trial: Huber's loss of its distance, times its weight.

    Inside the tolerance it grows with the square, outside evenly, so that a target that is out of reach does not pull
    the others out of theirs (Huber, Annals of Mathematical Statistics 35, 1964).
    """
    off = distance(target, value)
    return target.tolerance.weight * (off**2 if off <= 1 else 2 * off - 1)
