"""A number of each run; of several runs, the mean of theirs.

A run is one piece of evidence, however long it is: its errors have one drift behind them.
"""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray
from uwbbench.api.metric import Kind, Metric, Outcome


class RunMetric(Metric):
    """A number of each run; runs in which it is undefined add nothing."""

    merge: ClassVar[Literal["sum", "stack"]] = "stack"
    better: ClassVar[Literal["higher", "lower", "zero"]] = "lower"
    kind: ClassVar[Kind] = "ratio"
    default: ClassVar[bool] = True
    brief: ClassVar[bool] = False

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Number of one run; NaN where it is undefined."""
        raise NotImplementedError

    @classmethod
    def partial(cls, outcome: Outcome) -> FloatArray:
        """Number of the run (1,), or none (0,)."""
        number = cls.number(outcome) if len(outcome.group) else math.nan
        return np.array([number]) if math.isfinite(number) else np.zeros(0)

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Mean over runs."""
        return float(np.mean(partial)) if len(partial) else math.nan

    @classmethod
    def parts(cls, partial: FloatArray) -> tuple[float, float]:
        """Sum of the numbers, and runs."""
        return float(partial.sum()), float(len(partial))


def root_mean_square(values: FloatArray) -> float:
    """Root of the mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else math.nan


def mean(values: FloatArray | BoolArray) -> float:
    """Mean; NaN of nothing."""
    return float(np.mean(values)) if len(values) else math.nan
