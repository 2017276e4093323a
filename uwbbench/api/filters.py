"""Filters that declare their rule, so that it can also be evaluated for many thresholds at once.

A filter need not be one of these: any :class:`~uwbbench.api.stage.Filter` says with ``keep`` what it keeps. One that
only compares columns with parameters, or retains the first few of each frame, declares that and gets ``keep`` for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal, TypeVar

import numpy as np
from pydantic import Field

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.block import Block
from uwbbench.api.detections import Detections
from uwbbench.api.stage import Filter, P, Params


@dataclass(frozen=True)
class Limit:
    """What a parameter limits.

    Attributes
    ----------
    column : str
        Column of the detections.
    side : {"least", "most"}
        Whether the parameter is the least or the largest value that passes; both inclusive.
    magnitude : bool
        Compare the magnitude of the values.
    """

    column: str
    side: Literal["least", "most"]
    magnitude: bool = False

    def measure(self, detections: Detections) -> FloatArray:
        """Values (n,) that are compared: a larger one never passes less; NaN never passes."""
        values = np.abs(detections[self.column]) if self.magnitude else detections[self.column]
        return np.asarray(values if self.side == "least" else -values)

    def bound(self, threshold: float | None) -> float:
        """Least :meth:`measure` that passes a threshold; None sets no limit."""
        if threshold is None:
            return -np.inf
        return threshold if self.side == "least" else -threshold


class LimitFilter(Filter[P]):
    """Keeps the detections whose columns lie inside limits, and none whose column is NaN.

    Class attributes
    ----------------
    limits : mapping of str to Limit
        What each parameter limits; a parameter that is None sets no limit.
    """

    limits: ClassVar[Mapping[str, Limit]] = {}

    def keep(self, block: Block) -> BoolArray:
        """Mask of the detections inside all limits."""
        keep = np.ones(len(block.detections), bool)
        for name, limit in self.limits.items():
            keep &= limit.measure(block.detections) >= limit.bound(getattr(self.params, name))
        return keep


class RankParams(Params):
    """How many detections are retained."""

    count: int = Field(1, ge=1, description="Detections retained in each frame.")


R = TypeVar("R", bound=RankParams)


class RankFilter(Filter[R]):
    """Retains the first few detections of each frame, in an order of its own."""

    def rank(self, detections: Detections) -> tuple[FloatArray, ...]:
        """Sort keys (n,) of the detections, the most important one first, each rising.

        Detections whose first key is NaN cannot be ranked and are not retained.
        """
        raise NotImplementedError

    def keep(self, block: Block) -> BoolArray:
        """Mask of the retained detections."""
        keys, frame = self.rank(block.detections), block.detections.frame
        order = ranked(frame, keys)
        ordered = frame[order]
        place = np.arange(len(order)) - np.searchsorted(ordered, ordered)
        retained = np.empty(len(order), bool)
        retained[order] = place < self.params.count
        return retained & ~np.isnan(keys[0])


def ranked(frame: IntArray, keys: tuple[FloatArray, ...]) -> IntArray:
    """Rows (n,) by frame, those of a frame by rank; equals stay in their order."""
    return np.lexsort((*reversed(keys), frame))
