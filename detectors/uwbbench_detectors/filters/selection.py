"""Which of the detections of a frame are retained."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import Block, BoolArray, Detections, Filter, FloatArray, Params, Radar, RankFilter, RankParams, ports


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


LEAST_SHARE = 0.1
"""Share of the frames that must hold a detection where something moves."""


class FirstAboveParams(Params):
    """How strong the nearest detection must be."""

    fraction: float = Field(
        0.3,
        gt=0,
        le=1,
        description="Least energy (amplitude squared) as a share of the largest of the frame's detections.",
    )


class FirstAbove(Filter[FirstAboveParams]):
    """Retain the nearest detection of each frame among those not much weaker than its strongest.

    What moves casts echoes by way of walls behind its own, at times stronger ones; nearer ones it casts none. Only
    detections compare: put filters of range and noise before it.

    Detectors of walking persons take the strongest cell behind low-rank clutter removal (after Sabushimike et al.,
    Sensors 16(9):1409, 2016); that the nearest strong one is meant, and how strong, is a choice made here.
    """

    consumes: ClassVar[frozenset[str]] = ports("detections", "amplitude", "tap")
    rowwise: ClassVar[bool] = False
    fidelity = "reconstruction"

    def open(self, radar: Radar) -> None:
        """Start counting."""
        super().open(radar)
        self._valid = self._filled = 0

    def flush(self) -> None:
        """Say so if there was next to nothing to select from."""
        if self._filled < LEAST_SHARE * self._valid:
            self.note(
                f"select.first_above: detections in only {self._filled} of {self._valid} frames; behind a removal of "
                "clutter nothing is left of what stands still"
            )

    def keep(self, block: Block) -> BoolArray:
        """Mask of one detection a frame."""
        found = block.detections
        frames, place = np.unique(found.frame, return_inverse=True)
        self._valid += int(np.count_nonzero(block.frames.valid))
        self._filled += len(frames)
        amplitude = found["amplitude"]
        largest = np.full(len(frames), -np.inf)
        np.fmax.at(largest, place, amplitude)
        strong = amplitude >= np.sqrt(self.params.fraction) * largest[place]
        strong &= ~np.isnan(found["tap"])
        rows = np.flatnonzero(strong)
        rows = rows[np.lexsort((found["tap"][rows], place[rows]))]
        first = np.ones(len(rows), bool)
        first[1:] = np.diff(place[rows]) > 0
        kept = np.zeros(len(found), bool)
        kept[rows[first]] = True
        return kept


class AllParams(Params):
    """Nothing to set."""


class All(Filter[AllParams]):
    """Retain every detection."""

    consumes: ClassVar[frozenset[str]] = ports("detections")

    def keep(self, block: Block) -> BoolArray:
        """Mask that keeps all."""
        return np.ones(len(block.detections), bool)
