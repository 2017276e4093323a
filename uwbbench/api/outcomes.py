"""Outcomes of scorings that know more of a detector's output than its detections."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.metric import Outcome


@dataclass(frozen=True, kw_only=True)
class TrackOutcome(Outcome):
    """Result of matching confirmed tracks with the truth: a row of a frame is the place of one track there.

    Its errors are those of matched rows; a row that belongs to no object has none.

    Attributes
    ----------
    cutoff_m : float
        Distance from which on a track is not the object's: the gate of the scoring.
    localisation_m2 : (frames,) array
        Sum of the squared errors of the matched pairs of each frame, in the assignment that GOSPA is of.
    ospa_m : (frames,) array
        OSPA distance of order 1 of each frame.
    ospa_2_m2 : (frames,) array
        Square of the OSPA distance of order 2 of each frame.
    switches, fragmentations : (frames,) int array
        Objects that in this frame are followed by another track than before, and those that are followed again after
        they were visible but not followed.
    object_frame : (seen,) int array
        Row of the frame in which each object was visible for the first time.
    delay_s : (seen,) array
        Time from then to its first confirmed track; NaN where it never had one.
    track_frame : (tracks,) int array
        Row of the first frame of each track.
    false_track : (tracks,) bool array
        Whether it was near no object for more than half of its frames.
    """

    per_frame: ClassVar[tuple[str, ...]] = (
        *Outcome.per_frame,
        "localisation_m2",
        "ospa_m",
        "ospa_2_m2",
        "switches",
        "fragmentations",
    )
    per_item: ClassVar[Mapping[str, tuple[str, ...]]] = {
        **Outcome.per_item,
        "object_frame": ("delay_s",),
        "track_frame": ("false_track",),
    }

    cutoff_m: float
    localisation_m2: FloatArray
    ospa_m: FloatArray
    ospa_2_m2: FloatArray
    switches: IntArray
    fragmentations: IntArray
    object_frame: IntArray
    delay_s: FloatArray
    track_frame: IntArray
    false_track: BoolArray


@dataclass(frozen=True, kw_only=True)
class SegmentOutcome(Outcome):
    """Result of matching segments with the truth: a detection is an interval of range.

    Attributes
    ----------
    shared_m : (frames,) array
        Length that the segments of each frame have in common with what is there.
    covered_m : (frames,) array
        Length that segments, or what is there, or both, cover.
    """

    per_frame: ClassVar[tuple[str, ...]] = (*Outcome.per_frame, "shared_m", "covered_m")

    shared_m: FloatArray
    covered_m: FloatArray


@dataclass(frozen=True, kw_only=True)
class PresenceOutcome(Outcome):
    """Result of asking of each frame whether anything is there; a true, false or missed one is a frame.

    Attributes
    ----------
    present : (frames,) bool array
        Whether an obstacle is visible.
    probability : (frames,) array
        How probable the detector holds it; NaN throughout where it does not say.
    classes : tuple of str
        Names of the classes that the detector tells apart; none where it tells none.
    true_class, said_class : (frames,) int array
        Place of the class among ``classes``; -1 where the truth belongs to none of them, or the detector names none.
    """

    per_frame: ClassVar[tuple[str, ...]] = (*Outcome.per_frame, "present", "probability", "true_class", "said_class")

    present: BoolArray
    probability: FloatArray
    classes: tuple[str, ...] = ()
    true_class: IntArray
    said_class: IntArray


@dataclass(frozen=True, kw_only=True)
class PoseOutcome(Outcome):
    """Errors of the poses of a run: a row of a frame is a pose. Nothing is counted, so that there are no detections.

    Attributes
    ----------
    step : (poses,) int array
        Step of the run that each pose is of.
    aligned_m, start_m : (poses,) array
        Distance from the true position: after the rigid motion that fits all positions best, and after the one that
        puts the first pose on its true one.
    heading_rad : (poses,) array
        Signed error of the heading after the first of these motions.
    nees : (poses,) array
        Squared error of the pose over its covariance (:mod:`uwbbench.measure.accuracy.trajectories`); NaN where the
        mapper does not say how sure it is.
    nearest_m : (poses, 2) array
        Along x and y, distance from a nearby true position, be it of another step.
    pair_frame : (pairs,) int array
        Row of the first pose of each pair that is 1 m of true travel apart.
    moved_m, turned_rad : (pairs,) array
        Error of the motion between the two: distance, and angle.
    """

    of_run: ClassVar[bool] = True
    per_frame: ClassVar[tuple[str, ...]] = (
        *Outcome.per_frame,
        "step",
        "aligned_m",
        "start_m",
        "heading_rad",
        "nees",
        "nearest_m",
    )
    per_item: ClassVar[Mapping[str, tuple[str, ...]]] = {
        **Outcome.per_item,
        "pair_frame": ("moved_m", "turned_rad"),
    }

    step: IntArray
    aligned_m: FloatArray
    start_m: FloatArray
    heading_rad: FloatArray
    nees: FloatArray
    nearest_m: FloatArray
    pair_frame: IntArray
    moved_m: FloatArray
    turned_rad: FloatArray


@dataclass(frozen=True, kw_only=True)
class MapOutcome(Outcome):
    """What the map of a run has in common with what was there: one row, the run. ``tp``, ``fp``, ``fn`` are landmarks.

    Attributes
    ----------
    duplicates : (1,) int array
        Landmarks on an object that another landmark has.
    shared_cells, covered_cells : (1,) int array
        Cells of the plane that map and truth both take up, and those that either does.
    map_frame, true_frame : (points,) int array
        Zeros: all points are of the one row.
    map_m : (points of the map,) array
        Distance of each from the nearest point of what was there.
    true_m : (points that were there,) array
        Distance of each from the nearest point of the map; inf where that has none.
    start : MapOutcome or None
        The same with the first pose put on its true one, where this is after the motion that fits all positions best.
    """

    of_run: ClassVar[bool] = True
    per_frame: ClassVar[tuple[str, ...]] = (*Outcome.per_frame, "duplicates", "shared_cells", "covered_cells")
    per_item: ClassVar[Mapping[str, tuple[str, ...]]] = {
        **Outcome.per_item,
        "map_frame": ("map_m",),
        "true_frame": ("true_m",),
    }

    duplicates: IntArray
    shared_cells: IntArray
    covered_cells: IntArray
    map_frame: IntArray
    map_m: FloatArray
    true_frame: IntArray
    true_m: FloatArray
    start: MapOutcome | None = None
