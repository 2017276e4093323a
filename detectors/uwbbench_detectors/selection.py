"""Which of the detections of a frame are retained."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import Block, BoolArray, Filter, FloatArray, IntArray, Params, ports


class SelectionParams(Params):
    """How many detections are retained."""

    count: int = Field(
        1,
        ge=1,
        description="Detections retained in each frame. The paper keeps one for its ranges, although its figures "
        "count several a frame; scenes with several objects need more.",
    )


def _first_of_each_frame(frame: IntArray, count: int, *keys: FloatArray) -> BoolArray:
    """Mask of the ``count`` detections of each frame that come first by ``keys``, the most important one first.

    Detections whose first key is NaN cannot be ranked and are not retained.
    """
    order = np.lexsort((*reversed(keys), frame))
    ordered = frame[order]
    place = np.arange(len(order)) - np.searchsorted(ordered, ordered)
    retained = np.empty(len(order), bool)
    retained[order] = place < count
    return retained & ~np.isnan(keys[0])


class Strongest(Filter[SelectionParams]):
    """Retain the detections of largest amplitude in each frame, the earlier one of equals.

    Stands behind the filters, as in arXiv 2512.01018: the strongest of what they left.
    """

    consumes: ClassVar[frozenset[str]] = ports("detections", "amplitude", "tap")
    fidelity = "from-source"

    def keep(self, block: Block) -> BoolArray:
        """Mask of the retained detections."""
        found = block.detections
        return _first_of_each_frame(found.frame, self.params.count, -found["amplitude"], found["tap"])


class Nearest(Filter[SelectionParams]):
    """Retain the detections of shortest delay in each frame."""

    consumes: ClassVar[frozenset[str]] = ports("detections", "tap")

    def keep(self, block: Block) -> BoolArray:
        """Mask of the retained detections."""
        return _first_of_each_frame(block.detections.frame, self.params.count, block.detections["tap"])


class AllParams(Params):
    """Nothing to set."""


class All(Filter[AllParams]):
    """Retain every detection."""

    consumes: ClassVar[frozenset[str]] = ports("detections")

    def keep(self, block: Block) -> BoolArray:
        """Mask that keeps all."""
        return np.ones(len(block.detections), bool)
