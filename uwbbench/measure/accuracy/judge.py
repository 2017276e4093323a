"""Which detections are true, which are false and what was missed, on one capture.

Conventions
-----------
* Two tables. *Filtering*: the error of a detection is its range minus the true range from the receiver to the nearest
  point of the outline, as if the target were at boresight. *Mapping*: only detections that belong to a cluster count,
  and the error is the distance from (x, y) to the outline, 0 inside it, or, for ``surface: visible``, to what the
  receiver can see of it from where it is in that frame; a distance has no sign.
* A frame is scored if a detector has processed it and its truth is known: every object labelled there, or, where the
  truth is not exhaustive, at least one obstacle. Invalid frames are not processed, so they drop out.
* An obstacle is visible if its nearest point lies in the :class:`Region` and nothing occludes it. Structure (walls) is
  never visible in this sense: nobody is asked to find it.
* A detection within the gate of a labelled object is in the region if and only if that object is, so that a small
  error at the region's border is neither punished nor rewarded; any other is in it if its own range is. Detections
  outside the region, or without a range, are ignored: they are neither retained nor false.
* ``frame``: the strongest retained detection of a frame is true within the gate of a visible obstacle (inclusive), else
  false; a visible obstacle and no detection is one miss. Equal or unknown amplitudes: the one listed first.
* ``peak``: every retained detection is true or false in the same way; a miss is a frame without one although a peak
  before the filters lay within the gate. So its recall is never below that of ``frame``.
* ``object``: detections and visible obstacles are matched one-to-one (:mod:`uwbbench.measure.accuracy.matching`). Other
  detections are false, those within the gate of an already matched obstacle being counted apart too (``duplicates``),
  except those within the gate of structure (``structure``). The other scorings count walls as false, as the paper does.
* ``latest``: as ``frame``, of the latest answer that had been given by then (:mod:`uwbbench.measure.accuracy.age`).
* An error refers to the matched obstacle, else to the nearest visible one, else to the nearest labelled one.
* Truth that is not exhaustive: a detection that matches nothing is ``unmatched``, neither true nor false, and has no
  error. Frames and obstacles that nothing matches are misses.
* Always ``tp + fp + structure + unmatched = retained``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, get_args

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.capture import CaptureHeader
from uwbbench.api.detections import Detections
from uwbbench.api.errors import ScoringError, nearest
from uwbbench.api.geometry import receiver_pose
from uwbbench.api.metric import Outcome
from uwbbench.api.truth import Sight, Truth
from uwbbench.config.rules import Scoring, Surface, Table
from uwbbench.measure.accuracy.age import latest_answers
from uwbbench.measure.accuracy.matching import match_frames
from uwbbench.measure.accuracy.region import Region

SCORINGS: tuple[Scoring, ...] = get_args(Scoring)

BLOCK_S = 1.0
"""Shortest resampling block within a capture."""


@dataclass(frozen=True)
class ScoringRules:
    """How to score.

    Parameters
    ----------
    scoring : {"frame", "peak", "object", "latest"}
    gate_m : float
        Largest error of a true detection, inclusive.
    region : Region
    strongest : int or None
        Score only that many detections of a frame, those of largest amplitude in the region.
    surface : {"outline", "visible"}
        What the error of a position is the distance to: the outline, 0 inside, or what the receiver sees of it.
    regions : tuple of (str, Region)
        Datasets of a run, by label, that have a region of their own; see :meth:`of`.

    Raises
    ------
    ScoringError
        If a value is not allowed.
    """

    scoring: Scoring = "frame"
    gate_m: float = 0.20
    region: Region = field(default_factory=Region)
    strongest: int | None = None
    surface: Surface = "outline"
    regions: tuple[tuple[str, Region], ...] = ()

    def of(self, dataset: str) -> ScoringRules:
        """Rules of the captures of one dataset of a run, by its label."""
        return replace(self, region=dict(self.regions).get(dataset, self.region), regions=())

    def to_dict(self) -> dict[str, Any]:
        """Rules as plain values; regions of datasets only where there are any, as earlier versions had none."""
        facts = asdict(self)
        regions = {label: asdict(region) for label, region in self.regions}
        return {**facts, "regions": regions} if regions else {k: v for k, v in facts.items() if k != "regions"}

    @classmethod
    def from_dict(cls, facts: Mapping[str, Any]) -> ScoringRules:
        """Rules from plain values."""
        regions = tuple((label, Region(**region)) for label, region in facts.get("regions", {}).items())
        return cls(**{**facts, "region": Region(**facts["region"]), "regions": regions})

    def __post_init__(self) -> None:
        if self.surface not in get_args(Surface):
            raise ScoringError(f"no surface '{self.surface}'.{nearest(self.surface, get_args(Surface))}")
        if self.scoring not in SCORINGS:
            raise ScoringError(f"no scoring '{self.scoring}'.{nearest(self.scoring, SCORINGS)}")
        if not 0 < self.gate_m < math.inf:
            raise ScoringError(f"gate_m must be positive and finite, not {self.gate_m}")
        if self.strongest is not None and self.strongest < 1:
            raise ScoringError(f"strongest must be at least 1, not {self.strongest}")


@dataclass(frozen=True)
class Scene:
    """What there is to be found on a capture, and in which frames a detector has looked for it.

    Attributes
    ----------
    header : CaptureHeader
    truth : Truth
    sight : Sight
        Range and azimuth of every object in every frame.
    labelled : (frames, objects) bool array
        Whether that range is known.
    obstacle : (objects,) bool array
        False for structure.
    scored : (frames,) bool array
        Frames whose truth is known and that a detector has processed.
    unprocessed : int
        Frames whose truth is known, but that no detector has processed.
    """

    header: CaptureHeader
    truth: Truth
    sight: Sight
    labelled: BoolArray
    obstacle: BoolArray
    scored: BoolArray
    unprocessed: int

    @classmethod
    def of(cls, detections: Detections, header: CaptureHeader, sight: Sight | None = None) -> Scene:
        """Scene of a capture for a detector's output.

        Parameters
        ----------
        detections : Detections
        header : CaptureHeader
        sight : Sight, optional
            Of the capture's objects, where it is known from another detector's output.

        Raises
        ------
        ScoringError
            If the capture has no truth, or the detections name frames that it does not have.
        """
        truth, frames = header.truth, len(header)
        if truth is None:
            raise ScoringError(f"capture '{header.name}' has no ground truth; it can be detected on, but not scored")
        for index in (detections.frame, detections.processed):
            outside = index[(index < 0) | (index >= frames)]
            if len(outside):
                raise ScoringError(
                    f"the detections name frame {outside[0]}, but capture '{header.name}' has {frames} frames; "
                    "they come from another capture"
                )
        if len(detections) and "range_m" not in detections:
            raise ScoringError("the detections have no range_m; add the stage 'range' to the detector")
        sight = sight or truth.seen_from(header.radar, header.trajectory)
        labelled = np.isfinite(sight.range_m) & np.isfinite(sight.azimuth_rad)
        obstacle = np.array([not item.structure for item in truth.objects], bool)
        known = labelled.all(axis=1) if truth.exhaustive else (labelled & obstacle).any(axis=1)
        processed = np.zeros(frames, bool)
        processed[detections.processed] = True
        return cls(header, truth, sight, labelled, obstacle, known & processed, int(np.sum(known & ~processed)))

    def inside(self, region: Region) -> BoolArray:
        """Whether each object (frames, objects) lies between the region's ranges."""
        low, high = region.limits_m(self.header.radar)
        return (self.sight.range_m >= low) & (self.sight.range_m <= high)

    def visible(self, region: Region) -> BoolArray:
        """Whether each object (frames, objects) is an obstacle that a detector is asked to find."""
        ahead = np.abs(self.sight.azimuth_rad) <= region.widest_rad(self.header.radar)
        return self.inside(region) & ahead & ~self.sight.occluded & self.obstacle & self.labelled

    def errors_m(self, detections: Detections, table: Table, surface: Surface = "outline") -> FloatArray:
        """Error (n, objects) of each detection against each object; NaN where the object is not labelled.

        Parameters
        ----------
        detections : Detections
        table : {"filtering", "mapping"}
        surface : {"outline", "visible"}
            What distances of the mapping table are taken to.
        """
        if table == "filtering":
            error = detections.range_m[:, None] - self.sight.range_m[detections.frame]
        else:
            points_m = np.stack([detections["x_m"], detections["y_m"]], axis=1)
            radar, track = self.header.radar, self.header.trajectory
            mount_m = np.asarray(radar.mount_position_m)
            receiver_m, _ = receiver_pose(track.position_m, track.yaw_rad, mount_m, radar.mount_yaw_rad)
            eyes_m = receiver_m[detections.frame, :2] if surface == "visible" else None
            error = self.truth.distance_to(points_m, detections.frame, eyes_m)
        return np.where(self.labelled[detections.frame], error, np.nan)

    def group(self) -> IntArray:
        """Resampling group of each frame: equal times of at least :data:`BLOCK_S`, the same for all detectors."""
        elapsed_s = self.header.trajectory.timestamp_s - self.header.trajectory.timestamp_s[:1]
        span_s = elapsed_s[-1] if len(elapsed_s) else 0.0
        blocks = max(1, int(span_s / BLOCK_S))
        if blocks == 1:
            return np.zeros(len(elapsed_s), np.int64)
        return np.asarray(np.minimum(elapsed_s / span_s * blocks, blocks - 1), np.int64)


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


def judge(detections: Detections, scene: Scene, rules: ScoringRules, table: Table) -> Verdict:
    """Judge every detection of a table, by the conventions above.

    Parameters
    ----------
    detections : Detections
        All of a capture; for ``peak`` with their candidates, the peaks before the filters.
    scene : Scene
        Of the same capture and detections.
    rules : ScoringRules
    table : {"filtering", "mapping"}
        Errors in range, or in position of the clustered detections.

    Raises
    ------
    ScoringError
        If ``peak`` is asked for without the peaks before the filters, or ``latest`` without the times of hand-out.
    """
    if rules.scoring == "latest":
        detections = latest_answers(detections)
    frames, exhaustive = len(scene.header), scene.truth.exhaustive
    visible = scene.visible(rules.region)
    clustered = detections.take(detections["cluster"] >= 0) if table == "mapping" else detections
    kept = _strongest(_in_region(clustered, scene, rules, table), rules)
    error_m = scene.errors_m(kept, table, rules.surface)
    near = np.abs(error_m) <= rules.gate_m
    seen = visible[kept.frame]

    def count(rows: BoolArray) -> IntArray:
        return np.bincount(kept.frame[rows], minlength=frames).astype(np.int64)

    signed_m = _nearest(error_m, seen)
    signed_m = np.where(np.isnan(signed_m), _nearest(error_m, np.broadcast_to(scene.obstacle, near.shape)), signed_m)
    wall = duplicate = np.zeros(len(kept), bool)
    found = np.zeros_like(visible)
    if rules.scoring == "object":
        partner = match_frames(kept.frame, np.where(seen, np.abs(error_m), np.nan), rules.gate_m)
        matched = partner >= 0
        signed_m[matched] = error_m[matched, partner[matched]]
        wall = ~matched & (near & ~scene.obstacle).any(axis=1)
        signed_m[wall] = np.nan
        found[kept.frame[matched], partner[matched]] = True
        duplicate = ~matched & ~wall & (near & found[kept.frame]).any(axis=1)
    else:
        matched = np.asarray((near & seen).any(axis=1))
        row, column = np.nonzero(near & seen)
        found[kept.frame[row], column] = True
    stray = ~matched & ~wall
    if not exhaustive:
        signed_m[~matched] = np.nan

    there, retained, tp = visible.sum(axis=1), count(np.ones(len(kept), bool)), count(matched)
    if rules.scoring == "object":
        fn = there - tp
    else:
        missed = (there > 0) & ((retained if exhaustive else tp) == 0)
        if rules.scoring == "peak":
            missed &= _has_true_candidate(detections, missed, scene, rules, table)
        fn = missed.astype(np.int64)
    index = np.flatnonzero(scene.scored)
    outcome = Outcome(
        group=scene.group()[index],
        tp=tp[index],
        fp=count(stray)[index] if exhaustive else np.zeros(len(index), np.int64),
        fn=fn[index],
        error_frame=np.searchsorted(index, kept.frame),
        error_m=signed_m,
        matched=matched,
        duration_s=len(index) / scene.header.radar.frame_rate_hz,
        exhaustive=exhaustive,
    )
    return Verdict(
        outcome=outcome,
        true_empty=int(np.sum((there + retained)[index] == 0)),
        duplicates=int(duplicate.sum()),
        structure=int(wall.sum()),
        unmatched=0 if exhaustive else int(stray.sum()),
        chance_recall=_chance_recall(retained, scene, rules) if table == "filtering" else math.nan,
        retained=kept,
        stray=stray,
        found=found,
    )


def _in_region(detections: Detections, scene: Scene, rules: ScoringRules, table: Table) -> Detections:
    """Detections of scored frames in the region: those near labelled objects share their objects' place."""
    detections = detections.take(scene.scored[detections.frame])
    low, high = rules.region.limits_m(scene.header.radar)
    near = np.abs(scene.errors_m(detections, table, rules.surface)) <= rules.gate_m
    beside = (near & scene.inside(rules.region)[detections.frame]).any(axis=1)
    alone = (detections.range_m >= low) & (detections.range_m <= high)
    return detections.take(np.where(near.any(axis=1), beside, alone))


def _strongest(detections: Detections, rules: ScoringRules) -> Detections:
    """Detections ordered by frame and falling amplitude, no more in a frame than the rules allow."""
    weakness = np.nan_to_num(-detections["amplitude"], nan=np.inf)
    detections = detections.take(np.lexsort((weakness, detections.frame)))
    most = 1 if rules.scoring in ("frame", "latest") else rules.strongest
    rank = np.arange(len(detections)) - np.searchsorted(detections.frame, detections.frame)
    return detections if most is None else detections.take(rank < most)


def _nearest(error_m: FloatArray, among: BoolArray) -> FloatArray:
    """Error of smallest magnitude (n,) among the chosen objects (n, objects); NaN where there is none."""
    chosen = np.where(among, error_m, np.nan)
    chosen = np.concatenate([chosen, np.full((len(chosen), 1), np.nan)], axis=1)
    column = np.argmin(np.where(np.isnan(chosen), np.inf, np.abs(chosen)), axis=1)
    smallest: FloatArray = chosen[np.arange(len(chosen)), column]
    return smallest


def _has_true_candidate(
    detections: Detections, asked: BoolArray, scene: Scene, rules: ScoringRules, table: Table
) -> BoolArray:
    """Those of the frames (frames,) asked for where a peak before the filters lies in a visible obstacle's gate."""
    candidates = detections.candidates
    if candidates is None:
        raise ScoringError(
            "peak scoring asks what the filters removed, and these detections do not carry the peaks before the "
            "filters; take them from detector.run(capture, candidates=True), or use the scoring 'frame' or 'object'"
        )
    needed = "range_m" if table == "filtering" else "x_m"
    if len(candidates) and needed not in candidates:
        raise ScoringError(f"peak scoring: the peaks before the filters have no {needed}")
    candidates = candidates.take(asked[candidates.frame])
    near = np.abs(scene.errors_m(candidates, table, rules.surface)) <= rules.gate_m
    true = (near & scene.visible(rules.region)[candidates.frame]).any(axis=1)
    return np.isin(np.arange(len(scene.header)), candidates.frame[true])


def _chance_recall(retained: IntArray, scene: Scene, rules: ScoringRules) -> float:
    """Recall of uniformly random ranges in the region, as many in each frame as the detector retained there.

    One random range falls within the gate of an obstacle with probability w / L, w being the part of its gate inside
    the region and L the region's length; at least one of k with 1 - (1 - w / L)^k. In ``frame`` the gates of several
    obstacles unite.
    """
    if rules.scoring == "peak":
        return math.nan
    low, high = rules.region.limits_m(scene.header.radar)
    visible = scene.visible(rules.region)[scene.scored]
    range_m = scene.sight.range_m[scene.scored]
    start = np.where(visible, np.clip(range_m - rules.gate_m, low, high), high)
    stop = np.where(visible, np.clip(range_m + rules.gate_m, low, high), high)
    width = stop - start
    if rules.scoring in ("frame", "latest"):
        order = np.argsort(start, axis=1)
        start, stop = np.take_along_axis(start, order, axis=1), np.take_along_axis(stop, order, axis=1)
        reached = np.maximum.accumulate(np.insert(stop[:, :-1], 0, low, axis=1), axis=1)
        width = np.sum(np.maximum(stop - np.maximum(start, reached), 0.0), axis=1, keepdims=True)
        visible = np.asarray(visible.any(axis=1))[:, None]
    chance = 1 - (1 - width / (high - low)) ** retained[scene.scored][:, None]
    return float(np.mean(chance[visible])) if visible.any() else math.nan
