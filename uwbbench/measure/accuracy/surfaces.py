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
from uwbbench.api.geometry import inside, receiver_pose, segments_cross, wrap_angle
from uwbbench.api.mapper import Grid, Map
from uwbbench.api.radar import Radar
from uwbbench.api.truth import Obstacle
from uwbbench.measure.accuracy.region import Region

SPACING_M = 0.02
"""Largest distance between neighbouring points of a surface."""

LOOK_M, LOOK_RAD = 0.05, math.radians(2.5)
"""Travel and turn after which a receiver is asked again what it sees."""

CELL_M = 0.10
"""Side of the cells in which surfaces are compared."""

MOST_PAIRS = 50_000
"""Of points and places to see them from that are looked at together."""


class Surface(NamedTuple):
    """Points of surfaces.

    Parameters
    ----------
    points_m : (n, 2) array
    owner : (n,) int array
        Which object each is of.
    outward : (n, 2) array
        Unit vector away from what the outline encloses; zeros where it encloses nothing.
    """

    points_m: FloatArray
    owner: IntArray
    outward: FloatArray

    def take(self, rows: IntArray | BoolArray) -> Surface:
        """Some of the points, by number or by mask."""
        return Surface(self.points_m[rows], self.owner[rows], self.outward[rows])


def along(segments_m: FloatArray, spacing_m: float = SPACING_M) -> FloatArray:
    """Points (n, 2) along segments: each is cut into equal parts no longer than asked for, whose middles are taken.

    Parameters
    ----------
    segments_m : (k, 2, 2) array
        Start and end of each.
    spacing_m : float
    """
    return _sampled(segments_m, spacing_m)[0]


def _sampled(segments_m: FloatArray, spacing_m: float) -> tuple[FloatArray, IntArray]:
    """Points (n, 2) along segments, and the segment (n,) that each is of."""
    edge = segments_m[:, 1] - segments_m[:, 0]
    parts = np.maximum(np.ceil(np.hypot(*edge.T) / spacing_m - 1e-9), 1).astype(np.int64)
    owner = np.repeat(np.arange(len(segments_m)), parts)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(parts) - parts, parts)
    share = (place + 0.5) / parts[owner]
    return np.asarray(segments_m[owner, 0] + share[:, None] * edge[owner]), owner


def outlines(objects: Sequence[Obstacle], spacing_m: float = SPACING_M) -> Surface:
    """Points of the outlines of all objects that do not move.

    Parameters
    ----------
    objects : sequence of Obstacle
    spacing_m : float
    """
    made = [Surface(np.zeros((0, 2)), np.zeros(0, np.int64), np.zeros((0, 2)))]
    for number, item in enumerate(objects):
        if item.moves:
            continue
        corners_m = _corners(item)
        edges = np.stack([corners_m, np.roll(corners_m, -1, axis=0)], axis=1)
        edges = edges[:1] if len(corners_m) == 2 else edges  # a line is no way there and back
        points_m, edge = _sampled(edges, spacing_m)
        owner = np.full(len(points_m), number, np.int64)
        made.append(Surface(points_m, owner, _outward(edges, corners_m)[edge]))
    return Surface(*(np.concatenate(column) for column in zip(*made, strict=True)))


def _corners(item: Obstacle) -> FloatArray:
    """Outline (vertices, 2) in the plane of an object that does not move."""
    return np.asarray(item.outline_m, np.float64)[:, :2]


def _outward(edges: FloatArray, corners_m: FloatArray) -> FloatArray:
    """Unit vectors (k, 2) away from what an outline encloses, at each of its edges; zeros where that is nothing."""
    x, y = corners_m.T
    area = float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
    along_m = edges[:, 1] - edges[:, 0]
    length_m = np.hypot(*along_m.T)[:, None]
    right = np.stack([along_m[:, 1], -along_m[:, 0]], axis=1)
    return np.asarray(np.sign(area) * right / np.where(length_m > 0, length_m, np.inf))


_last: list[tuple[CaptureHeader, Region, Surface]] = []


def seen(header: CaptureHeader, region: Region) -> Surface:
    """Points of outlines that any receiver of a run could have seen in the region.

    The last answer is kept, as the mappers of a run are judged one after the other.

    Parameters
    ----------
    header : CaptureHeader
        With truth.
    region : Region
    """
    for known, where, surface in _last:
        if known is header and where == region:
            return surface
    found = _seen(header, region)
    _last[:] = [(header, region, found)]
    return found


def _seen(header: CaptureHeader, region: Region) -> Surface:
    objects = () if header.truth is None else header.truth.objects
    surface = outlines(objects)
    still = {number: _corners(item) for number, item in enumerate(objects) if not item.moves}
    hiding = {number: corners_m for number, corners_m in still.items() if len(corners_m) > 1}
    known = np.zeros(len(surface.owner), bool)
    for radar in header.radars or (header.radar,):
        eyes_m, heading_rad = _eyes(header, radar)
        enclosed = np.zeros((len(objects), len(eyes_m)), bool)
        for number, corners_m in hiding.items():
            enclosed[number] = len(corners_m) > 2 and inside(eyes_m, corners_m)
        low_m, high_m = region.limits_m(radar)
        for places in _spread(len(eyes_m), len(known)):
            left = np.flatnonzero(~known)
            ways_m = surface.points_m[left, None] - eyes_m[places]
            range_m = np.hypot(ways_m[..., 0], ways_m[..., 1])
            aside_rad = wrap_angle(np.arctan2(ways_m[..., 1], ways_m[..., 0]) - heading_rad[places])
            asked = (range_m >= low_m) & (range_m <= high_m) & (np.abs(aside_rad) <= region.widest_rad(radar))
            towards = np.einsum("pek,pk->pe", ways_m, surface.outward[left])
            asked &= np.where(enclosed[surface.owner[left]][:, places], towards >= 0, towards <= 0)
            point, eye = np.nonzero(asked)
            from_m, to_m = eyes_m[places][eye], surface.points_m[left[point]]
            clear = np.ones(len(point), bool)
            for corners_m in hiding.values():
                rows = np.flatnonzero(clear)
                rows = rows[_comes_near(from_m[rows], to_m[rows], corners_m)]
                clear[rows] = ~segments_cross(from_m[rows], to_m[rows], corners_m)
            known[left[point[clear]]] = True
    return surface.take(known)


def _comes_near(from_m: FloatArray, to_m: FloatArray, corners_m: FloatArray) -> BoolArray:
    """Whether ways (n,) meet the circle around an outline; any other is not stopped by it."""
    middle_m = (corners_m.min(axis=0) + corners_m.max(axis=0)) / 2
    radius2 = float(((corners_m - middle_m) ** 2).sum(axis=1).max()) * (1 + 1e-9)
    way_m, offset_m = to_m - from_m, middle_m - from_m
    share = np.clip((offset_m * way_m).sum(axis=1) / np.maximum((way_m**2).sum(axis=1), 1e-300), 0.0, 1.0)
    return np.asarray(((offset_m - share[:, None] * way_m) ** 2).sum(axis=1) <= radius2)


def _eyes(header: CaptureHeader, radar: Radar) -> tuple[FloatArray, FloatArray]:
    """Places (n, 2) and headings (n,) of a receiver, without those that it hardly left."""
    track = header.trajectory
    moved = np.hypot(*np.diff(track.position_m[:, :2], axis=0).T) / LOOK_M
    moved += np.abs(wrap_angle(np.diff(track.yaw_rad))) / LOOK_RAD
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
