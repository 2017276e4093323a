"""How detections are counted and how sure the numbers are, as files say it."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, ValidationInfo, field_validator

from uwbbench.config.model import ConfigModel

Scoring = Literal["frame", "peak", "object", "latest", "track", "segment", "presence", "pose", "map"]
"""What counts as one chance to be right: a frame, a peak, an object in a frame, the latest answer, a track, ..."""

Table = Literal["filtering", "mapping"]
"""After which half of a detector: its filters, or its clustering."""

Surface = Literal["outline", "visible"]
"""What the error of a position is the distance to: the outline, 0 inside it, or what the receiver sees of it."""

GateRadius = Annotated[float, Field(default=0.20, gt=0, description="Largest error of a true detection.")]
"""In metres."""

Strongest = Annotated[
    int | None,
    Field(default=None, ge=1, description="Score only that many detections of a frame, the strongest."),
]


class RegionModel(ConfigModel):
    """Where detectors are asked to find obstacles, seen from the receiver."""

    min_range_m: float = Field(default=0.6, ge=0, description="Radius of the blind zone.")
    max_range_m: float | None = Field(default=None, gt=0, description="Farthest range; null: as far as the taps reach.")
    half_angle_deg: float | None = Field(
        default=None, gt=0, le=180, description="Widest azimuth to either side; null: 45 with two antennas, else 90."
    )

    @field_validator("max_range_m")
    @classmethod
    def _not_empty(cls, value: float | None, info: ValidationInfo) -> float | None:
        least = info.data.get("min_range_m")
        if value is not None and least is not None and value <= least:
            raise ValueError(f"must exceed min_range_m {least}")
        return value

    @property
    def half_angle_rad(self) -> float | None:
        """The same in radians."""
        return None if self.half_angle_deg is None else math.radians(self.half_angle_deg)

    @property
    def limits(self) -> dict[str, Any]:
        """Values of a :class:`~uwbbench.measure.accuracy.region.Region`, in metres and radians."""
        limits = {"min_range_m": self.min_range_m, "max_range_m": self.max_range_m}
        return {**limits, "half_angle_rad": self.half_angle_rad}


class MetricsModel(ConfigModel):
    """Exactly which metrics are shown, and where."""

    rank: str | None = Field(default=None, description="Metric that ranks; null: the first default one that can.")
    table: list[str] | None = Field(
        default=None, min_length=1, description="Columns of tables, in this order; null: the default ones."
    )
    charts: list[str] | None = Field(
        default=None,
        min_length=1,
        description="Metrics that are charted and compared in pairs; null: the default ones.",
    )


def _kind_of_metrics(value: Any) -> str:
    """Which of two forms a value has, so that a mistake in one is not taken for one in the other as well."""
    return "MetricsModel" if isinstance(value, dict | MetricsModel) else "list"


MetricsUse = Annotated[
    Annotated[list[str], Tag("list")] | Annotated[MetricsModel, Tag("MetricsModel")], Discriminator(_kind_of_metrics)
]
"""Metrics besides the default ones, or exactly which are shown where."""


class IntervalModel(ConfigModel):
    """How uncertainty is estimated."""

    resamples: int = Field(
        default=1000, ge=100, le=1_000_000, description="No longer used: intervals need no resampling."
    )
    confidence: float = Field(default=0.95, gt=0, lt=1)
