"""What a mapper made of a run, laid over what was there: all that pictures of maps and trajectories show.

Conventions
-----------
* The estimate is in the frame of the truth: by the motion that puts its first pose on the true one, or by the one that
  fits all its positions best (:mod:`uwbbench.measure.accuracy.trajectories`). Poses, map and what the front ends have
  found are moved alike.
* Ellipses hold 95 % of a normal distribution with the covariance that the mapper states, of position alone.
* The band of an error is the long half axis of that ellipse: an error beyond it is outside of the ellipse wherever it
  points. It is known with the start fixed alone, as the covariance is that of a filter that knows where it began.
* Time counts from the first step of the run.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from uwbbench.api.arrays import FloatArray, IntArray
from uwbbench.api.capture import CaptureHeader
from uwbbench.api.detections import RECEIVER, Detections
from uwbbench.api.errors import StoreError
from uwbbench.api.geometry import receiver_pose, to_world
from uwbbench.api.mapper import Grid, LandmarkKind, Mapped, Poses
from uwbbench.config.rules import Table
from uwbbench.measure.accuracy.trajectories import Motion, aligned, start_fixed
from uwbbench.results.ground_truth import outlines

CHI2_95 = 5.991
"""What the squared Mahalanobis distance of two coordinates stays below in 95 % of all cases."""

Frame = Literal["start", "aligned"]
"""How an estimate is laid over the truth."""


def true_poses(header: CaptureHeader) -> FloatArray:
    """True x, y and yaw (steps, 3) of a run."""
    return np.column_stack([header.trajectory.position_m[:, :2], header.trajectory.yaw_rad])


def poses_of(mapped: Mapped, table: Table, detector: str) -> Poses:
    """Poses as they were handed out on the way, or as they were known at the end.

    Parameters
    ----------
    mapped : Mapped
    table : {"filtering", "mapping"}
    detector : str
        Name for the message.

    Raises
    ------
    StoreError
        If there are none.
    """
    poses = mapped.poses if table == "filtering" else mapped.smoothed
    if poses is None:
        raise StoreError(f"detector '{detector}' does not look back: its poses are in the table 'filtering' alone")
    if not len(poses):
        raise StoreError(f"detector '{detector}' has handed out no pose")
    return poses


@dataclass(frozen=True)
class MappedDrive:
    """A detector's poses and map of a run, over the truth.

    Parameters
    ----------
    header : CaptureHeader
        Of the run.
    detections : Detections
        Rows of the front ends.
    mapped : Mapped
    poses : Poses
        Those of ``mapped`` that are shown: as handed out, or smoothed. At least one.
    frame : {"start", "aligned"}
    """

    header: CaptureHeader
    detections: Detections
    mapped: Mapped
    poses: Poses
    frame: Frame = "start"

    @cached_property
    def truth(self) -> FloatArray:
        """True pose (n, 3) at each pose."""
        return true_poses(self.header)[self.poses.index]

    @cached_property
    def motion(self) -> Motion:
        """From the mapper's frame to that of the truth."""
        return (start_fixed if self.frame == "start" else aligned)(self.poses.pose, self.truth)

    @cached_property
    def time_s(self) -> FloatArray:
        """Time of each pose (n,)."""
        clock_s = self.header.trajectory.timestamp_s
        return np.asarray(clock_s[self.poses.index] - clock_s[0])

    @cached_property
    def pose(self) -> FloatArray:
        """X, y and yaw (n, 3)."""
        return self.motion.of_poses(self.poses.pose)

    @cached_property
    def error_m(self) -> FloatArray:
        """Distance (n,) of each position from the true one."""
        return np.asarray(np.hypot(*(self.pose - self.truth)[:, :2].T))

    @cached_property
    def spread_m2(self) -> FloatArray | None:
        """Covariance of each position (n, 2, 2); None where the mapper does not say."""
        covariance = self.poses.covariance
        return None if covariance is None else self._turned(covariance[:, :2, :2])

    @cached_property
    def band_m(self) -> FloatArray | None:
        """Error (n,) beyond which a position is outside of its ellipse; None where that is not known."""
        if self.spread_m2 is None or self.frame != "start":
            return None
        return np.asarray(np.sqrt(CHI2_95 * np.maximum(np.linalg.eigvalsh(self.spread_m2)[:, -1], 0.0)))

    def _turned(self, covariance: FloatArray) -> FloatArray:
        return self.motion.matrix @ covariance @ self.motion.matrix.T

    # Map ---------------------------------------------------------------------------------------------------------

    def marks(self, kind: LandmarkKind) -> tuple[FloatArray, FloatArray]:
        """Positions (k, 2) and their covariances (k, 2, 2) of landmarks that are points or anchors."""
        marks = self.mapped.map.landmarks.of(kind)
        return self.motion.of_points(marks.position_m), self._turned(marks.covariance)

    @cached_property
    def lines_m(self) -> FloatArray:
        """Lines without known ends as segments (k, 2, 2), cut where what there is else ends; none beside segments."""
        lines = self.mapped.map.landmarks.of("line")
        if len(self.mapped.map.segments_m) or not len(lines):
            return np.zeros((0, 2, 2))
        low, high = self.box_m
        middle, half_m = (low + high) / 2, np.hypot(*(high - low)) / 2
        turned = lines.b + self.motion.turn_rad
        normal = np.column_stack([np.cos(turned), np.sin(turned)])
        distance_m = lines.a + normal @ self.motion.shift_m
        foot = middle + (distance_m - normal @ middle)[:, None] * normal
        along = half_m * np.column_stack([-normal[:, 1], normal[:, 0]])
        return np.stack([foot - along, foot + along], axis=1)

    @cached_property
    def box_m(self) -> tuple[FloatArray, FloatArray]:
        """Corners (2,) of what holds the true path, all outlines, and the estimate unless that is far off."""
        points_m = [self.header.trajectory.position_m[:, :2], *(outline.points_m for outline in outlines(self.header))]
        there_m = np.concatenate(points_m)
        low, high = there_m.min(axis=0), there_m.max(axis=0)
        room = (high - low).max() / 2
        near = np.clip(self.pose[:, :2], low - room, high + room)
        return np.minimum(low, near.min(axis=0)), np.maximum(high, near.max(axis=0))

    @cached_property
    def segments_m(self) -> FloatArray:
        """Pieces (k, 2, 2) with known ends."""
        return self.motion.of_points(self.mapped.map.segments_m.reshape(-1, 2)).reshape(-1, 2, 2)

    @cached_property
    def points_m(self) -> FloatArray:
        """Points (k, 2) of surfaces."""
        return self.motion.of_points(self.mapped.map.points_m)

    @property
    def grid(self) -> Grid | None:
        """The grid, in the mapper's frame."""
        return self.mapped.map.grid

    # Front ends --------------------------------------------------------------------------------------------------

    @cached_property
    def found(self) -> tuple[IntArray, FloatArray]:
        """What the front ends have found with a range and an azimuth: row among the poses (m,), and place (m, 2)."""
        rows = self.detections
        at = np.clip(np.searchsorted(self.poses.index, rows.frame), 0, len(self.poses) - 1)
        receiver = rows[RECEIVER]
        located = np.isfinite(rows.range_m) & np.isfinite(rows.azimuth_rad) & (self.poses.index[at] == rows.frame)
        kept, places = [], []
        for place, radar in enumerate(self.header.radars or (self.header.radar,)):
            mine = np.flatnonzero(located & ((receiver == place) | np.isnan(receiver)))
            poses = self.pose[at[mine]]
            flat = np.column_stack([poses[:, :2], np.zeros(len(poses))])
            eye_m, heading = receiver_pose(flat, poses[:, 2], np.asarray(radar.mount_position_m), radar.mount_yaw_rad)
            kept.append(at[mine])
            places.append(to_world(rows.range_m[mine], rows.azimuth_rad[mine], eye_m, heading))
        order = np.argsort(np.concatenate(kept), kind="stable")
        return np.concatenate(kept)[order], np.concatenate(places)[order]


def ellipses(middle_m: FloatArray, covariance: FloatArray, corners: int = 24) -> FloatArray:
    """Ellipses that hold 95 % of normal distributions, as closed outlines (n, corners + 1, 2).

    Parameters
    ----------
    middle_m : (n, 2) array
    covariance : (n, 2, 2) array
    corners : int
    """
    values, vectors = np.linalg.eigh(covariance)
    axes = vectors * np.sqrt(CHI2_95 * np.maximum(values, 0.0))[:, None, :]
    angle = np.linspace(0.0, 2 * np.pi, corners + 1)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    return np.asarray(middle_m[:, None] + np.swapaxes(axes @ circle, 1, 2))


def thinned(count: int, most: int) -> IntArray:
    """At most so many of ``count`` rows, evenly spread, the first and the last among them."""
    return (
        np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))
        if count
        else np.zeros(0, np.int64)
    )


def cells(grid: Grid, *, occupied: bool = False) -> tuple[FloatArray, FloatArray]:
    """Middles (n, 2) and log-odds (n,) of the cells of which anything is known, or of the occupied ones alone."""
    rows, columns = np.nonzero(grid.log_odds > 0 if occupied else grid.log_odds)
    return grid.origin_m + grid.cell_m * (np.column_stack([columns, rows]) + 0.5), grid.log_odds[rows, columns]
