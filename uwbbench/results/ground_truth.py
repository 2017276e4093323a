"""Ground truth as every picture of a capture shows it: outlines from above, and ranges over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.capture import CaptureHeader
from uwbbench.measure.accuracy.region import Region


@dataclass(frozen=True)
class Outline:
    """An object from above.

    Attributes
    ----------
    name : str
    structure, moves : bool
    points_m : (vertices, 2) array
        Corners; of a moving object the path of its middle (frames, 2), as outlines of all frames would cover a picture.
    """

    name: str
    structure: bool
    moves: bool
    points_m: FloatArray


@dataclass(frozen=True)
class TrueRange:
    """Range of an obstacle over time.

    Attributes
    ----------
    name : str
    range_m : (frames,) array
        NaN where the obstacle is hidden, or its place is not known.
    ahead : (frames,) bool array
        Whether it lies in the sector that scores look at.
    """

    name: str
    range_m: FloatArray
    ahead: BoolArray

    @property
    def ahead_m(self) -> FloatArray:
        """Range (frames,) in that sector; NaN elsewhere."""
        return np.where(self.ahead, self.range_m, np.nan)


def outlines(header: CaptureHeader, frames: IntArray | None = None) -> list[Outline]:
    """Every object of a capture from above.

    Parameters
    ----------
    header : CaptureHeader
    frames : (shown,) int array, optional
        Frames of the path of what moves; all by default.
    """
    shapes = []
    for obstacle in header.truth.objects if header.truth is not None else ():
        points_m = obstacle.outline_m[..., :2]
        if obstacle.moves:
            points_m = (points_m if frames is None else points_m[frames]).mean(axis=1)
        else:
            points_m = points_m.reshape(-1, 2)
        shapes.append(Outline(obstacle.name, obstacle.structure, obstacle.moves, points_m))
    return shapes


def true_ranges(header: CaptureHeader, region: Region | None = None, frames: IntArray | None = None) -> list[TrueRange]:
    """Range of every obstacle of a capture.

    Parameters
    ----------
    header : CaptureHeader
    region : Region, optional
        Of the scores, whose sector is meant; their default if left out.
    frames : (shown,) int array, optional
        Frames; all by default.
    """
    if header.truth is None:
        return []
    sight = header.truth.seen_from(header.radar, header.trajectory)
    ahead = np.abs(sight.azimuth_rad) <= (region or Region()).widest_rad(header.radar)
    range_m = np.where(sight.occluded, np.nan, sight.range_m)
    shown = slice(None) if frames is None else frames
    return [
        TrueRange(obstacle.name, range_m[shown, column], ahead[shown, column])
        for column, obstacle in enumerate(header.truth.objects)
        if not obstacle.structure
    ]
