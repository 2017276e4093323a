"""Which of the detections of a frame are retained."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import Block, BoolArray, Detections, Filter, FloatArray, Params, RankFilter, RankParams, ports


class SelectionParams(RankParams):
    """How many detections are retained."""

    count: int = Field(
        1,
        ge=1,
        description="Detections retained in each frame. The paper keeps one for its ranges, although its figures "
        "count several a frame; scenes with several objects need more.",
    )


class Strongest(RankFilter[SelectionParams]):
    """Retain the detections of largest amplitude in each frame, the earlier one of equals.

    Stands behind the filters, as in arXiv 2512.01018: the strongest of what they left.
    """

    consumes: ClassVar[frozenset[str]] = ports("detections", "amplitude", "tap")
    fidelity = "from-source"

    def rank(self, detections: Detections) -> tuple[FloatArray, ...]:
        """Falling amplitude, then the tap."""
        return -detections["amplitude"], detections["tap"]


class Nearest(RankFilter[SelectionParams]):
    """Retain the detections of shortest delay in each frame."""

    consumes: ClassVar[frozenset[str]] = ports("detections", "tap")

    def rank(self, detections: Detections) -> tuple[FloatArray, ...]:
        """The tap."""
        return (detections["tap"],)


class AllParams(Params):
    """Nothing to set."""


class All(Filter[AllParams]):
    """Retain every detection."""

    consumes: ClassVar[frozenset[str]] = ports("detections")

    def keep(self, block: Block) -> BoolArray:
        """Mask that keeps all."""
        return np.ones(len(block.detections), bool)
