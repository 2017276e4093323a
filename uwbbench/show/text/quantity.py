"""What a metric is called on the page, in which unit it is shown, and what its samples are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from uwbbench.api.metric import Metric
from uwbbench.api.text import counted
from uwbbench.measure.accuracy.stats import Estimate
from uwbbench.show.text.numbers import interval, number


@dataclass(frozen=True)
class Quantity:
    """How a metric is shown.

    Attributes
    ----------
    name, title : str
    unit : str
        As people read it; empty for a share.
    digits : int
    factor : float
        From the metric's unit to the shown one.
    better : {"higher", "lower", "zero"}
    samples : str
        What ``n`` counts.
    """

    name: str
    title: str
    unit: str
    digits: int
    factor: float
    better: str
    samples: str

    @classmethod
    def of(cls, name: str, metric: type[Metric]) -> Quantity:
        """How a registered metric is shown."""
        unit, factor, digits = metric.scale()
        samples = "detections" if metric.merge == "stack" else "frames"
        samples = "runs" if metric.of.of_run else samples
        return cls(name, metric.title or name, unit, digits, factor, metric.better, samples)

    @classmethod
    def of_all(cls, metrics: Mapping[str, type[Metric]]) -> dict[str, Quantity]:
        """How each of some metrics is shown, by name."""
        return {name: cls.of(name, metric) for name, metric in metrics.items()}

    @property
    def axis(self) -> str:
        """Title of an axis."""
        return f"{self.title} ({self.unit})" if self.unit else self.title

    @property
    def evidence(self) -> str:
        """What is counted as one piece of evidence."""
        return "run" if self.samples == "runs" else "scene"

    def scaled(self, value: float) -> float:
        """Value in the shown unit."""
        return value * self.factor

    def text(self, value: float) -> str:
        """Value with unit."""
        return f"{number(value, self.digits, self.factor)} {self.unit}".strip()

    def value_of(self, estimate: Estimate) -> str:
        """Value with unit and interval."""
        text = interval(estimate.value, estimate.low, estimate.high, self.digits, self.factor)
        return f"{text} {self.unit}".strip()

    def in_full(self, estimate: Estimate) -> str:
        """Value with unit, interval and count, or why there is none."""
        if math.isnan(estimate.value):
            return "undefined"
        if self.evidence == "run":  # each is one sample, and one piece of evidence
            return f"{self.value_of(estimate)}, {counted(estimate.n, 'run')}"
        return f"{self.value_of(estimate)}, n = {estimate.n} {self.samples}, {_scenes(estimate)}"


def _scenes(estimate: Estimate) -> str:
    """How many scenes are behind an estimate, and what its interval says."""
    scenes = counted(estimate.groups, "scene")
    return f"{scenes}; interval within these recordings only" if estimate.within else scenes


def undefined_titles(metrics: Mapping[str, type[Metric]]) -> str:
    """Titles, as words of a sentence, of the metrics that are undefined where the truth is not exhaustive."""
    titles = [metric.title or name for name, metric in metrics.items() if metric.needs_exhaustive_truth]
    return " and ".join(part for part in (", ".join(titles[:-1]), *titles[-1:]) if part)
