"""What an experiment may say about how calls are timed."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from uwbbench.api import registry
from uwbbench.config.model import ConfigModel


class LatencyModel(ConfigModel):
    """How calls are timed."""

    enabled: bool = True
    captures: Literal["first", "all"] = Field(default="first", description="Captures of each dataset that are timed.")
    frames: int = Field(default=2000, ge=1, description="Frames timed at most, from the start of a capture.")
    warmup_windows: int = Field(default=10, ge=2, description="Windows of warm-up at most, if they never agree.")
    reference: str | None = Field(
        default_factory=lambda: registry.default("detector.reference"),
        description="Detector that each one is compared with, in alternating blocks; null: none.",
    )
    blocks: int = Field(default=100, ge=8, description="Alternating blocks at least; more give a narrower interval.")
    paced_s: float | None = Field(
        default=None, gt=0, description="Also hand out frames at a fixed rate for this long; null: do not."
    )
    rate_hz: float | None = Field(default=None, gt=0, description="That rate; null: the capture's own.")
    timeout_s: float = Field(
        default=600.0, gt=0, description="A measurement that takes longer has failed; the paced pass is not counted."
    )
