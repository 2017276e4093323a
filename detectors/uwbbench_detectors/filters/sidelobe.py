"""Detections that may be side lobes of stronger ones."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import Block, BoolArray, Filter, FloatArray, Params, Radar, ports
from uwbbench_detectors.integrate.motion import plain


class SidelobeParams(Params):
    """What a side lobe can be."""

    width_ns: float | None = Field(
        None,
        gt=0,
        description="Width of a pulse between half amplitudes, as it arrives here; null: 1.2 over the bandwidth, times "
        "a root of two behind a matched filter.",
    )
    matched: bool = Field(True, description="Whether the responses have passed a matched filter.")
    lobe_db: float = Field(
        -18.0, le=0, description="Highest side lobe of the pulse, at its crest; a tail that electronics leave."
    )
    fall_db_per_tap: float = Field(3.0, ge=0, description="By which side lobes fall with the distance in range.")
    far_db: float = Field(-40.0, le=0, description="Side lobes at any distance in range.")
    margin_db: float = Field(4.0, description="By which two peaks in one place may differ from their sum.")


class SidelobeFilter(Filter[SidelobeParams]):
    """Drops a detection that may be a side lobe of a stronger one of its frame, in range or in angle.

    A peak of power P0 at tap t0 and cosine u0 has power ``P0 R(t - t0) / (1 + ((u - u0) / w)^2)`` elsewhere: R the
    pulse in range, the second factor the response of an exponential sum over a way of L metres to another direction,
    with the spread ``w = lambda / (4 pi L)`` that ``integrate.doppler_range`` gives as ``motion_cosine_sd``. What is
    weaker than that, plus a margin as two echoes may add in phase, could be its side lobe and is dropped; whatever is
    stronger cannot be, however strong the other is. Without columns of a cosine the range alone counts.

    Only what is a row can mask: filters that drop strong rows, such as the direct path's, come behind this one.
    """

    consumes: ClassVar[frozenset[str]] = ports("detections", "tap", "score_db")
    rowwise = False

    def open(self, radar: Radar) -> None:
        """Work out the width of the pulse in taps."""
        super().open(radar)
        from uwbbench_detectors.filters import sidelobe_loops as loops

        p = self.params
        self._unmasked: Callable[..., BoolArray] = loops.unmasked
        width_s = 1.2 / radar.bandwidth_hz if p.width_ns is None else p.width_ns * 1e-9
        if p.matched and p.width_ns is None:
            width_s *= np.sqrt(2)
        self.at: FloatArray = np.zeros(loops.SETTINGS)
        self.at[loops.PULSE_TAPS] = width_s / radar.sample_interval_s / 2 / np.sqrt(2)
        self.at[loops.LOBE_DB], self.at[loops.FALL_DB] = p.lobe_db, p.fall_db_per_tap
        self.at[loops.FAR_DB], self.at[loops.MARGIN_DB] = p.far_db, p.margin_db

    def keep(self, block: Block) -> BoolArray:
        """Mask of the detections that can be no side lobe."""
        rows = block.detections
        cosine, spread = rows["motion_cosine"], rows["motion_cosine_sd"]
        columns = [plain(values, np.float64) for values in (rows["tap"], rows["score_db"], cosine, spread)]
        known = np.isfinite(rows["tap"]) & np.isfinite(rows["score_db"])
        return np.asarray(known & self._unmasked(plain(rows.frame, np.int64), *columns, self.at))
