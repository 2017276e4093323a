"""What speaks for a landmark and against it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from uwbbench.api import FloatArray, Params, Radar, wrap_one_angle
from uwbbench_detectors.mappers.window import WindowParams


class EvidenceParams(Params):
    """What makes a landmark of what was seen, and what unmakes it."""

    seen: int = Field(2, ge=1, description="Windows in which a landmark is seen before it is confirmed.")
    parallax_deg: float = Field(
        9.0,
        ge=0,
        lt=180,
        description="And directions from which it is seen, apart by this much. The point of a wall that mirrors the "
        "radar lies in one direction however long it is approached, and slides along where the robot passes by.",
    )
    missed: float = Field(
        0.5, ge=0, le=1, description="What a window that should have shown it counts against one that did."
    )
    patience_m: float = Field(
        30.0, gt=0, description="A landmark that is not confirmed is dropped after so much travel since it was seen."
    )
    margin_deg: float = Field(
        10.0, ge=0, description="A landmark should be seen this far inside the largest azimuth, and"
    )
    margin_m: float = Field(0.4, ge=0, description="this far inside the range of a window.")


@dataclass
class _Support:
    first_rad: float
    seen: int = 0
    missed: int = 0
    seen_at_m: float = 0.0
    least_rad: float = 0.0
    most_rad: float = 0.0
    confirmed: bool = False


class Evidence:
    """Windows in which landmarks were seen, or should have been, and from where.

    Parameters
    ----------
    params : EvidenceParams
    window : WindowParams
        What a window shows.
    radars : mapping of str to Radar
    """

    def __init__(self, params: EvidenceParams, window: WindowParams, radars: Mapping[str, Radar]) -> None:
        self._params, self._window = params, window
        self._mounts = [(np.array(radar.mount_position_m[:2]), radar.mount_yaw_rad) for radar in radars.values()]
        self._support: dict[int, _Support] = {}
        self._travel_m = 0.0

    @property
    def handles(self) -> list[int]:
        """Landmarks that anything is known of."""
        return list(self._support)

    def knows(self, handle: int) -> bool:
        """Whether a landmark has not been forgotten."""
        return handle in self._support

    def travel(self, way_m: float) -> None:
        """Count the way that the robot goes."""
        self._travel_m += way_m

    def confirmed(self, handle: int) -> bool:
        """Whether a landmark has been seen often enough, and from directions that differ enough."""
        return self._support[handle].confirmed

    def see(self, handle: int, pose: FloatArray, place_m: FloatArray) -> None:
        """Count a window that has shown a landmark.

        Parameters
        ----------
        handle : int
        pose : (3,) array
            Of the robot.
        place_m : (2,) array
            Of the landmark.
        """
        direction = math.atan2(place_m[1] - pose[1], place_m[0] - pose[0])
        known = self._support.setdefault(handle, _Support(direction))
        known.seen += 1
        known.seen_at_m = self._travel_m
        turned = wrap_one_angle(direction - known.first_rad)
        known.least_rad, known.most_rad = min(known.least_rad, turned), max(known.most_rad, turned)
        p = self._params
        parallax = known.most_rad - known.least_rad
        known.confirmed |= known.seen >= p.seen and parallax >= math.radians(p.parallax_deg)

    def miss(self, handle: int) -> None:
        """Count a window that should have shown a landmark."""
        self._support[handle].missed += 1

    def refuted(self) -> list[int]:
        """Landmarks that more speaks against than for, and those that were never confirmed and not seen for long."""
        oldest_m = self._travel_m - self._params.patience_m
        return [
            handle
            for handle, known in self._support.items()
            if self._params.missed * known.missed >= known.seen or (not known.confirmed and known.seen_at_m < oldest_m)
        ]

    def forget(self, handle: int) -> None:
        """Drop what is known of a landmark that is no more."""
        del self._support[handle]

    def expects(self, pose: FloatArray, place_m: FloatArray) -> bool:
        """Whether a receiver should see a place.

        Parameters
        ----------
        pose : (3,) array
            Of the robot.
        place_m : (2,) array
        """
        p, w = self._params, self._window
        cosine, sine = math.cos(pose[2]), math.sin(pose[2])
        east, north = place_m[0] - pose[0], place_m[1] - pose[1]
        x, y = cosine * east + sine * north, cosine * north - sine * east
        for mount_m, yaw_rad in self._mounts:
            ahead, aside = x - mount_m[0], y - mount_m[1]
            range_m = math.hypot(ahead, aside)
            azimuth_rad = wrap_one_angle(math.atan2(aside, ahead) - yaw_rad)
            in_range = w.nearest_m + p.margin_m <= range_m <= w.farthest_m - p.margin_m
            if in_range and abs(azimuth_rad) <= math.radians(w.azimuth_deg - p.margin_deg):
                return True
        return False
