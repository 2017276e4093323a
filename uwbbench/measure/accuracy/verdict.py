"""What a judge says of one table of detections on one capture."""

from __future__ import annotations

from dataclasses import dataclass

from uwbbench.api.arrays import BoolArray
from uwbbench.api.detections import Detections
from uwbbench.api.metric import Outcome


@dataclass(frozen=True)
class Verdict:
    """Outcome of one table, and what is counted beside it.

    Attributes
    ----------
    outcome : Outcome
    true_empty, duplicates, structure, unmatched : int
    chance_recall : float
    retained : Detections
        Those that were judged, in the order of ``outcome.error_m``.
    stray : (retained,) bool array
        Those that are neither true nor set aside as structure.
    found : (frames, objects) bool array
        Visible obstacles that a true detection belongs to; in ``frame`` and ``peak`` all within its gate.
    """

    outcome: Outcome
    true_empty: int
    duplicates: int
    structure: int
    unmatched: int
    chance_recall: float
    retained: Detections
    stray: BoolArray
    found: BoolArray
