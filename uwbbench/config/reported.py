"""Figures that the source of a method reports of it."""

from __future__ import annotations

from pydantic import Field

from uwbbench.config.model import ConfigModel


class ReportedFigures(ConfigModel):
    """What a source says of its own detector, to be shown beside what a run measures; never a target."""

    figures: str = Field(min_length=1, description="The figures with their metric and unit, as the source names them.")
    of: str = Field(min_length=1, description="What they were measured on, and what is not known of that.")
    source: str = Field(min_length=1, description="Where they are printed.")
    metrics: list[str] = Field(
        default_factory=list, description="Registered metrics that come nearest, which a report shows beside them."
    )
