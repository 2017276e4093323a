"""A small built-in capture: one plate approached in a straight line, so that a first run needs no download.

Simulated, and labelled so. Direct path, robot-fixed ringing, one plate echo and white noise; no walls, no ghosts.

It is no scene of the simulator, whose terms draw from streams of their own and follow finer models: stored runs and
gates know these captures by their checksums, which must not change.
"""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field
from scipy.special import fresnel

from uwbbench.api import (
    CHANNEL_CENTER_HZ,
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

SAMPLE_INTERVAL_S = 1 / (2 * 499.2e6)
REFLECTION = {"metal": 1.0, "concrete": 0.394 / 2, "plywood": 0.26 / 1.41}
"""Half-space reflection at normal incidence (ITU-R P.2040-3), less a fitted shape loss of 6 dB and 3 dB for boxes."""
TAPS, CREST_TAP, NOISE_TAPS = 50, 7.0, 4
PULSE_FWHM_S = 3.2e-9
BASELINE_M = 0.25
ARRAY_SPACING_M = 17.8e-3
ISOLATION_DB, RINGING_DB, RINGING_DECAY_S = 6.0, -9.0, 1.5e-9
DIRECT_SNR_DB, STS_LOSS_DB = 45.0, 4.0
MOST_FRAMES = 1_000_000
WIDTH_M, HEIGHT_M, THICKNESS_M = 0.25, 0.28, 0.02


class ApproachParams(Params):
    """What is approached, and how."""

    channel: Literal[5, 9] = Field(9, description="IEEE 802.15.4 channel.")
    material: Literal["metal", "concrete", "plywood"] = Field("metal", description="Of the plate.")
    runs: int = Field(1, ge=1, le=1000, description="Captures with different noise.")
    start_m: float = Field(3.4, gt=0, description="First distance from the receiver to the plate.")
    stop_m: float = Field(0.6, gt=0, description="Last distance.")
    speed_m_s: float = Field(0.3, gt=0, description="Speed of the robot.")
    frame_rate_hz: float = Field(48.0, gt=0, description="Frames a second.")
    lateral_m: float = Field(0.1, description="Sideways offset of the plate from the path, positive to the left.")
    sts: bool = Field(True, description="Whether the capture has the two STS responses.")
    seed: int = Field(1, ge=0, description="Draws noise and ringing.")


class Approach(Dataset[ApproachParams]):
    """Simulated straight approach to one plate (built in, no download).

    The pulse is a Gaussian of 3.2 ns (a 500 MHz spectrum at the -10 dB regulatory mask), the plate echo the two-way
    Fresnel integral of physical optics, the sampling grid is not locked to the direct path, and phase and gain change
    from frame to frame, as they do on DW3000 hardware.
    """

    card: ClassVar[Card] = Card(
        title="Simulated straight approach to one plate",
        license="BSD-3-Clause",
        citation="Model terms after arXiv 2512.01018 (setting) and ITU-R P.2040-3 (materials).",
        source="built in",
        origin="simulated",
    )

    def names(self) -> list[str]:
        """One capture a run."""
        p = self.params
        return [f"approach-ch{p.channel}-{p.material}-{run}" for run in range(1, p.runs + 1)]

    def scene(self, name: str) -> str:
        """All runs are of one scene: only noise and ringing differ."""
        return name.rpartition("-")[0]

    def open(self, name: str) -> Capture:
        """Simulate one run."""
        names = self.names()
        if name not in names:
            raise CaptureError(f"no simulated run '{name}'.{nearest(name, names)}")
        p = self.params
        rng = np.random.default_rng([p.seed, names.index(name)])
        spaces = abs(p.start_m - p.stop_m) / p.speed_m_s * p.frame_rate_hz
        if not spaces < MOST_FRAMES:
            raise CaptureError(f"an approach of {spaces:.3g} frames; it may have {MOST_FRAMES}")
        frames = int(spaces) + 1
        distance_m = np.linspace(p.start_m, p.stop_m, frames)
        position_m = np.stack([p.start_m - distance_m, np.zeros(frames), np.zeros(frames)], axis=1)
        truth = Truth((self._plate(),))
        trajectory = Trajectory(np.arange(frames) / p.frame_rate_hz, position_m, np.zeros(frames))
        radar = Radar(
            model="simulated DW3000",
            center_frequency_hz=CHANNEL_CENTER_HZ[p.channel],
            bandwidth_hz=499.2e6,
            sample_interval_s=SAMPLE_INTERVAL_S,
            frame_rate_hz=p.frame_rate_hz,
            taps=TAPS,
            channel=p.channel,
            receiver="front",
            tx_position_m=(0.0, -BASELINE_M, 0.0),
            noise_taps=NOISE_TAPS,
            array_spacing_m=ARRAY_SPACING_M,
            has_sts=p.sts,
            has_first_path=True,
        )
        crest_tap = CREST_TAP + rng.uniform(-0.5, 0.5, frames)
        responses = _responses(radar, truth, trajectory, REFLECTION[p.material], crest_tap, rng)
        reported = crest_tap + rng.normal(0, 0.1, frames)
        return Capture(
            name=name,
            radar=radar,
            trajectory=trajectory,
            truth=truth,
            source="simulated",
            license=self.card.license,
            citation=self.card.citation,
            description="Simulated by uwbbench: one plate, straight approach.",
            recording=simulated_recording(name, f"approach seed {p.seed}, run {names.index(name) + 1}"),
            preamble=responses[0],
            sts1=responses[1] if p.sts else None,
            sts2=responses[2] if p.sts else None,
            first_path_index=reported,
            first_path_index_sts1=reported if p.sts else None,
            first_path_index_sts2=reported if p.sts else None,
            receivers=("front",),
        )

    def _plate(self) -> Obstacle:
        near, far = self.params.start_m, self.params.start_m + THICKNESS_M
        left, right = self.params.lateral_m + WIDTH_M / 2, self.params.lateral_m - WIDTH_M / 2
        return Obstacle(
            "plate", self.params.material, np.array([[near, right], [near, left], [far, left], [far, right]])
        )


def _plate_amplitude(range_m: FloatArray, wavelength_m: float) -> FloatArray:
    """Amplitude of a plate's echo, averaged in power over 10 % of range to remove the ideal plate's deep ripples.

    ``A = lambda / (8 pi r) 2 |F(u) F(v)|`` with the Fresnel integral F and ``u = width / sqrt(lambda r)``.
    """
    near = range_m[:, None] * np.linspace(0.9, 1.1, 21)
    integrals = []
    for side in (WIDTH_M, HEIGHT_M):
        sine, cosine = fresnel(side / np.sqrt(wavelength_m * near))
        integrals.append(np.hypot(sine, cosine))
    amplitude = wavelength_m / (8 * np.pi * near) * 2 * integrals[0] * integrals[1]
    return np.asarray(np.sqrt(np.mean(amplitude**2, axis=1)))


def _responses(
    radar: Radar,
    truth: Truth,
    trajectory: Trajectory,
    reflection: float,
    crest_tap: FloatArray,
    rng: np.random.Generator,
) -> list[ComplexArray]:
    """Preamble, STS1 and STS2 responses (frames, taps)."""
    frames = len(trajectory)
    sight = truth.seen_from(radar, trajectory)
    range_m, azimuth_rad = sight.range_m[:, 0], sight.azimuth_rad[:, 0]
    point = np.stack([range_m * np.cos(azimuth_rad), range_m * np.sin(azimuth_rad), np.zeros(frames)], axis=1)
    excess_m = np.linalg.norm(point - radar.baseline_m, axis=1) + range_m - radar.baseline_length_m
    delay_s = excess_m / SPEED_OF_LIGHT_M_S

    wavelength = radar.wavelength_m
    direct = wavelength / (4 * np.pi * BASELINE_M) * 10 ** (-ISOLATION_DB / 20)
    ringing_s = np.arange(1, 13) * 0.5e-9 + 0.5e-9
    spread = np.sqrt(10 ** (RINGING_DB / 10) * np.exp(-ringing_s / RINGING_DECAY_S) / 2)
    ringing = direct * spread * (rng.normal(size=12) + 1j * rng.normal(size=12))
    receive_gain = 2.0 * np.cos(azimuth_rad)  # a 6 dBi patch, cos^2 in power
    echo = reflection * _plate_amplitude(range_m, wavelength) * receive_gain
    echo_phase = np.exp(-2j * np.pi * radar.center_frequency_hz * delay_s)
    slope = 2 * np.pi * ARRAY_SPACING_M / wavelength

    tap_s = (np.arange(radar.taps) - crest_tap[:, None]) * radar.sample_interval_s
    gain = 10 ** (rng.normal(0, 0.5, frames) / 20) * np.exp(2j * np.pi * rng.uniform(size=frames))
    noise = direct * 10 ** (-DIRECT_SNR_DB / 20) / np.sqrt(2)
    direct_path = direct * _pulse(tap_s)
    direct_turn = slope * radar.baseline_m[1] / BASELINE_M
    fixed = np.zeros(tap_s.shape, complex)
    for delay, amplitude in zip(ringing_s, ringing, strict=True):
        fixed = fixed + amplitude * _pulse(tap_s - delay)
    moving = (echo * echo_phase)[:, None] * _pulse(tap_s - delay_s[:, None])
    responses = []
    for antenna, loss_db in ((0, 0.0), (0, STS_LOSS_DB), (1, STS_LOSS_DB)):
        turned = moving * np.exp(1j * antenna * slope * np.sin(azimuth_rad))[:, None]
        clean = gain[:, None] * (direct_path * np.exp(1j * antenna * direct_turn) + fixed + turned)
        white = rng.normal(size=clean.shape) + 1j * rng.normal(size=clean.shape)
        responses.append((clean + noise * 10 ** (loss_db / 20) * white).astype(np.complex64))
    return responses


def _pulse(time_s: FloatArray) -> FloatArray:
    """Gaussian pulse of unit height."""
    return np.asarray(np.exp(-4 * np.log(2) * (time_s / PULSE_FWHM_S) ** 2))
