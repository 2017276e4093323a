"""Antenna patterns."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import FloatArray, Params, Term, View


class AntennaParams(Params):
    """Gains and shape of the patterns."""

    transmit_gain_dbi: float = Field(2.0, description="Transmitter, the same all round: lifts the direct path too.")
    exponent: float = Field(2.0, ge=0, description="The receiver's power falls as this power of the cosine.")
    front_back_db: float = Field(15.0, ge=0, description="Boresight over the back and the sides, in power.")


class Antenna(Term[AntennaParams]):
    """Omnidirectional transmitter and patch receiver: ``max(cos(azimuth)^exponent, back)`` in power.

    Gain on boresight is the radar's ``gain_dbi``. The direct path arrives from the side and counts all that the
    receiving pattern takes from it as isolation.
    """

    of_robot: ClassVar = True

    def prepare(self, view: View, rng: np.random.Generator) -> View:
        """Shape the receiving gain and lift all paths by the transmitter's."""
        p = self.params
        transmit = 10 ** (p.transmit_gain_dbi / 20)
        back = 10 ** (-p.front_back_db / 10)
        boresight = view.receive_gain

        def gain(azimuth_rad: FloatArray) -> FloatArray:
            ahead = np.maximum(np.cos(azimuth_rad), 0.0)
            return np.asarray(transmit * boresight(azimuth_rad) * np.sqrt(np.maximum(ahead**p.exponent, back)))

        return view.replace(receive_gain=gain, direct_amplitude=view.direct_amplitude * transmit)
