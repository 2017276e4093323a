"""Pulse shapes, as they appear in a channel impulse response: real, of unit height."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uwbbench.api import FloatArray

_FAINTEST = 1e-12
"""Below this height a Gaussian pulse counts as over: 240 dB under its crest."""


@dataclass(frozen=True)
class GaussianPulse:
    """Gaussian pulse, as of transmitters that shape their spectrum to the regulatory mask.

    A width of 3.2 ns is a power spectrum of 500 MHz at -10 dB; there are no side lobes.

    Parameters
    ----------
    fwhm_s : float
        Full width at half height.
    """

    fwhm_s: float

    @property
    def support_s(self) -> float:
        """Time at which the pulse has all but vanished."""
        return float(self.fwhm_s * np.sqrt(-np.log(_FAINTEST) / np.log(16)))

    def __call__(self, time_s: FloatArray, /) -> FloatArray:
        """``2^-(2 t / fwhm)^2``."""
        exponent = np.square(time_s)  # the rest works in place: memory, not arithmetic, would limit it
        exponent *= -4 * np.log(2) / self.fwhm_s**2
        return np.asarray(np.exp(exponent, out=exponent if np.ndim(exponent) else None))


@dataclass(frozen=True)
class RaisedCosinePulse:
    """Raised cosine: the autocorrelation of the reference pulse of IEEE 802.15.4 HRP UWB.

    The standard's root raised cosine has a roll-off of 0.5 and, in channels of 499.2 MHz, a duration of 2 ns. Side
    lobes reach -17.5 dB and fade as ``t^-3``, so that the pulse is evaluated on all taps.

    Parameters
    ----------
    symbol_s : float
        Duration T.
    rolloff : float
        Between 0 and 1.
    """

    symbol_s: float = 1 / 499.2e6
    rolloff: float = 0.5

    @property
    def support_s(self) -> float:
        """Unlimited."""
        return float("inf")

    def __call__(self, time_s: FloatArray, /) -> FloatArray:
        """``sinc(t / T) cos(pi b t / T) / (1 - (2 b t / T)^2)``, with its limit at ``|t| = T / (2 b)``."""
        turns = np.asarray(time_s) / self.symbol_s
        root = 2 * self.rolloff * turns
        # cos(pi x / 2) = sin(pi (1 - |x|) / 2) holds the factor 1 - |x| of the pole, which sinc takes out.
        magnitude = np.abs(root)
        taper = np.pi / 2 * np.sinc((1 - magnitude) / 2) / (1 + magnitude)
        return np.asarray(np.sinc(turns) * taper)
