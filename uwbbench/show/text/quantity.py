"""What a metric is called on the page, in which unit it is shown, and what its samples are."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uwbbench.api.metric import Metric
from uwbbench.measure.accuracy.stats import Estimate
from uwbbench.show.text.numbers import interval
from uwbbench.show.text.wording import TITLES, scale


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
        unit, digits, factor = scale(metric.unit)
        samples = "detections" if metric.merge == "stack" else "frames"
        return cls(name, TITLES.get(name, name), unit.strip(" ()"), digits, factor, metric.better, samples)

    @property
    def axis(self) -> str:
        """Title of an axis."""
        return f"{self.title} ({self.unit})" if self.unit else self.title

    def scaled(self, value: float) -> float:
        """Value in the shown unit."""
        return value * self.factor

    def value_of(self, estimate: Estimate) -> str:
        """Value with unit and interval."""
        text = interval(estimate.value, estimate.low, estimate.high, self.digits, self.factor)
        return f"{text} {self.unit}".strip()

    def told(self, estimate: Estimate) -> str:
        """Value with unit, interval and count, or why there is none."""
        if math.isnan(estimate.value):
            return "undefined"
        return f"{self.value_of(estimate)}, n = {estimate.n} {self.samples}, {estimate.groups} groups"
