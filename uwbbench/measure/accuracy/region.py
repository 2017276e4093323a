"""Where a detector is asked to find obstacles."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uwbbench.api.errors import ScoringError
from uwbbench.api.radar import Radar


@dataclass(frozen=True)
class Region:
    """Where a detector is asked to find obstacles, seen from the receiver.

    Parameters
    ----------
    min_range_m : float
        Radius of the blind zone, 0.6 m for the paper's radar.
    max_range_m : float or None
        None: as far as the radar's taps reach.
    half_angle_rad : float or None
        Largest azimuth to either side of boresight. None: 45 degrees for a radar with two antennas, which can measure
        the angle, else 90 degrees.

    Raises
    ------
    ScoringError
        If the region is empty.
    """

    min_range_m: float = 0.6
    max_range_m: float | None = None
    half_angle_rad: float | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.min_range_m < math.inf:
            raise ScoringError(f"region: min_range_m must be at least 0 m, not {self.min_range_m}")
        if self.max_range_m is not None and not self.min_range_m < self.max_range_m:
            raise ScoringError(f"region: max_range_m {self.max_range_m} must exceed min_range_m {self.min_range_m}")
        if self.half_angle_rad is not None and not 0 < self.half_angle_rad <= math.pi:
            raise ScoringError(f"region: half_angle_rad must lie in (0, pi], not {self.half_angle_rad}")

    def limits_m(self, radar: Radar) -> tuple[float, float]:
        """Smallest and largest range for a radar."""
        farthest = radar.window_m if self.max_range_m is None else self.max_range_m
        if not self.min_range_m < farthest:
            raise ScoringError(
                f"region: the radar's window ends at {farthest:.3g} m, min_range_m is {self.min_range_m}"
            )
        return self.min_range_m, farthest

    def widest_rad(self, radar: Radar) -> float:
        """Largest azimuth for a radar."""
        if self.half_angle_rad is not None:
            return self.half_angle_rad
        return math.pi / 4 if radar.has_sts else math.pi / 2
