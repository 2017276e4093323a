"""The direct path from the transmitter to the receiver."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import Params, Paths, Term, View


class DirectParams(Params):
    """What stands between the two antennas."""

    isolation_db: float = Field(6.0, ge=0, description="Attenuation by absorber and antenna patterns.")


class Direct(Term[DirectParams]):
    """Direct path: free space over the distance of the antennas, less their isolation.

    All levels that other terms state relative to the direct path follow this attenuation.
    """

    of_robot: ClassVar = True

    def prepare(self, view: View, rng: np.random.Generator) -> View:
        """Attenuate the direct path."""
        return view.replace(direct_amplitude=view.direct_amplitude * 10 ** (-self.params.isolation_db / 20))

    def bound(self, view: View) -> float:
        """Its amplitude, which is constant."""
        return view.direct_amplitude

    def paths(self, view: View, rng: np.random.Generator) -> Paths:
        """One path at zero delay."""
        toward = view.radar.baseline_m
        azimuth_rad = np.arctan2(toward[1], toward[0])
        return Paths(np.zeros((1, 1)), np.full((1, 1), view.direct_amplitude, complex), np.full((1, 1), azimuth_rad))
