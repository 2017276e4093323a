"""How well segments cover what is there: metrics of the scoring ``segment``.

Conventions
-----------
* Made of a :class:`~uwbbench.api.outcomes.SegmentOutcome`; :mod:`uwbbench.measure.accuracy.judges.segments` says what
  is near, and what covers what. Precision, recall, F1 and errors are those of every scoring.
* Where the truth is not exhaustive a segment over nothing proves nothing: such a capture adds nothing.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.metric import Kind, Metric, Outcome
from uwbbench.api.outcomes import SegmentOutcome


class SegmentOverlap(Metric):
    """Length that segments and obstacles have in common, over the length that either covers (intersection over union).

    Lengths of all frames are added up first. An obstacle takes up its range and a gate to either side.

    Examples
    --------
    >>> SegmentOverlap.value(np.array([0.2, 0.8])), SegmentOverlap.value(np.zeros(2))
    (0.25, nan)
    """

    of: ClassVar[type[Outcome]] = SegmentOutcome
    title: ClassVar[str] = "overlap"
    kind: ClassVar[Kind] = "share"
    needs_exhaustive_truth: ClassVar[bool] = True
    default: ClassVar[bool] = True
    order: ClassVar[int] = 32

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Length in common, and length covered."""
        if not isinstance(outcome, SegmentOutcome):
            raise TypeError(f"a metric of segments takes a SegmentOutcome, not {type(outcome).__name__}")
        if not outcome.exhaustive:
            return np.zeros(2)
        return np.array([outcome.shared_m.sum(), outcome.covered_m.sum()], float)

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Ratio of the two."""
        shared_m, covered_m = partial.tolist()
        return float(shared_m / covered_m) if covered_m > 0 else math.nan

    @classmethod
    def parts(cls, partial: FloatArray) -> tuple[float, float]:
        """Length in common among the length covered."""
        shared_m, covered_m = partial.tolist()
        return shared_m, covered_m


SEGMENT_METRICS: dict[str, type[Metric]] = {"segment_overlap": SegmentOverlap}
"""By registered name: what scores of segments hold besides those of every scoring."""
