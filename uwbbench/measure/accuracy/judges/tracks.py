"""Judge of tracks: the scoring ``track``.

Conventions
-----------
* Only rows of confirmed tracks count, ``track`` >= 0. The cut-off c is the gate; distances are those of the table.
* In every frame rows and visible obstacles are assigned one-to-one so that GOSPA of order 2 is smallest
  (:mod:`uwbbench.measure.accuracy.set_distances`): pairs closer than c are true, other rows false, obstacles without a
  row missed. Rows within c of structure that are not matched are set aside, and belong to no set.
* The error of a matched row is its distance to its object; any other row has none.
* Identity follows CLEAR-MOT (:mod:`uwbbench.measure.accuracy.judges.identity`), which keeps pairs of the frame before.
  A *switch*: an object is followed by another track than the last that followed it. A *fragmentation*: it is followed
  again after frames in which it was visible and followed by none.
* The *confirmation delay* of an object is the time from the first frame in which it is visible to the first in which a
  confirmed track follows it.
* A track is *false* if it is near an object, visible or not, or structure, in less than half of its rows in the region.
"""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import registry
from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.detections import Detections
from uwbbench.api.errors import ScoringError
from uwbbench.api.outcomes import TrackOutcome
from uwbbench.config.rules import Table
from uwbbench.measure.accuracy.judges import identity
from uwbbench.measure.accuracy.judges.counts import Counts
from uwbbench.measure.accuracy.judges.retained import chance_recall, in_region, strongest
from uwbbench.measure.accuracy.matching import match_frames
from uwbbench.measure.accuracy.rules import ScoringRules
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.set_distances import assigned
from uwbbench.measure.accuracy.verdict import Verdict


def judge_tracks(detections: Detections, scene: Scene, rules: ScoringRules, table: Table) -> Verdict:
    """Judge every track of a table, for the function of the same arguments that asks this judge.

    Parameters
    ----------
    detections : Detections
    scene : Scene
    rules : ScoringRules
    table : {"filtering", "mapping"}
    """
    if len(detections) and "track" not in detections:
        maker = registry.makers().get("track")
        stage = f", such as '{maker}'," if maker else ""
        raise ScoringError(
            f"the detections have no column 'track': a stage that makes tracks{stage} is missing in the detector; "
            "without one, score it by 'frame', 'peak', 'object' or 'latest'"
        )
    frames, cutoff_m = len(scene.header), rules.gate_m
    visible = scene.visible(rules.region) & scene.scored[:, None]
    kept = strongest(in_region(detections.take(detections["track"] >= 0), scene, rules, table), rules)
    error_m = scene.errors_m(kept, table, rules.surface)
    near = np.abs(error_m) < cutoff_m
    cost_m = np.where(near & visible[kept.frame], np.abs(error_m), np.nan)
    partner = _partners(kept.frame, cost_m, cutoff_m, order=2.0)
    matched = partner >= 0
    wall = ~matched & (near & ~scene.obstacle).any(axis=1)
    stray = ~matched & ~wall
    signed_m = np.full(len(kept), np.nan)
    signed_m[matched] = error_m[matched, partner[matched]]
    found = np.zeros_like(visible)
    found[kept.frame[matched], partner[matched]] = True
    duplicate = stray & (near & found[kept.frame]).any(axis=1)

    counts = Counts(scene, kept, visible, matched, wall, duplicate, found)
    there, tp = counts.there, counts.of(matched)

    def near_power(partner: IntArray, order: float) -> FloatArray:
        """Sum, in each frame, of the p-th powers of the assigned distances."""
        rows = np.flatnonzero(partner >= 0)
        power = np.zeros(frames)
        np.add.at(power, kept.frame[rows], cost_m[rows, partner[rows]] ** order)
        return power

    def ospa(partner: IntArray, order: float) -> FloatArray:
        """The p-th power of OSPA in each frame."""
        larger = np.maximum(there, tp + counts.of(stray))
        total = near_power(partner, order) + cutoff_m**order * (larger - counts.of(partner >= 0))
        return np.asarray(total / np.maximum(larger, 1))

    open_m = np.where(wall[:, None], np.nan, cost_m)
    follows = identity.followers(kept.frame, kept["track"], open_m, partner, cutoff_m)
    switches, fragmentations = identity.changes(kept.frame, kept["track"], follows, visible)
    index = counts.index
    object_frame, delay_s = _delays(kept.frame, follows, visible, scene.header.trajectory.timestamp_s)
    track_frame, false_track = _false_tracks(kept, np.asarray(near.any(axis=1)))
    outcome = TrackOutcome(
        **counts.facts(there - tp, signed_m),
        cutoff_m=cutoff_m,
        localisation_m2=near_power(partner, 2.0)[index],
        ospa_m=ospa(_partners(kept.frame, open_m, cutoff_m, 1.0), 1.0)[index],
        ospa_2_m2=ospa(partner, 2.0)[index],
        switches=switches[index],
        fragmentations=fragmentations[index],
        object_frame=np.searchsorted(index, object_frame),
        delay_s=delay_s,
        track_frame=np.searchsorted(index, track_frame),
        false_track=false_track,
    )
    chance = chance_recall(counts.retained, scene, rules) if table == "filtering" else math.nan
    return counts.verdict(outcome, chance)


def _partners(frame: IntArray, cost_m: FloatArray, cutoff_m: float, order: float) -> IntArray:
    """Object of each row (n,) in the assignment of its frame that is best at an order; -1 where it has none."""
    return match_frames(frame, cost_m, cutoff_m, lambda cost, gate: assigned(cost, gate, order))


def _delays(frame: IntArray, follows: IntArray, visible: BoolArray, time_s: FloatArray) -> tuple[IntArray, FloatArray]:
    """First visible frame of each object that is ever visible, and the time from then to its first track."""
    seen, when = np.nonzero(visible.T)
    there, place = np.unique(seen, return_index=True)
    start = when[place]
    first = np.full(visible.shape[1], len(visible))
    rows = follows >= 0
    np.minimum.at(first, follows[rows], frame[rows])
    known = first[there] < len(visible)
    delay_s = np.full(len(there), np.nan)
    delay_s[known] = time_s[first[there][known]] - time_s[start[known]]
    return start.astype(np.int64), delay_s


def _false_tracks(kept: Detections, near: BoolArray) -> tuple[IntArray, BoolArray]:
    """First frame of each track, and whether it was near something in less than half of its rows (n,)."""
    _, first, place = np.unique(kept["track"], return_index=True, return_inverse=True)
    rows, close = np.bincount(place, minlength=len(first)), np.bincount(place, near, minlength=len(first))
    return kept.frame[first], np.asarray(2 * close < rows)
