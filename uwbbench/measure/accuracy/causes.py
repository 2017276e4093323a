"""Where errors come from: a cause for every miss, and a kind for every false detection.

Conventions
-----------
* Causes add up to the misses of a scoring, kinds to its false detections: each error has exactly one, the first of the
  lists below that holds. *Near* is within the gate by the table's error, in range or in position.
* A miss of ``object`` and ``track`` is an obstacle in a frame; one of ``frame`` and ``peak`` is a frame, and of its
  visible obstacles the one counts whose echo came furthest through the detector, by the lists below.
* Causes of a miss:

  1. ``shared``: a detection is near, but belongs to another obstacle.
  2. ``not the strongest``: one is near, but the scoring looks at stronger ones of that frame alone.
  3. ``not in a cluster``: one is near, but in no cluster (mapping only); ``not in a track``: one is near, or a
     candidate that passed all filters, but no confirmed track (``track`` only).
  4. ``lost behind the filters``: a candidate that passed all filters is near, but did not come out.
  5. ``dropped by STEP``: candidates are near, and this filter dropped the one that came furthest.
  6. ``outside the window``: no candidate is near, and the echo comes after the last tap.
  7. ``masked by the direct path``: none is near, and the echo comes within the pulse of the direct path.
  8. ``no candidate``: none is near.

  ``not known`` stands for 4 to 8 where the candidates, the peaks before the filters, are not known.
* An obstacle that is occluded or outside the region is no miss under any scoring; such are counted beside.
* Kinds of a false detection:

  1. ``duplicate``: a visible obstacle is near, to which another detection belongs (``object`` and ``track``).
  2. ``out of view``: an obstacle is near that is occluded, or outside the region.
  3. ``structure``: a wall or the like is near. ``object`` and ``track`` set these aside, so there are none.
  4. ``direct path or ringing``: it comes within the pulse of the direct path, or the ringing after it.
  5. ``within twice the gate`` of a visible obstacle.
  6. ``ghost``: it lies, within the gate in range, where an obstacle shows a second time.
  7. ``noise``: none of these; clutter that the truth does not name is here too.

  How long the pulse and the ringing last, where the window ends and where ghosts are is said in
  :mod:`uwbbench.measure.accuracy.echoes`. Ghosts are many where there are many walls, and noise can fall on one.
* Truth that is not exhaustive: an unmatched detection is not false, so there are no kinds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.detections import Detections
from uwbbench.config.rules import Table
from uwbbench.measure.accuracy.echoes import (
    DIRECT_PULSES,
    RINGING_PULSES,
    covered_m,
    excess_m,
    ghosts_m,
    window_m,
)
from uwbbench.measure.accuracy.judge import judge
from uwbbench.measure.accuracy.judges.segments import near_segments
from uwbbench.measure.accuracy.rules import ScoringRules
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.verdict import Verdict

NOT_KNOWN = "not known"
DROPPED = "dropped by "
"""What causes begin with that name a step of the detector."""

KINDS = (
    "duplicate",
    "out of view",
    "structure",
    "direct path or ringing",
    "within twice the gate",
    "ghost",
    "noise",
)
"""Of false detections, in the order in which they are asked for."""

_EARLY = ("outside the window", "masked by the direct path", "no candidate")
_LATE = ("lost behind the filters", "not in a cluster", "not in a track", "not the strongest", "shared")
_BEHIND = 1_000_000
"""Rank from which the late causes count; between them and the early ones is the place of the filter."""


@dataclass(frozen=True)
class Causes:
    """What the errors of one table on one capture are made of.

    Attributes
    ----------
    misses, false : mapping of str to int
        Misses by cause, and false detections by kind; those that do not occur are left out.
    set_aside : mapping of str to int
        Obstacles that nobody is asked to find, frames of each added up: ``occluded`` and ``outside the region``.
    """

    misses: Mapping[str, int] = field(default_factory=dict)
    false: Mapping[str, int] = field(default_factory=dict)
    set_aside: Mapping[str, int] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return {"misses": dict(self.misses), "false": dict(self.false), "set_aside": dict(self.set_aside)}


def causes(detections: Detections, scene: Scene, rules: ScoringRules, table: Table) -> Causes:
    """Causes of all misses and kinds of all false detections of a table.

    Parameters
    ----------
    detections : Detections
        All of a capture; with their candidates, or every miss that these would explain is ``not known``.
    scene : Scene
        Of the same capture and detections.
    rules : ScoringRules
    table : {"filtering", "mapping"}

    Raises
    ------
    ScoringError
        As :func:`~uwbbench.measure.accuracy.judge.judge`.
    """
    verdict = judge(detections, scene, rules, table)
    visible = scene.visible(rules.region)
    missed = np.zeros_like(visible)
    frames = np.flatnonzero(scene.scored)[verdict.outcome.fn > 0]
    missed[frames] = visible[frames]
    if rules.one_to_one:
        missed &= ~verdict.found
    rank = _ranks(detections, scene, rules, table, verdict)
    ranks = rank[missed] if rules.one_to_one else np.where(missed, rank, -_BEHIND).max(axis=1, initial=-1)[frames]
    steps = list(detections.chain)
    misses = Counter(_name(code, steps) for code in ranks.tolist())
    scored = scene.scored[:, None] & scene.obstacle & scene.labelled
    hidden = scored & scene.inside(rules.region) & scene.sight.occluded
    aside = {"occluded": int(hidden.sum()), "outside the region": int((scored & ~visible & ~hidden).sum())}
    false = _kinds(verdict, scene, rules, table) if scene.truth.exhaustive else Counter[str]()
    return Causes(dict(misses.most_common()), {kind: false[kind] for kind in KINDS if false[kind]}, aside)


def _name(code: int, steps: list[str]) -> str:
    """Cause of a rank, as :func:`_ranks` gives it."""
    if code >= _BEHIND:
        return _LATE[code - _BEHIND]
    if code >= len(_EARLY):
        place = code - len(_EARLY)
        return DROPPED + (steps[place] if place < len(steps) else f"step {place + 1}")
    return _EARLY[code] if code >= 0 else NOT_KNOWN


def _ranks(detections: Detections, scene: Scene, rules: ScoringRules, table: Table, verdict: Verdict) -> IntArray:
    """How far the echo of each object (frames, objects) came: larger is further, -1 is not known."""
    shape = scene.labelled.shape
    rank = np.full(shape, -1, np.int64)
    candidates = detections.candidates
    if candidates is not None:
        rank[:] = _without_candidate(scene)
        near = _near(candidates, scene, rules, table)
        passed = _late("not in a track" if rules.scoring == "track" else "lost behind the filters")
        place = np.nan_to_num(candidates["rejected_by"], nan=float(passed - len(_EARLY))).astype(np.int64)
        _raise(rank, candidates.frame, near, place + len(_EARLY))
    needed, without = ("track", "not in a track") if rules.scoring == "track" else ("cluster", "not in a cluster")
    _raise(rank, detections.frame, _near(detections, scene, rules, table), _late(without))
    judged = detections.take(detections[needed] >= 0) if needed == "track" or table == "mapping" else detections
    _raise(rank, judged.frame, _near(judged, scene, rules, table), _late("not the strongest"))
    _raise(rank, verdict.retained.frame, _near(verdict.retained, scene, rules, table), _late("shared"))
    return rank


def _late(cause: str) -> int:
    return _BEHIND + _LATE.index(cause)


def _raise(rank: IntArray, frame: IntArray, near: BoolArray, to: IntArray | int) -> None:
    """Raise ranks (frames, objects) to those of detections (n,) that are near (n, objects)."""
    row, column = np.nonzero(near)
    np.maximum.at(rank, (frame[row], column), np.broadcast_to(to, len(frame))[row])


def _near(detections: Detections, scene: Scene, rules: ScoringRules, table: Table) -> BoolArray:
    """Which objects (n, objects) each detection is near to."""
    if not len(detections):
        return np.zeros((0, scene.labelled.shape[1]), bool)
    if rules.scoring == "segment":
        return near_segments(detections, scene, rules)
    return np.asarray(np.abs(scene.errors_m(detections, table, rules.surface)) <= rules.gate_m)


def _without_candidate(scene: Scene) -> IntArray:
    """Rank of each object (frames, objects) that no candidate is near to."""
    radar = scene.header.radar
    way_m = excess_m(scene.sight.range_m, scene.sight.azimuth_rad, radar)
    masked = np.where(way_m < covered_m(radar, DIRECT_PULSES), 1, 2)
    return np.where(way_m > window_m(radar), 0, masked)


def _kinds(verdict: Verdict, scene: Scene, rules: ScoringRules, table: Table) -> Counter[str]:
    """False detections by kind."""
    rows = verdict.retained.take(verdict.stray)
    if not len(rows):
        return Counter()
    error_m = np.abs(scene.errors_m(rows, table, rules.surface))
    near, seen = _near(rows, scene, rules, table), scene.visible(rules.region)[rows.frame]
    radar = scene.header.radar
    way_m = excess_m(rows.range_m, rows.azimuth_rad, radar)
    holds = [
        near & seen,
        near & scene.obstacle,
        near & ~scene.obstacle,
        (way_m < covered_m(radar, RINGING_PULSES))[:, None],
        (error_m <= 2 * rules.gate_m) & seen,
    ]
    kind = np.select([part.any(axis=1) for part in holds], range(len(holds)), len(KINDS) - 1)
    left = np.flatnonzero(kind == len(KINDS) - 1)
    kind[left[_is_ghost(way_m[left], rows.frame[left], scene, rules)]] = KINDS.index("ghost")
    return Counter(KINDS[code] for code in kind.tolist())


def _is_ghost(way_m: FloatArray, frame: IntArray, scene: Scene, rules: ScoringRules) -> BoolArray:
    """Whether excess paths (n,) are those of ghosts, within the gate in range."""
    frames, place = np.unique(frame, return_inverse=True)
    off_m = np.abs(way_m[:, None] - ghosts_m(scene, frames)[place])
    return np.asarray((off_m <= 2 * rules.gate_m).any(axis=1))
