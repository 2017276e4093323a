"""How far each detection stands above the noise."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from uwbbench.api import Block, ConfigError, FloatArray, Params, Stage, ports


class SnrScoreParams(Params):
    """Compensation for distance, and what the amplitude is."""

    gain_db_per_ns: float = Field(
        0.20,
        description="Added for each unit of delay behind the first path. At 3.4 m the default adds 4.4 dB and at the "
        "end of a 50 ns window 9 dB. Two-way spreading from 1 to 3.4 m costs 10.6 dB (mirror) to 21.3 dB (point): it "
        "compensates targets too little, and lifts late noise.",
    )
    delay_unit: Literal["ns", "samples"] = Field(
        "ns",
        description="Unit of the delay. Samples of 1.0016 ns differ from ns by 0.16 %; at the 1 ns that arXiv "
        "2512.01018 prints (table of radar configurations) they are the same.",
    )
    amplitude: Literal["raw", "normalised"] = Field(
        "raw",
        description="'normalised' scales amplitude and noise as the profile was scaled, which subtracts the minimum "
        "from both: scores of echoes grow by about 1 dB (46 taps of noise). Needs a profile.",
    )


class SnrScore(Stage[SnrScoreParams]):
    """Score ``20 log10(A / A_noise) + k delay`` of arXiv 2512.01018, in dB.

    A ratio to a noise floor that is zero is no measure: it would be infinite for the weakest ripple and
    pass every threshold. Where the noise or the amplitude is not positive and finite the score is NaN, which no filter
    accepts, and a note says so.

    Raises
    ------
    ConfigError
        For ``amplitude: normalised``, if no earlier stage has made a profile.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames", "detections", "tap", "amplitude", "noise", "first_path")
    produces: ClassVar[frozenset[str]] = ports("score_db")
    implied: ClassVar[bool] = True
    rowwise: ClassVar[bool] = True
    fidelity = "from-source"

    @property
    def wanted(self) -> frozenset[str]:
        """The profile too, where amplitudes are scaled as it was."""
        return self.consumes | ports("profile") if self.params.amplitude == "normalised" else self.consumes

    def step(self, block: Block) -> Block:
        """Block whose detections have ``score_db``."""
        row = block.rows
        amplitude, noise = block.detections["amplitude"], block.part("noise_rms")[row]
        if self.params.amplitude == "normalised":
            amplitude, noise = self._normalised(block, amplitude, noise)
        unit = self.radar.sample_interval_s * 1e9 if self.params.delay_unit == "ns" else 1.0
        delay = (block.detections["tap"] - block.part("first_path")[row]) * unit
        usable = (amplitude > 0) & (noise > 0) & np.isfinite(amplitude) & np.isfinite(noise)
        if not usable.all():
            self.note(
                "score.snr: some detections have no score, since their amplitude or the noise floor of their frame is "
                "zero or unknown; filter.snr drops them"
            )
        score = np.full(len(row), np.nan)
        score[usable] = 20 * (np.log10(amplitude[usable]) - np.log10(noise[usable]))
        return block.with_columns(score_db=score + self.params.gain_db_per_ns * delay)

    def _normalised(self, block: Block, amplitude: FloatArray, noise: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Amplitude and noise (n,) on the straight line that turned each frame's magnitudes into its profile."""
        if block.profile is None:
            raise ConfigError("score.snr: 'amplitude: normalised' needs a profile; put profile.minmax before it")
        profile = block.profile
        magnitude = block.frames.amplitude[:, block.profile_start :]
        frame = np.arange(len(profile))
        low, high = profile.argmin(axis=1), profile.argmax(axis=1)
        bottom, rise = profile[frame, low], profile[frame, high] - profile[frame, low]
        floor, span = magnitude[frame, low], magnitude[frame, high] - magnitude[frame, low]
        slope = np.divide(rise, span, out=np.full(len(profile), np.nan), where=span > 0)
        row = block.rows
        return (
            bottom[row] + (amplitude - floor[row]) * slope[row],
            bottom[row] + (noise - floor[row]) * slope[row],
        )
