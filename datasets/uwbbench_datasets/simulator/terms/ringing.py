"""What the robot itself sends back: antenna ringing and the chassis."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from uwbbench.api import ComplexArray, FloatArray, Params, Paths, Term, View


class RingingParams(Params):
    """Power-delay profile of the ringing."""

    level_db: float = Field(-9.0, description="Power against the direct path, before the decay.")
    decay_ns: float = Field(1.5, gt=0, description="Time in which the power falls by a factor e.")
    start_ns: float = Field(1.0, ge=0, description="Delay of the first return.")
    spacing_ns: float = Field(0.5, gt=0, description="Delay between returns.")
    returns: int = Field(12, ge=1, le=1000, description="Number of returns.")
    drift: float = Field(0.015, ge=0, le=1, description="Relative amplitude of a slow drift; 0 for none.")
    drift_period_s: float = Field(60.0, gt=0, description="Period of the drift.")


class Ringing(Term[RingingParams]):
    """Robot-fixed ringing: a decaying row of returns, drawn once a run, that drifts a little.

    As it stays the same from frame to frame, a recorded background can remove it. It reaches both antennas alike.
    """

    _strength: ComplexArray
    _turn: FloatArray

    def prepare(self, view: View, rng: np.random.Generator) -> View:
        """Draw the returns of the run."""
        p = self.params
        self._strength = (rng.normal(size=p.returns) + 1j * rng.normal(size=p.returns)) / np.sqrt(2)
        self._turn = rng.uniform(0, 2 * np.pi, p.returns)
        return view

    def _delay_s(self) -> FloatArray:
        return np.asarray(
            (self.params.start_ns + np.arange(self.params.returns) * self.params.spacing_ns) * 1e-9, float
        )

    def _amplitude(self, view: View) -> ComplexArray:
        power = 10 ** (self.params.level_db / 10) * np.exp(-self._delay_s() / (self.params.decay_ns * 1e-9))
        return np.asarray(view.direct_amplitude * np.sqrt(power) * self._strength)

    def bound(self, view: View) -> float:
        """All returns in phase, at the top of their drift."""
        return float(np.sum(np.abs(self._amplitude(view))) * (1 + self.params.drift))

    def paths(self, view: View, rng: np.random.Generator) -> Paths:
        """One path for each return."""
        turn = 2 * np.pi * view.timestamp_s[:, None] / self.params.drift_period_s + self._turn
        amplitude = self._amplitude(view) * (1 + self.params.drift * np.sin(turn))
        return Paths(self._delay_s()[None], amplitude, np.zeros((1, self.params.returns)))
