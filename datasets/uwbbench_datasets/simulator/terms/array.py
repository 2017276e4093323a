"""How the antenna array departs from two ideal antennas."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import FloatArray, Params, Term, View


class ArrayParams(Params):
    """Phase error of the second antenna over the first, as a function of azimuth."""

    offset_deg: float = Field(0.0, description="Constant error, as of unequal lines.")
    offset_sd_deg: float = Field(
        0.0, ge=0, description="Standard deviation of a further constant error, drawn once for the robot or the run."
    )
    asymmetry_deg: float = Field(8.0, description="Error at 90 degrees on either side, times sin^2 of the azimuth.")
    coupling: float = Field(0.95, gt=0, description="Slope of the phase against that of the spacing alone.")
    ripple_deg: float = Field(5.0, description="Error times sin(ripples azimuth), as of a small ground plane.")
    ripples: float = Field(4.0, gt=0)


class ArrayResponse(Term[ArrayParams]):
    r"""Measured-like array: one spacing for all channels, and a smooth, asymmetric error of its phase.

    Without it the phase is that of two ideal antennas, ``2 pi d sin(azimuth) / lambda``. With it

    ``coupling 2 pi d sin(azimuth) / lambda + offset + asymmetry sin^2(azimuth) + ripple sin(ripples azimuth)``.

    The form follows what calibrations of small two-antenna modules show, mutual coupling that flattens the slope and
    an error that differs between left and right; its sizes are chosen, not fitted to one board.
    """

    of_robot: ClassVar = True

    def prepare(self, view: View, rng: np.random.Generator) -> View:
        """Replace the array's phase."""
        p = self.params
        ideal = view.array_phase
        drawn_deg = p.offset_sd_deg * rng.standard_normal() if p.offset_sd_deg else 0.0
        offset, asymmetry, ripple = np.radians([p.offset_deg + drawn_deg, p.asymmetry_deg, p.ripple_deg])

        def phase(azimuth_rad: FloatArray) -> FloatArray:
            error = offset + asymmetry * np.sin(azimuth_rad) ** 2 + ripple * np.sin(p.ripples * azimuth_rad)
            return np.asarray(p.coupling * ideal(azimuth_rad) + error)

        return view.replace(array_phase=phase)
