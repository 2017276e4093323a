"""Frames whose best possible answer is known: ideal echoes in filtered noise, to hold detectors against bounds.

Simulated, and labelled so. Not a room but a test signal: one direct path, none, one or two point echoes, and noise.
"""

from __future__ import annotations

from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import (
    SPEED_OF_LIGHT_M_S,
    Capture,
    CaptureError,
    Card,
    ComplexArray,
    Dataset,
    FloatArray,
    Obstacle,
    Params,
    Radar,
    Trajectory,
    Truth,
    nearest,
    simulated_recording,
)
from uwbbench_datasets.simulator.pulses import RaisedCosinePulse

SAMPLE_INTERVAL_S = 1 / (2 * 499.2e6)
PULSE = RaisedCosinePulse(symbol_s=2.0e-9, rolloff=0.5)
"""Autocorrelation of the root-raised-cosine reference pulse (IEEE 802.15.4 HRP, 499.2 MHz channels)."""
TAPS, NOISE_TAPS, CREST_TAP = 50, 4, 7
FRAME_RATE_HZ = 48.0
DIRECT_ABOVE_ECHO_DB = 12.0
"""Enough for a reference, and little enough for its side lobes, 17.5 dB down, to stay clearly below the echo."""


class LimitsParams(Params):
    """Which test signal, and how strong."""

    scene: Literal["echo", "pair", "noise"] = Field(
        description="'echo': one echo a frame. 'pair': two equal ones. 'noise': none."
    )
    snr_db: float = Field(
        ge=-20, le=80, description="Power of the crest of an echo over that of the noise; of a lacking one in 'noise'."
    )
    separation_ns: float | None = Field(None, gt=0, le=15, description="Delay between the two echoes of a pair.")
    runs: int = Field(1, ge=1, le=1000, description="Captures with draws of their own.")
    frames: int = Field(3000, ge=1, le=1_000_000, description="Frames of the capture.")
    min_range_m: float = Field(0.2, ge=0, description="Nearest echo.")
    max_range_m: float = Field(6.0, gt=0, le=6.3, description="Farthest echo; the taps end at 6.4 m.")
    seed: int = Field(1, ge=0, description="Draws places, phases and noise.")

    @model_validator(mode="after")
    def _belongs_together(self) -> Self:
        if (self.scene == "pair") != (self.separation_ns is not None):
            raise ValueError("separation_ns belongs to the scene 'pair', and a pair needs it")
        if self.min_range_m >= self.max_range_m:
            raise ValueError(f"max_range_m ({self.max_range_m:g}) must exceed min_range_m ({self.min_range_m:g})")
        return self


class Limits(Dataset[LimitsParams]):
    """Simulated test signals for accuracy, detection, resolution and false alarms (built in, no download).

    Each frame holds a direct path and echoes at random delays and phases, uniform in range whatever their strength:
    signal-to-noise ratio and range are independent here. Pulse and noise are those of an ideal IEEE 802.15.4 receiver:
    pulses are raised cosines, and the noise has gone through the matched root-raised-cosine filter, so that its
    autocorrelation is the pulse itself. The direct path is 12 dB stronger than an echo and lies on a whole tap: it is
    a reference of known delay, not a source of error. Transmitter and receiver share one place: range is half the
    path.
    """

    card: ClassVar[Card] = Card(
        title="Simulated test signals with known bounds",
        license="BSD-3-Clause",
        citation="Pulse after the IEEE 802.15.4 HRP reference (root-raised cosine, roll-off 0.5, 2 ns).",
        source="built in",
        origin="simulated",
    )

    def names(self) -> list[str]:
        """One capture a run, named after its scene; all frames are drawn anew, so that no run repeats another."""
        p = self.params
        parts = [p.scene, f"{p.snr_db:g}db"] + ([] if p.separation_ns is None else [f"{p.separation_ns:g}ns"])
        name = "-".join(parts)
        return [name] if p.runs == 1 else [f"{name}/{run}" for run in range(1, p.runs + 1)]

    def open(self, name: str) -> Capture:
        """Simulate the frames."""
        if name not in self.names():
            raise CaptureError(f"no test signal '{name}'.{nearest(name, self.names())}")
        p = self.params
        run = self.names().index(name)
        rng = np.random.default_rng(p.seed if p.runs == 1 else [p.seed, run])
        draws = f"limits seed {p.seed}" if p.runs == 1 else f"limits seed {p.seed}, run {run + 1}"
        range_m = self._ranges(rng)
        obstacles = tuple(
            Obstacle(f"echo {index + 1}", "ideal", np.stack([one, np.zeros_like(one)], axis=1)[:, None, :])
            for index, one in enumerate(range_m)
        )
        still = np.zeros((p.frames, 3))
        return Capture(
            name=name,
            radar=Radar(
                model="ideal 802.15.4 receiver",
                center_frequency_hz=7987.2e6,
                bandwidth_hz=499.2e6,
                sample_interval_s=SAMPLE_INTERVAL_S,
                frame_rate_hz=FRAME_RATE_HZ,
                taps=TAPS,
                channel=9,
                noise_taps=NOISE_TAPS,
            ),
            trajectory=Trajectory(np.arange(p.frames) / FRAME_RATE_HZ, still, np.zeros(p.frames)),
            truth=Truth(obstacles),
            source="simulated",
            license=self.card.license,
            citation=self.card.citation,
            description="Simulated by uwbbench: ideal echoes in filtered noise.",
            recording=simulated_recording(name, draws),
            preamble=_responses(range_m, p.frames, 10 ** (p.snr_db / 20), rng),
        )

    def _ranges(self, rng: np.random.Generator) -> list[FloatArray]:
        """Range (frames,) of each echo."""
        p = self.params
        if p.scene == "noise":
            return []
        first = rng.uniform(p.min_range_m, p.max_range_m, p.frames)
        if p.separation_ns is None:
            return [first]
        apart = p.separation_ns * 1e-9 * SPEED_OF_LIGHT_M_S / 2
        first = p.min_range_m + (first - p.min_range_m) * (1 - apart / (p.max_range_m - p.min_range_m))
        return [first, first + apart]


def _responses(range_m: list[FloatArray], frames: int, echo: float, rng: np.random.Generator) -> ComplexArray:
    """Responses (frames, taps) with noise of unit power and echoes of amplitude ``echo``."""
    tap_s: FloatArray = np.arange(TAPS, dtype=np.float64) * SAMPLE_INTERVAL_S
    response = _noise(tap_s, frames, rng)
    response += _carrier(frames, rng) * echo * 10 ** (DIRECT_ABOVE_ECHO_DB / 20) * PULSE(tap_s - tap_s[CREST_TAP])
    for one in range_m:
        delay_s = tap_s[CREST_TAP] + 2 * one / SPEED_OF_LIGHT_M_S
        response += _carrier(frames, rng) * echo * PULSE(tap_s - delay_s[:, None])
    return response


def _carrier(frames: int, rng: np.random.Generator) -> ComplexArray:
    """Random phase (frames, 1) of each frame."""
    return np.asarray(np.exp(2j * np.pi * rng.uniform(size=(frames, 1))))


def _noise(tap_s: FloatArray, frames: int, rng: np.random.Generator) -> ComplexArray:
    """Circular Gaussian noise (frames, taps) of unit power whose autocorrelation is the pulse."""
    power, mode = np.linalg.eigh(PULSE(tap_s[:, None] - tap_s))
    # The symmetric root: modes alone are arbitrary in sign, and outside the band, where the power is 0 give or take
    # rounding, in direction too; each processor's linear algebra would choose others, and so draw other noise.
    colour = mode * np.sqrt(np.maximum(power, 0.0) / 2) @ mode.T
    white = rng.normal(size=(frames, TAPS)) + 1j * rng.normal(size=(frames, TAPS))
    return np.asarray(white @ colour)
