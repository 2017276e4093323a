"""Which echoes of a stretch of the way come from walls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import Field

from uwbbench.api import BoolArray, FloatArray, Params
from uwbbench_detectors.mappers.echoes import ROUNDS, Echoes, Spread, fit_line, fit_point
from uwbbench_detectors.mappers.line import along, normal

GUESSES = 150
"""Most echoes that a shape is guessed from."""


class WallParams(Params):
    """Which echoes count, how well they are measured, and what makes a wall of them."""

    nearest_m: float = Field(1.2, ge=0, description="Smallest range; nearer than this a radar rings.")
    farthest_m: float = Field(6.0, gt=0, description="Largest range.")
    azimuth_deg: float = Field(50.0, gt=0, le=180, description="Largest azimuth to either side of the boresight.")
    range_sd_m: float = Field(0.08, gt=0, description="Standard deviation of the range of one echo.")
    azimuth_sd_deg: float = Field(10.0, gt=0, description="Standard deviation of the azimuth of one echo.")
    shared_range_sd_m: float = Field(
        0.04, ge=0, description="Standard deviation of what the ranges of a window are off alike."
    )
    shared_azimuth_sd_deg: float = Field(4.0, ge=0, description="The same for azimuths.")
    inlier_m: float = Field(
        0.15, gt=0, description="An echo belongs to a wall whose distance is this close to its range."
    )
    inlier_deg: float = Field(
        27.0, gt=0, description="The same for its direction and the wall's normal; both bounds are those of an ellipse."
    )
    stretch_m: float = Field(2.4, gt=0, description="Way whose echoes new walls are sought in.")
    shortest_m: float = Field(1.9, gt=0, description="A new wall is seen along this length at least.")
    inliers_per_m: float = Field(28.0, gt=0, description="Echoes of a new wall on a metre of it.")
    quadrat_m: float = Field(0.30, gt=0, description="Pieces in which the echoes along a wall are counted.")
    filled: float = Field(0.8, ge=0, le=1, description="Share of a new wall's pieces with at least two echoes.")
    uneven: float = Field(
        3.0,
        gt=0,
        description="Variance of the echoes in a new wall's pieces over their mean. Scattered evenly it is 1; where "
        "the robot drives towards a wall all echoes come from one foot.",
    )
    pointed: float = Field(
        0.8,
        gt=0,
        description="No wall where points, one every two pieces, leave less than this share of the misfit: two rods "
        "and their arcs are as long as a wall.",
    )

    @property
    def spread(self) -> Spread:
        """Standard deviations of one echo."""
        return Spread(self.range_sd_m, np.radians(self.azimuth_sd_deg))

    @property
    def shared(self) -> Spread:
        """Standard deviations of what the echoes of a wall have in common."""
        return Spread(self.shared_range_sd_m, np.radians(self.shared_azimuth_sd_deg))

    @property
    def reach(self) -> Spread:
        """Bounds of what belongs to a wall."""
        return Spread(self.inlier_m, np.radians(self.inlier_deg))


@dataclass(frozen=True)
class Wall:
    """A straight wall in the frame of its echoes.

    Attributes
    ----------
    line : (2,) array
        Distance and direction of the normal.
    covariance : (2, 2) array
        As far as it comes from independent errors of the echoes.
    members : (n,) bool array
        Which of the echoes belong to it.
    """

    line: FloatArray
    covariance: FloatArray
    members: BoolArray


def settle_line(echoes: Echoes, members: BoolArray, line: FloatArray, params: WallParams) -> Wall | None:
    """Refit a line to the echoes that agree with it until these stay the same; None where none do.

    Parameters
    ----------
    echoes : Echoes
    members : (n,) bool array
        Those to begin with.
    line : (2,) array
    params : WallParams
    """
    covariance = np.zeros((2, 2))
    for _ in range(ROUNDS):
        if not members.any():
            return None
        line, covariance = fit_line(echoes.take(members), params.spread, params.shared, line)
        now = params.reach.squared(*echoes.off_line(line)) <= 1
        if np.array_equal(now, members):
            break
        members = now
    return Wall(line, covariance, members) if members.any() else None


def find_walls(echoes: Echoes, params: WallParams) -> list[Wall]:
    """Walls among echoes, by consensus.

    Random sample consensus without randomness: an echo says distance and normal of a wall, so each is a sample, and
    each (of many every second or third) is tried. It is tried as a point too, as echoes of one or two rods agree with a
    wall in part; whatever explains most, by the sum of ``max(0, 1 - squared misfit over bounds)`` (Torr and Zisserman,
    MLESAC, CVIU 78(1), 2000), takes its echoes away from the others.

    Parameters
    ----------
    echoes : Echoes
    params : WallParams

    Returns
    -------
    list of Wall
        Best first.
    """
    fewest = params.inliers_per_m * params.shortest_m
    if len(echoes) < fewest:
        return []
    as_lines, as_points, lines = _agreement(echoes, params.reach)
    free = np.ones(len(echoes), bool)
    walls: list[Wall] = []
    while np.count_nonzero(free) >= fewest:
        lined, pointed = as_lines @ free, as_points @ free
        line, point = int(np.argmax(lined)), int(np.argmax(pointed))
        if np.count_nonzero((as_lines[line] > 0) & free) < fewest / 2:
            break
        if lined[line] >= pointed[point]:
            wall = settle_line(echoes.take(free), as_lines[line][free] > 0, lines[line], params)
            if wall is None:
                break
            members = np.zeros(len(echoes), bool)
            members[np.flatnonzero(free)[wall.members]] = True
            if is_long(echoes.take(members), wall.line, params):
                walls.append(Wall(wall.line, wall.covariance, members))
        else:
            members = (as_points[point] > 0) & free
        free &= ~members
    return walls


def is_long(echoes: Echoes, line: FloatArray, params: WallParams) -> bool:
    """Whether echoes of a line come from a wall: from a long piece of it, from everywhere there, and not from points.

    Parameters
    ----------
    echoes : Echoes
        Those that agree with the line.
    line : (2,) array
    params : WallParams
    """
    foot_m = along(line, echoes.receiver_m)
    length_m = float(np.ptp(foot_m))
    if length_m < params.shortest_m or len(echoes) < params.inliers_per_m * length_m:
        return False
    counts, _ = np.histogram(foot_m, max(1, int(np.ceil(length_m / params.quadrat_m))))
    if np.mean(counts >= 2) < params.filled or np.var(counts) > params.uneven * np.mean(counts):
        return False
    squared = params.spread.squared(*echoes.off_line(line))
    parts = max(1, round(length_m / (2 * params.quadrat_m)))
    part = np.minimum((foot_m - foot_m.min()) * (parts / length_m), parts - 1).astype(int)
    as_points = 0.0
    for number in range(parts):
        own = echoes.take(part == number)
        if len(own):
            point = fit_point(own, params.spread, np.median(own.place_m, axis=0))
            as_points += float(params.spread.squared(*own.off_point(point)).sum())
    return as_points >= params.pointed * float(squared.sum())


def _agreement(echoes: Echoes, reach: Spread) -> tuple[FloatArray, FloatArray, FloatArray]:
    """How well echoes (n,) agree with the lines and with the points that some of them (m,) would be alone.

    Angles are compared by the chord between unit vectors, ``2 - 2 cos``, which costs no arcus.

    Parameters
    ----------
    echoes : Echoes
    reach : Spread
        Where agreement ends.

    Returns
    -------
    (m, n) array, (m, n) array, (m, 2) array
        Agreement with lines, with points, from 0 to 1; the lines.
    """
    sampled = np.arange(0, len(echoes), -(-len(echoes) // GUESSES))
    ahead = normal(echoes.heading_rad)
    place_m = echoes.receiver_m[sampled] + echoes.range_m[sampled, None] * ahead[sampled]
    lines = np.stack([np.sum(place_m * ahead[sampled], axis=1), echoes.heading_rad[sampled]], axis=1)
    farther_m = echoes.range_m - lines[:, :1] + ahead[sampled] @ echoes.receiver_m.T
    as_lines = 1 - (farther_m / reach.range_m) ** 2 - (2 - 2 * (ahead[sampled] @ ahead.T)) / reach.heading_rad**2
    offset = place_m[:, None] - echoes.receiver_m
    reach_m = np.hypot(offset[..., 0], offset[..., 1])
    cosine = (offset[..., 0] * ahead[:, 0] + offset[..., 1] * ahead[:, 1]) / np.maximum(reach_m, 1e-9)
    squared = ((echoes.range_m - reach_m) / reach.range_m) ** 2 + (2 - 2 * cosine) / reach.heading_rad**2
    return np.maximum(as_lines, 0), np.maximum(1 - squared, 0), lines
