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
* ``track``: the rows of confirmed tracks are matched with visible obstacles as in ``object``, but by
  :mod:`uwbbench.measure.accuracy.judges.tracks`.
* ``segment``: segments are matched with visible obstacles as detections are in ``object``, but by
  :mod:`uwbbench.measure.accuracy.judges.segments`.
* ``presence``: every frame is judged as a whole, by :mod:`uwbbench.measure.accuracy.judges.presence`; the only scoring
  of rows without a range.
* ``pose`` and ``map``: a run as a whole is judged, by what a mapper made of it
  (:mod:`uwbbench.measure.accuracy.judges.pose` and :mod:`uwbbench.measure.accuracy.judges.map`). No other scoring is of
  a mapper's rows, as they are of several receivers.
* An error refers to the matched obstacle, else to the nearest visible one, else to the nearest labelled one.
* Truth that is not exhaustive: a detection that matches nothing is ``unmatched``, neither true nor false, and has no
  error. Frames and obstacles that nothing matches are misses.
* Always ``tp + fp + structure + unmatched = retained``.
"""

from __future__ import annotations

from uwbbench.api.detections import Detections
from uwbbench.api.errors import ScoringError
from uwbbench.config.rules import Table
from uwbbench.measure.accuracy.judges.detections import judge_detections
from uwbbench.measure.accuracy.judges.map import judge_map
from uwbbench.measure.accuracy.judges.pose import judge_pose
from uwbbench.measure.accuracy.judges.presence import judge_presence
from uwbbench.measure.accuracy.judges.run import check_kind
from uwbbench.measure.accuracy.judges.segments import judge_segments
from uwbbench.measure.accuracy.judges.tracks import judge_tracks
from uwbbench.measure.accuracy.rules import ScoringRules, outcome_of
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.verdict import Verdict


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
        Errors in range, or in position: of the clustered detections, or of tracks. Poses as they were handed out, or
        smoothed.

    Raises
    ------
    ScoringError
        If ``peak`` is asked for without the peaks before the filters, ``latest`` without the times of hand-out, or
        ``track`` or ``segment`` of detections that no stage made tracks or segments of; or rows lack a range, which
        ``presence`` alone can do without. If a mapper's detections are to be judged by another scoring than ``pose``
        and ``map``, or others by these; or poses or map are not finite.
    """
    of_run = outcome_of(rules.scoring).of_run
    check_kind(detections, rules.scoring, of_run=of_run)
    if rules.scoring != "presence" and not of_run:
        _check_ranges(detections)
    return _FAMILIES.get(rules.scoring, judge_detections)(detections, scene, rules, table)


_FAMILIES = {
    "track": judge_tracks,
    "segment": judge_segments,
    "presence": judge_presence,
    "pose": judge_pose,
    "map": judge_map,
}
"""Judges of the scorings that judge something else than single detections."""


def _check_ranges(detections: Detections) -> None:
    if Scene.without_ranges(detections):
        raise ScoringError(
            "the detections have a probability and no range: they speak of frames as a whole; score them by 'presence'"
        )
    if len(detections) and "range_m" not in detections:
        raise ScoringError("the detections have no range_m; add the stage 'range' to the detector")


def tables_of(detections: Detections, scoring: str) -> tuple[Table, ...]:
    """Tables that detections can be judged by: ``mapping`` where they are clustered, or are tracks with positions.

    Segments and presence have no positions. Of poses ``mapping`` is the smoothed trajectory, where there is one; a map
    has one table.
    """
    if scoring in ("segment", "presence", "map"):
        return ("filtering",)
    if scoring == "pose":
        smoothed = detections.mapped is not None and detections.mapped.smoothed is not None
        return ("filtering", "mapping") if smoothed else ("filtering",)
    needed = ("x_m", "y_m") if scoring == "track" else ("cluster", "x_m", "y_m")
    return ("filtering", "mapping") if all(column in detections for column in needed) else ("filtering",)
