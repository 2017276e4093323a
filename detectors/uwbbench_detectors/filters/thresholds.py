"""Filters: each keeps the detections whose value lies inside its limits, and none whose value is NaN."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import Block, BoolArray, Filter, Limit, LimitFilter, Params, Radar, ports


def _check_order(minimum: float | None, maximum: float | None, unit: str) -> None:
    if minimum is not None and maximum is not None and minimum > maximum:
        raise ValueError(f"minimum{unit} ({minimum:g}) lies above maximum{unit} ({maximum:g}): nothing could pass")


class ProminenceFilterParams(Params):
    """Least prominence."""

    minimum: float = Field(
        ge=0,
        description="In units of the profile. With profile.minmax that is relative to the strongest tap, normally the "
        "direct path: 6 dB more isolation between the antennas doubles every prominence, and a direct path 1 000 "
        "times the target hides it at 0.05.",
    )


class ProminenceFilter(LimitFilter[ProminenceFilterParams]):
    """Keep peaks that stand out of their surroundings (arXiv 2512.01018)."""

    consumes: ClassVar[frozenset[str]] = ports("detections", "prominence")
    limits: ClassVar[Mapping[str, Limit]] = {"minimum": Limit("prominence", "least")}
    fidelity = "from-source"


class WidthFilterParams(Params):
    """Range of widths."""

    minimum: float = Field(
        ge=0,
        description="In taps. No width at half prominence is below 0.5, so 0.10 and 0.20 filter nothing; 1 removes 39 "
        "% of the peaks of white noise and 32 % of filter-correlated noise, 2 removes 82 % and 69 %.",
    )
    maximum: float | None = Field(None, gt=0, description="In taps; null: no limit.")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        _check_order(self.minimum, self.maximum, "")
        return self


class WidthFilter(LimitFilter[WidthFilterParams]):
    """Keep peaks as wide as the pulse (arXiv 2512.01018)."""

    consumes: ClassVar[frozenset[str]] = ports("detections", "width_taps")
    limits: ClassVar[Mapping[str, Limit]] = {
        "minimum": Limit("width_taps", "least"),
        "maximum": Limit("width_taps", "most"),
    }
    fidelity = "from-source"


class SnrFilterParams(Params):
    """Least score."""

    minimum_db: float = Field(
        description="In dB. With score.snr and white noise a tap at 45 ns passes 10 dB 33 % of the time, and 90 % of "
        "frames of noise alone have a tap that does; 27 % at 15 dB, 1.6 % at 20 dB, 0.03 % at 25 dB."
    )


class SnrFilter(LimitFilter[SnrFilterParams]):
    """Keep detections that stand above the noise (arXiv 2512.01018)."""

    consumes: ClassVar[frozenset[str]] = ports("detections", "score_db")
    limits: ClassVar[Mapping[str, Limit]] = {"minimum_db": Limit("score_db", "least")}
    fidelity = "from-source"


class PdoaFilterParams(Params):
    """Largest phase difference."""

    maximum_rad: float = Field(
        2.1325,
        ge=0,
        description="Largest magnitude of the phase difference. The default is pi sin(0.95 pi / 4), 45 degrees from "
        "boresight on channel 9; on channel 5 the same phase stands for 61 degrees.",
    )


class PdoaFilter(LimitFilter[PdoaFilterParams]):
    """Keep detections inside the sector that the antenna pair resolves (arXiv 2512.01018)."""

    consumes: ClassVar[frozenset[str]] = ports("detections", "pdoa_rad")
    limits: ClassVar[Mapping[str, Limit]] = {"maximum_rad": Limit("pdoa_rad", "most", magnitude=True)}
    fidelity = "from-source"


class FirstPathFilterParams(Params):
    """Distance from the direct path."""

    guard_taps: float = Field(
        1.0,
        ge=0,
        description="Detections must lie more than this behind the first path. With 1 the ringing of the antennas, 1 "
        "to 3 ns behind the crest, beats a metal plate at 3.4 m in about 30 % of frames.",
    )


class FirstPathFilter(Filter[FirstPathFilterParams]):
    """Keep detections behind the direct path (arXiv 2512.01018)."""

    consumes: ClassVar[frozenset[str]] = ports("detections", "tap", "first_path")
    fidelity = "from-source"

    def keep(self, block: Block) -> BoolArray:
        """Mask of the detections behind the guard."""
        earliest = block.part("first_path")[block.rows] + self.params.guard_taps
        return np.asarray(block.detections["tap"] > earliest)


class RangeFilterParams(Params):
    """Span of ranges."""

    minimum_m: float | None = Field(None, description="Nearest range; null: no limit.")
    maximum_m: float | None = Field(None, description="Farthest range; null: no limit.")

    @model_validator(mode="after")
    def _limits_something(self) -> Self:
        if self.minimum_m is None and self.maximum_m is None:
            raise ValueError("give minimum_m, maximum_m or both")
        _check_order(self.minimum_m, self.maximum_m, "_m")
        return self


class RangeFilter(LimitFilter[RangeFilterParams]):
    """Keep detections within a span of ranges."""

    consumes: ClassVar[frozenset[str]] = ports("detections", "range_m")
    limits: ClassVar[Mapping[str, Limit]] = {
        "minimum_m": Limit("range_m", "least"),
        "maximum_m": Limit("range_m", "most"),
    }


class ProbabilityFilterParams(Params):
    """Least probability."""

    minimum: float = Field(
        0.5, ge=0, le=1, description="Where the classes of the examples counted alike, 0.5 makes both errors alike."
    )


class ProbabilityFilter(LimitFilter[ProbabilityFilterParams]):
    """Keep what is probable enough, such as the frames in which a classifier takes something to be there."""

    consumes: ClassVar[frozenset[str]] = ports("detections", "probability")
    limits: ClassVar[Mapping[str, Limit]] = {"minimum": Limit("probability", "least")}


class AzimuthFilterParams(Params):
    """Sector."""

    maximum_deg: float = Field(47.0, gt=0, description="Largest azimuth from boresight, to either side.")


class AzimuthFilter(Filter[AzimuthFilterParams]):
    """Keep what lies in a sector around the boresight."""

    consumes: ClassVar[frozenset[str]] = ports("detections", "azimuth_rad")

    def keep(self, block: Block) -> BoolArray:
        """Mask of the detections in the sector."""
        return np.asarray(np.abs(block.detections.azimuth_rad) <= np.deg2rad(self.params.maximum_deg))


class AngleCostFilterParams(Params):
    """Largest disagreement."""

    maximum: float = Field(
        3.84,
        ge=0,
        description="Sum of the squared deviations of Doppler and phase difference from those of one direction, in "
        "standard deviations: two measurements of one unknown leave chi squared of one degree, which honest echoes "
        "exceed 3.84 in one case of 20.",
    )


class AngleCostFilter(LimitFilter[AngleCostFilterParams]):
    """Keep what arrives from the direction that its Doppler speaks of, as echoes by way of one reflection do."""

    consumes: ClassVar[frozenset[str]] = ports("detections", "angle_cost")
    limits: ClassVar[Mapping[str, Limit]] = {"maximum": Limit("angle_cost", "most")}


class ReflectionFilterParams(Params):
    """Weakest mirror."""

    minimum_db: float = Field(
        -18.0,
        description="Amplitude relative to that of a perfect mirror. Plaster and wood reflect -8 to -15 dB, what is "
        "smaller than the first Fresnel zone less; isolation between the antennas adds to all amplitudes, 6 to 12 dB "
        "on the robots that are known.",
    )


class ReflectionFilter(Filter[ReflectionFilterParams]):
    """Keep what reflects well enough for an obstacle, whatever its range.

    A perfect mirror at range r shows the transmitter's image at the distance 2 r, while the direct path has flown the
    baseline D: in frames that are relative to the direct path its amplitude is ``D / (2 r)``, so that
    ``20 log10(2 r A / D)`` is its reflection in decibels, plus the isolation between the antennas. Needs frames that
    are scaled to the direct path, as by ``align.template``.

    Where transmitter and receiver are in one place all detections pass, with a note.
    """

    consumes: ClassVar[frozenset[str]] = ports("detections", "amplitude", "range_m")

    def open(self, radar: Radar) -> None:
        """Look up the baseline."""
        super().open(radar)
        if radar.baseline_length_m == 0:
            self.note(
                "filter.reflection left out: transmitter and receiver are in one place, and no baseline scales it"
            )
        self.least = radar.baseline_length_m / 2 * 10 ** (self.params.minimum_db / 20)

    def keep(self, block: Block) -> BoolArray:
        """Mask of the detections that reflect well enough."""
        return np.asarray(block.detections["amplitude"] * block.detections.range_m >= self.least)
