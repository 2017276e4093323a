"""Points of the front ends over a short way, and the places where they gather."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from uwbbench.api import Detections, FloatArray, Params, Radar, compose


class WindowParams(Params):
    """Which points count, how long they are gathered, and what makes a cluster of them."""

    travel_m: float = Field(0.6, gt=0, description="Way over which points are gathered. Windows do not overlap.")
    turn_rad: float = Field(1.5, gt=0, description="A window ends after as much turning too.")
    nearest_m: float = Field(0.5, ge=0, description="Smallest range.")
    farthest_m: float = Field(3.5, gt=0, description="Largest range.")
    azimuth_deg: float = Field(75.0, gt=0, le=180, description="Largest azimuth to either side of the boresight.")
    eps_m: float = Field(0.15, gt=0, description="Neighbourhood radius of DBSCAN.")
    min_samples: int = Field(6, ge=1, description="Points in the neighbourhood of a core point, itself included.")
    standing_m: float = Field(
        1e-4, ge=0, description="A step shorter than this adds no points: what stands still sees the same again."
    )
    standing_rad: float = Field(1e-4, ge=0, description="The same for turns.")


@dataclass(frozen=True)
class Gathered:
    """A cluster of points, in the robot's frame at the end of the window.

    Attributes
    ----------
    place_m : (2,) array
        Medians of x and y.
    spread_m : float
        Median distance of the points from there.
    points : int
    """

    place_m: FloatArray
    spread_m: float
    points: int


class Way:
    """How far a robot has gone since a window began.

    Parameters
    ----------
    params : WindowParams
    """

    def __init__(self, params: WindowParams) -> None:
        self._params = params
        self._first = True
        self.begin()

    def begin(self) -> None:
        """Count from here."""
        self._travel_m = self._turn_rad = 0.0

    def add(self, moved: FloatArray) -> bool:
        """Count a step (3,) of odometry; whether it adds points, as the first does and each with a movement."""
        way, turn = math.hypot(moved[0], moved[1]), abs(float(moved[2]))
        self._travel_m += way
        self._turn_rad += turn
        counts = self._first or way > self._params.standing_m or turn > self._params.standing_rad
        self._first = False
        return counts

    @property
    def full(self) -> bool:
        """Whether the robot has gone as far as a window reaches."""
        return self._travel_m >= self._params.travel_m or self._turn_rad >= self._params.turn_rad


class Window:
    """Gathers points in the frame of odometry, where those of what stands still lie on each other.

    Each point is in one window only, as the same data in two would be counted twice.

    Parameters
    ----------
    params : WindowParams
    radars : mapping of str to Radar
        By receiver.
    """

    def __init__(self, params: WindowParams, radars: Mapping[str, Radar]) -> None:
        self._params = params
        self._mounts = {
            name: np.array([*radar.mount_position_m[:2], radar.mount_yaw_rad]) for name, radar in radars.items()
        }
        self._way = Way(params)
        self.clear()

    def clear(self) -> None:
        """Forget the points so far, as where they and those to come have no frame in common."""
        self._pose: FloatArray = np.zeros(3)
        self._way.begin()
        self._points: list[FloatArray] = []

    def add(self, moved: FloatArray, found: Mapping[str, Detections]) -> None:
        """Take in a step.

        Parameters
        ----------
        moved : (3,) array
            Odometry since the step before.
        found : mapping of str to Detections
            By receiver. Rows whose range or azimuth is not finite are left out.
        """
        self._pose = compose(self._pose, moved)
        if self._way.add(moved):
            self._points += [self._points_of(name, rows) for name, rows in found.items() if len(rows)]

    @property
    def full(self) -> bool:
        """Whether the robot has gone as far as a window reaches."""
        return self._way.full

    def take(self) -> list[Gathered]:
        """Clusters of the points, and begin the next window."""
        points = np.concatenate(self._points) if self._points else np.zeros((0, 2))
        pose = self._pose
        self.clear()
        if len(points) < self._params.min_samples:
            return []
        from uwbbench_detectors.clusters.incremental import dbscan  # compiled

        labels, _ = dbscan(points, self._params.eps_m, self._params.min_samples)
        cosine, sine = math.cos(pose[2]), math.sin(pose[2])
        here = (points - pose[:2]) @ np.array([[cosine, -sine], [sine, cosine]])
        clusters = []
        for label in range(int(labels.max(initial=-1)) + 1):
            members = here[labels == label]
            place_m = np.median(members, axis=0)
            spread_m = float(np.median(np.hypot(*(members - place_m).T)))
            clusters.append(Gathered(place_m, spread_m, len(members)))
        return clusters

    def _points_of(self, receiver: str, rows: Detections) -> FloatArray:
        """Places (n, 2) of the rows that count, in the frame in which the window began."""
        p = self._params
        range_m, azimuth_rad = rows.range_m, rows.azimuth_rad
        counts = (range_m >= p.nearest_m) & (range_m <= p.farthest_m)
        counts &= np.abs(azimuth_rad) <= math.radians(p.azimuth_deg)
        pose = compose(self._pose, self._mounts[receiver])
        heading = pose[2] + azimuth_rad[counts]
        return np.asarray(pose[:2] + range_m[counts, None] * np.column_stack([np.cos(heading), np.sin(heading)]))
