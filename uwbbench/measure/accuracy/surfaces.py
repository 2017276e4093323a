"""Surfaces in the plane: what a robot could have seen of the outlines around it, and what a map says is there.

Conventions
-----------
* Surfaces are points: lines and outlines are sampled every :data:`SPACING_M`.
* Of the outlines those points count that came into the region of any receiver during the run: within its ranges and
  azimuths, and with nothing in between, be it the object's own other side. Structure counts as well. What moves is no
  part of a map; it neither counts nor hides anything.
* A map says that something is at its points, along its segments, at its point landmarks, and in the middle of the grid
  cells that are more probably occupied than not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.capture import CaptureHeader
from uwbbench.api.geometry import receiver_pose, segments_cross, wrap_angle
from uwbbench.api.mapper import Grid, Map
from uwbbench.api.radar import Radar
from uwbbench.api.truth import Obstacle
from uwbbench.measure.accuracy.region import Region

SPACING_M = 0.02
"""Largest distance between neighbouring points of a surface."""

STEP_RAD = math.radians(1.0)
"""A turn after which a receiver is asked again what it sees; as after :data:`SPACING_M` of travel."""

CELL_M = 0.10
"""Side of the cells in which surfaces are compared."""

MOST_PAIRS = 200_000
"""Of points and places to see them from that are looked at together; bounds the memory."""


class Surface(NamedTuple):
    """Points of surfaces.

    Parameters
    ----------
    points_m : (n, 2) array
    owner : (n,) int array
        Which object each is of.
    """

    points_m: FloatArray
    owner: IntArray

    def take(self, rows: IntArray | BoolArray) -> Surface:
        """Some of the points, by number or by mask."""
        return Surface(self.points_m[rows], self.owner[rows])


def along(segments_m: FloatArray, spacing_m: float = SPACING_M) -> FloatArray:
    """Points (n, 2) along segments: each is cut into equal parts no longer than asked for, whose middles are taken.

    Parameters
    ----------
    segments_m : (k, 2, 2) array
        Start and end of each.
    spacing_m : float
    """
    edge = segments_m[:, 1] - segments_m[:, 0]
    parts = np.maximum(np.ceil(np.hypot(*edge.T) / spacing_m - 1e-9), 1).astype(np.int64)
    owner = np.repeat(np.arange(len(segments_m)), parts)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(parts) - parts, parts)
    share = (place + 0.5) / parts[owner]
    return np.asarray(segments_m[owner, 0] + share[:, None] * edge[owner])


def outlines(objects: Sequence[Obstacle], spacing_m: float = SPACING_M) -> Surface:
    """Points of the outlines of all objects that do not move.

    Parameters
    ----------
    objects : sequence of Obstacle
    spacing_m : float
    """
    made = [Surface(np.zeros((0, 2)), np.zeros(0, np.int64))]
    for number, item in enumerate(objects):
        if not item.moves:
            vertices = np.asarray(item.outline_m, float)[:, :2]
            edges = np.stack([vertices, np.roll(vertices, -1, axis=0)], axis=1)
            points_m = along(edges[:1] if len(vertices) == 2 else edges, spacing_m)  # a line is no way there and back
            made.append(Surface(points_m, np.full(len(points_m), number, np.int64)))
    return Surface(*(np.concatenate(column) for column in zip(*made, strict=True)))


def seen(header: CaptureHeader, region: Region) -> Surface:
    """Points of outlines that any receiver of a run could have seen in the region.

    Parameters
    ----------
    header : CaptureHeader
        With truth.
    region : Region
    """
    objects = () if header.truth is None else header.truth.objects
    surface = outlines(objects)
    still = [np.asarray(item.outline_m, float)[:, :2] for item in objects if not item.moves]
    hiding = [vertices for vertices in still if len(vertices) > 1]
    known = np.zeros(len(surface.owner), bool)
    for radar in header.radars or (header.radar,):
        eyes_m, heading_rad = _eyes(header, radar)
        low_m, high_m = region.limits_m(radar)
        for places in _spread(len(eyes_m), len(known)):
            left = np.flatnonzero(~known)
            if not len(left):
                break
            way_m = surface.points_m[left, None] - eyes_m[places]
            range_m = np.hypot(way_m[..., 0], way_m[..., 1])
            aside_rad = wrap_angle(np.arctan2(way_m[..., 1], way_m[..., 0]) - heading_rad[places])
            asked = (range_m >= low_m) & (range_m <= high_m) & (np.abs(aside_rad) <= region.widest_rad(radar))
            point, eye = np.nonzero(asked)
            clear = np.ones(len(point), bool)
            for vertices in hiding:
                rows = np.flatnonzero(clear)
                ends = eyes_m[places][eye[rows]], surface.points_m[left[point[rows]]]
                clear[rows] = ~segments_cross(*ends, vertices)
            known[left[point[clear]]] = True
    return surface.take(known)


def _eyes(header: CaptureHeader, radar: Radar) -> tuple[FloatArray, FloatArray]:
    """Places (n, 2) and headings (n,) of a receiver, without those that it hardly left."""
    track = header.trajectory
    moved = np.hypot(*np.diff(track.position_m[:, :2], axis=0).T) / SPACING_M
    moved += np.abs(wrap_angle(np.diff(track.yaw_rad))) / STEP_RAD
    _, kept = np.unique(np.floor(np.concatenate([[0.0], np.cumsum(moved)])[: len(track)]), return_index=True)
    mount_m = np.asarray(radar.mount_position_m)
    place_m, heading_rad = receiver_pose(track.position_m[kept], track.yaw_rad[kept], mount_m, radar.mount_yaw_rad)
    return place_m[:, :2], heading_rad


def _spread(count: int, points: int) -> Iterator[IntArray]:
    """All places in bunches, each spread over the whole run: most points are seen by the first, and asked no more."""
    bunches = max(1, -(-count * max(points, 1) // MOST_PAIRS))
    for first in range(bunches):
        yield np.arange(first, count, bunches)


def points_of(found: Map) -> FloatArray:
    """Points (n, 2) at which a map says that something is, in its own frame."""
    parts = [along(found.segments_m), found.points_m, found.landmarks.of("point").position_m]
    return np.concatenate([*parts, np.zeros((0, 2)) if found.grid is None else _occupied(found.grid)])


def _occupied(grid: Grid) -> FloatArray:
    """Middles (n, 2) of the occupied cells; of parts of them, where they are larger than what they are compared in."""
    row, column = np.nonzero(grid.log_odds > 0)
    corner_m = grid.origin_m + grid.cell_m * np.stack([column, row], axis=1)
    parts = max(1, math.ceil(grid.cell_m / CELL_M - 1e-9))
    middle_m = (np.arange(parts) + 0.5) * grid.cell_m / parts
    inside_m = np.stack(np.meshgrid(middle_m, middle_m), axis=-1).reshape(-1, 2)
    return np.asarray((corner_m[:, None] + inside_m).reshape(-1, 2))


def distances(from_m: FloatArray, to_m: FloatArray) -> FloatArray:
    """Distance (n,) of each point (n, 2) from the nearest of others (m, 2); inf where there are none."""
    from scipy.spatial import cKDTree

    if not len(from_m) or not len(to_m):
        return np.full(len(from_m), np.inf)
    return np.asarray(cKDTree(to_m).query(from_m)[0], np.float64)


def cells(points_m: FloatArray) -> IntArray:
    """Numbers (n,), rising, of the cells that points lie in, and of all cells around these.

    The ring around them lets neighbouring cells overlap: of a rod that is thinner than a cell, plain cells agree or not
    by chance.

    Parameters
    ----------
    points_m : (n, 2) array
    """
    within = np.floor(np.clip(points_m, -1e7, 1e7) / CELL_M).astype(np.int64)  # their numbers fit, however far off
    around = np.array([(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1)])
    every = (np.unique(within, axis=0)[:, None] + around).reshape(-1, 2)
    return np.unique(every[:, 0] * 2**31 + every[:, 1])
