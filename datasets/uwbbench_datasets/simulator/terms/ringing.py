"""What the robot itself sends back: antenna ringing and the chassis."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import ComplexArray, FloatArray, Params, Paths, Term, View


class RingingTap(Params):
    """One return of a robot whose ringing is known."""

    delay_ns: float = Field(ge=0, description="After the direct path.")
    level_db: float = Field(description="Power against the direct path.")
    phase_deg: float = Field(0.0, description="Phase against the direct path.")


class RingingParams(Params):
    """Power-delay profile of the ringing, or the returns themselves."""

    level_db: float = Field(-9.0, description="Power against the direct path, before the decay.")
    decay_ns: float = Field(1.5, gt=0, description="Time in which the power falls by a factor e.")
    start_ns: float = Field(1.0, ge=0, description="Delay of the first return.")
    spacing_ns: float = Field(0.5, gt=0, description="Delay between returns.")
    returns: int = Field(12, ge=1, le=1000, description="Number of returns.")
    drift: float = Field(0.015, ge=0, le=1, description="Relative amplitude of a slow drift; 0 for none.")
    drift_period_s: float = Field(60.0, gt=0, description="Period of the drift.")
    spread_deg: float = Field(
        0.0, ge=0, le=180, description="Returns come from up to this to either side; 0: alike to both antennas."
    )
    taps: list[RingingTap] | None = Field(
        None, min_length=1, description="The returns themselves, in place of a profile that they are drawn from."
    )

    @model_validator(mode="after")
    def _one_description(self) -> RingingParams:
        profile = {"level_db", "decay_ns", "start_ns", "spacing_ns", "returns"} & self.model_fields_set
        if self.taps is not None and profile:
            raise ValueError(f"taps are the returns themselves; {sorted(profile)[0]} is of returns that are drawn")
        return self


class Ringing(Term[RingingParams]):
    """Robot-fixed ringing: a decaying row of returns that drifts a little.

    As it stays the same from frame to frame, a recorded background can remove it. It reaches both antennas alike,
    unless its directions are spread: then its sum at each, and with it the crest of the direct path, differs. The
    returns are drawn once a run, or once for the robot where the scene names one; ``taps`` states them instead.
    """

    of_robot: ClassVar = True

    _delay_s: FloatArray
    _level: FloatArray
    _strength: ComplexArray
    _turn: FloatArray
    _azimuth_rad: FloatArray

    def prepare(self, view: View, rng: np.random.Generator) -> View:
        """Draw the returns, or take those that are known."""
        p = self.params
        if p.taps is not None:
            delay_ns, level_db, phase_deg = np.array([[tap.delay_ns, tap.level_db, tap.phase_deg] for tap in p.taps]).T
            self._delay_s = np.asarray(delay_ns * 1e-9, float)
            self._level = np.asarray(10 ** (level_db / 20), float)
            self._strength = np.exp(1j * np.radians(phase_deg))
        else:
            self._delay_s = np.asarray((p.start_ns + np.arange(p.returns) * p.spacing_ns) * 1e-9, float)
            power = 10 ** (p.level_db / 10) * np.exp(-self._delay_s / (p.decay_ns * 1e-9))
            self._level = np.asarray(np.sqrt(power), float)
            self._strength = (rng.normal(size=p.returns) + 1j * rng.normal(size=p.returns)) / np.sqrt(2)
        self._turn = rng.uniform(0, 2 * np.pi, len(self._delay_s))
        side = rng.uniform(-1, 1, len(self._delay_s)) if p.spread_deg else np.zeros(len(self._delay_s))
        self._azimuth_rad = np.radians(p.spread_deg) * side
        return view

    def _amplitude(self, view: View) -> ComplexArray:
        return np.asarray(view.direct_amplitude * self._level * self._strength)

    def bound(self, view: View) -> float:
        """All returns in phase, at the top of their drift."""
        return float(np.sum(np.abs(self._amplitude(view))) * (1 + self.params.drift))

    def paths(self, view: View, rng: np.random.Generator) -> Paths:
        """One path for each return."""
        turn = 2 * np.pi * view.timestamp_s[:, None] / self.params.drift_period_s + self._turn
        amplitude = self._amplitude(view) * (1 + self.params.drift * np.sin(turn))
        return Paths(self._delay_s[None], amplitude, self._azimuth_rad[None])
