"""Returns that come from nothing in the scene."""

from __future__ import annotations

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import SPEED_OF_LIGHT_M_S, Params, Paths, Term, View


class OutlierParams(Params):
    """How often, how strong and where."""

    share: float = Field(0.01, ge=0, le=1, description="Probability that a frame has one.")
    lowest_db: float = Field(-20.0, description="Level of the weakest, in power against the direct path.")
    highest_db: float = Field(0.0, description="Level of the strongest; levels in between are equally likely.")
    from_m: float = Field(0.3, ge=0, description="Nearest range that one appears at.")
    to_m: float = Field(7.0, gt=0, description="Farthest; ranges in between are equally likely.")

    @model_validator(mode="after")
    def _ordered(self) -> OutlierParams:
        for low, high in (("lowest_db", "highest_db"), ("from_m", "to_m")):
            if getattr(self, low) > getattr(self, high):
                raise ValueError(f"{low} must not lie above {high}")
        return self


class Outliers(Term[OutlierParams]):
    """Rare far outliers: with some probability a frame holds one pulse of another transmitter, at a random range.

    Range, level, phase and direction are drawn anew for each frame, so that no two frames agree on it.
    """

    def bound(self, view: View) -> float:
        """The strongest outlier; nothing where there is none."""
        return view.direct_amplitude * 10 ** (self.params.highest_db / 20) if self.params.share else 0.0

    def paths(self, view: View, rng: np.random.Generator) -> Paths:
        """One path a frame, which most frames have no strength for."""
        p, frames = self.params, len(view)
        shown = rng.random(frames) < p.share
        range_m = rng.uniform(p.from_m, p.to_m, frames)
        level = 10 ** (rng.uniform(p.lowest_db, p.highest_db, frames) / 20)
        turned = np.exp(2j * np.pi * rng.random(frames))
        azimuth_rad = rng.uniform(-np.pi / 2, np.pi / 2, frames)
        delay_s = 2 * range_m / SPEED_OF_LIGHT_M_S
        amplitude = shown * view.direct_amplitude * level * turned
        return Paths(delay_s[:, None], amplitude[:, None], azimuth_rad[:, None])
