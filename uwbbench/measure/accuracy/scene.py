"""What there is to be found on a capture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.capture import CaptureHeader
from uwbbench.api.detections import Detections
from uwbbench.api.errors import ScoringError
from uwbbench.api.geometry import receiver_pose
from uwbbench.api.truth import Sight, Truth
from uwbbench.config.rules import Surface, Table
from uwbbench.measure.accuracy.region import Region

BLOCK_S = 1.0
"""Shortest resampling block within a capture."""


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
            If the capture has no truth and the detections no poses, or they name frames that it does not have.
        """
        truth, frames = header.truth, len(header)
        if truth is None and detections.mapped is not None:
            truth = Truth((), exhaustive=False)  # poses can be judged without
        if truth is None:
            raise ScoringError(f"capture '{header.name}' has no ground truth; it can be detected on, but not scored")
        for index in (detections.frame, detections.processed):
            outside = index[(index < 0) | (index >= frames)]
            if len(outside):
                raise ScoringError(
                    f"the detections name frame {outside[0]}, but capture '{header.name}' has {frames} frames; "
                    "they come from another capture"
                )
        sight = sight or truth.seen_from(header.radar, header.trajectory)
        labelled = np.isfinite(sight.range_m) & np.isfinite(sight.azimuth_rad)
        obstacle = np.array([not item.structure for item in truth.objects], bool)
        known = labelled.all(axis=1) if truth.exhaustive else (labelled & obstacle).any(axis=1)
        processed = np.zeros(frames, bool)
        processed[detections.processed] = True
        return cls(header, truth, sight, labelled, obstacle, known & processed, int(np.sum(known & ~processed)))

    @staticmethod
    def without_ranges(detections: Detections) -> bool:
        """Whether detections speak of their frames as a whole: with a probability, and without a range in any row."""
        known = "range_m" in detections and np.isfinite(detections.range_m).any()
        return len(detections) > 0 and "probability" in detections and not known

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
