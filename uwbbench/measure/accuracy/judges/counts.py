"""What judges of rows count alike once each row is true, stray or set aside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.detections import Detections
from uwbbench.api.metric import Outcome
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.verdict import Verdict


@dataclass(frozen=True)
class Counts:
    """Rows of a capture, and what each was found to be.

    Attributes
    ----------
    scene : Scene
    kept : Detections
        Those that are judged.
    visible : (frames, objects) bool array
    matched, wall, duplicate : (n,) bool array
        True rows, those set aside as structure, and those on an object that another row has.
    found : (frames, objects) bool array
    """

    scene: Scene
    kept: Detections
    visible: BoolArray
    matched: BoolArray
    wall: BoolArray
    duplicate: BoolArray
    found: BoolArray

    @property
    def stray(self) -> BoolArray:
        """Rows (n,) that are neither true nor set aside."""
        return ~self.matched & ~self.wall

    @property
    def index(self) -> IntArray:
        """Scored frames."""
        return np.flatnonzero(self.scene.scored)

    @property
    def there(self) -> IntArray:
        """Visible obstacles (frames,)."""
        return np.asarray(self.visible.sum(axis=1))

    @property
    def retained(self) -> IntArray:
        """Rows (frames,) of each frame."""
        return self.of(np.ones(len(self.kept), bool))

    def of(self, rows: BoolArray) -> IntArray:
        """How many of some rows (n,) each frame (frames,) has."""
        return np.bincount(self.kept.frame[rows], minlength=len(self.scene.header)).astype(np.int64)

    def facts(self, fn: IntArray, error_m: FloatArray) -> dict[str, Any]:
        """What every outcome holds.

        Parameters
        ----------
        fn : (frames,) int array
        error_m : (n,) array
        """
        index, exhaustive = self.index, self.scene.truth.exhaustive
        return {
            "group": self.scene.group()[index],
            "tp": self.of(self.matched)[index],
            "fp": self.of(self.stray)[index] if exhaustive else np.zeros(len(index), np.int64),
            "fn": fn[index],
            "error_frame": np.searchsorted(index, self.kept.frame),
            "error_m": error_m,
            "matched": self.matched,
            "duration_s": len(index) / self.scene.header.radar.frame_rate_hz,
            "exhaustive": exhaustive,
        }

    def verdict(self, outcome: Outcome, chance_recall: float) -> Verdict:
        """Outcome with what is counted beside it."""
        return Verdict(
            outcome=outcome,
            true_empty=int(np.sum((self.there + self.retained)[self.index] == 0)),
            duplicates=int(self.duplicate.sum()),
            structure=int(self.wall.sum()),
            unmatched=0 if self.scene.truth.exhaustive else int(self.stray.sum()),
            chance_recall=chance_recall,
            retained=self.kept,
            stray=self.stray,
            found=self.found,
        )
