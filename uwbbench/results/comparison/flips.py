"""Frames whose outcome differs between two runs.

Conventions
-----------
* The outcome of a frame is its number of true positives (TP), false positives (FP) and misses (FN); ``none`` where it
  has none of them. Frames that both runs scored are compared.
* A flip is worse the more true positives less false positives less misses it loses; among equals, the more its largest
  error grows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uwbbench.api.arrays import FloatArray, IntArray
from uwbbench.api.errors import ScoringError
from uwbbench.api.metric import Outcome
from uwbbench.measure.accuracy.judge import judge
from uwbbench.measure.accuracy.rules import outcome_of
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.scoring import ScoringRules
from uwbbench.results.comparison.units import Unit


@dataclass(frozen=True)
class Flip:
    """One frame that has another outcome.

    Attributes
    ----------
    unit : Unit
    frame : int
    time_s : float
        Since the first frame.
    before, after : str
    loss : int
        True positives less false positives less misses, before minus after: positive is worse.
    error_before_m, error_after_m : float
        Largest absolute error in the frame; NaN where nothing was retained.
    """

    unit: Unit
    frame: int
    time_s: float
    before: str
    after: str
    loss: int
    error_before_m: float
    error_after_m: float

    @property
    def _badness(self) -> tuple[float, ...]:
        grown = np.nan_to_num(self.error_after_m) - np.nan_to_num(self.error_before_m)
        return -self.loss, -float(grown), self.frame


def flips(
    units: Sequence[Unit], rule: ScoringRules, most: int
) -> tuple[dict[str, Counter[tuple[str, str]]], int, list[Flip]]:
    """Frames that flipped, after filtering.

    Parameters
    ----------
    units : sequence of Unit
    rule : ScoringRules
    most : int
        Flips that are listed.

    Returns
    -------
    counts : dict of str to Counter
        By detector: how many frames went from which outcome to which.
    compared : int
        Frames of all units that both runs scored.
    worst : list of Flip
        The worst first.
    """
    counts: dict[str, Counter[tuple[str, str]]] = {}
    if outcome_of(rule.scoring).of_run:  # which has no outcome of single frames
        return counts, 0, []
    compared, worst = 0, list[Flip]()
    for unit in units:
        try:
            tables = [_frames(unit, side, rule) for side in (0, 1)]
        except ScoringError:  # score_changes reports it
            continue
        index, rows = np.intersect1d(tables[0][0], tables[1][0]), []
        for scored, outcome, _ in tables:
            at = np.searchsorted(scored, index)
            rows.append(np.stack([outcome.tp[at], outcome.fp[at], outcome.fn[at]], axis=1))
        compared += len(index)
        changed = np.flatnonzero((rows[0] != rows[1]).any(axis=1))
        kinds = Counter(map(tuple, np.concatenate([rows[0][changed], rows[1][changed]], axis=1).tolist()))
        into = counts.setdefault(unit.detector, Counter())
        for (*before, a, b, c), count in kinds.items():
            into[_name(before), _name([a, b, c])] += count
        worst = _worst(unit, index[changed], rows[0][changed], rows[1][changed], [t[2] for t in tables], most, worst)
    return counts, compared, worst


def _frames(unit: Unit, side: int, rule: ScoringRules) -> tuple[IntArray, Outcome, FloatArray]:
    """Scored frames, their outcome, and the largest absolute error (frames of the capture,) of each frame."""
    scene = Scene.of(unit.detections[side], unit.header)
    outcome = judge(unit.detections[side], scene, rule.of(unit.dataset), "filtering").outcome
    scored = np.flatnonzero(scene.scored).astype(np.int64)
    error_m = np.full(len(unit.header), np.nan)
    np.fmax.at(error_m, scored[outcome.error_frame], np.abs(outcome.error_m))
    return scored, outcome, error_m


def _worst(
    unit: Unit,
    frames: IntArray,
    before: IntArray,
    after: IntArray,
    errors_m: Sequence[FloatArray],
    most: int,
    known: list[Flip],
) -> list[Flip]:
    """The worst of the known flips and of one unit's."""
    value = np.array([1, -1, -1])
    loss = before @ value - after @ value
    grown = np.nan_to_num(errors_m[1][frames]) - np.nan_to_num(errors_m[0][frames])
    since_s = unit.header.trajectory.timestamp_s - unit.header.trajectory.timestamp_s[:1]
    new = [
        Flip(
            unit=unit,
            frame=int(frames[row]),
            time_s=float(since_s[frames[row]]),
            before=_name(before[row].tolist()),
            after=_name(after[row].tolist()),
            loss=int(loss[row]),
            error_before_m=float(errors_m[0][frames[row]]),
            error_after_m=float(errors_m[1][frames[row]]),
        )
        for row in np.lexsort((frames, -grown, -loss))[:most].tolist()
    ]
    return sorted([*known, *new], key=lambda flip: flip._badness)[:most]


def _name(counts: Sequence[int]) -> str:
    """Outcome of a frame in words.

    Examples
    --------
    >>> _name([1, 0, 0]), _name([1, 2, 0]), _name([0, 0, 0])
    ('TP', 'TP + 2 FP', 'none')
    """
    parts = [
        name if count == 1 else f"{count} {name}"
        for name, count in zip(("TP", "FP", "FN"), counts, strict=True)
        if count
    ]
    return " + ".join(parts) or "none"
