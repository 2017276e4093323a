"""Receiver noise."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field
from scipy.fft import fftfreq, ifft, next_fast_len

from uwbbench.api import ComplexArray, FloatArray, Params, Responses, Term, View

_ROLLOFF = 0.5
_CORRELATED_TAPS = 32


class NoiseParams(Params):
    """Level and spectrum of the noise."""

    kind: Literal["white", "rc"] = Field("white", description="rc: coloured by the receiver's raised-cosine filter.")
    snr_db: float = Field(45.0, description="Direct path's crest, in power, over the noise of the preamble.")
    sts_loss_db: float = Field(4.0, description="How much noisier the two STS responses are.")


class Noise(Term[NoiseParams]):
    """Complex Gaussian noise of constant level, white or coloured by the receiver's filter.

    The filter is the root raised cosine of IEEE 802.15.4 (roll-off 0.5), so that the noise has the raised cosine as
    its autocorrelation.
    """

    of_robot: ClassVar = True

    def noise_rms(self, view: View) -> float:
        """Relative to the direct path."""
        return float(view.direct_amplitude * 10 ** (-self.params.snr_db / 20))

    def apply(self, responses: Responses, view: View, rng: np.random.Generator) -> Responses:
        """Add noise, drawn apart for each response.

        Parameters
        ----------
        responses : Responses
            Arrays (frames, taps).
        view : View
            Gives the direct path's amplitude, which the level refers to, and the radar's sample interval and bandwidth.
        rng : Generator
            Draws the noise: of the preamble first, then of both STS responses.
        """
        rms = self.noise_rms(view)
        sts_rms = rms * 10 ** (self.params.sts_loss_db / 20)

        def noisy(clean: ComplexArray, level: float) -> ComplexArray:
            noise = self._drawn(clean.shape, level, view.radar.sample_interval_s * view.radar.bandwidth_hz, rng)
            noise += clean
            return noise

        preamble = noisy(responses.preamble, rms)
        if responses.sts1 is None or responses.sts2 is None:
            return Responses(preamble)
        return Responses(preamble, noisy(responses.sts1, sts_rms), noisy(responses.sts2, sts_rms))

    def _drawn(self, shape: tuple[int, ...], rms: float, chips_a_tap: float, rng: np.random.Generator) -> ComplexArray:
        """Noise (frames, taps) of a given root mean square."""
        frames, taps = shape
        if self.params.kind == "white":
            return _white((frames, taps), rms, rng)
        length = next_fast_len(taps + _CORRELATED_TAPS)
        response = _root_raised_cosine(fftfreq(length, chips_a_tap))
        scale = length / np.sqrt(np.sum(response**2))
        return np.asarray(ifft(_white((frames, length), rms * scale, rng) * response, axis=1)[:, :taps])


def _white(shape: tuple[int, int], rms: float, rng: np.random.Generator) -> ComplexArray:
    parts = rng.standard_normal((*shape, 2))
    parts *= rms * np.sqrt(0.5)
    return np.asarray(parts.view(complex)[..., 0])


def _root_raised_cosine(cycles_a_chip: FloatArray) -> FloatArray:
    """Amplitude response of the filter at frequencies in units of the chip rate."""
    past = np.clip((np.abs(cycles_a_chip) - (1 - _ROLLOFF) / 2) / _ROLLOFF, 0, 1)
    return np.asarray(np.cos(np.pi / 2 * past))
