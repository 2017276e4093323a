"""Frames of a robot that rings: a direct path whose delay is known, returns behind it, and an echo that moves."""

import numpy as np

from uwbbench.api import Radar

INTERVAL_S = 1e-9
RETURNS = [(1.0e-9, 0.25 * np.exp(0.5j)), (2.0e-9, 0.12 * np.exp(-1.0j)), (3.5e-9, 0.05j)]
"""Delay and complex amplitude of what the robot sends back, to the direct path."""


def gauss(time_s, width_s=3.2e-9):
    return np.exp2(-((2 * time_s / width_s) ** 2))


def tailed(time_s):
    """A pulse with a real tail of its own, 0.35 of its height one nanosecond behind it, on its own crest."""
    whole = lambda t: gauss(t) + 0.35 * gauss(t - 1e-9) + 0.15 * gauss(t - 2e-9)  # noqa: E731
    fine = np.arange(0, 2e-9, 1e-12)
    crest_s = fine[whole(fine).argmax()]
    return whole(time_s + crest_s) / whole(crest_s)


def frames_of(pulse=gauss, echo=0.05, frames=100, noise=3e-4, seed=0):
    """Frames (frames, 50) whose direct path has its own crest at tap 7 and a fraction, that fraction, and the echo.

    Each frame has a phase of its own; the echo recedes from tap 16 to 36 and turns.
    """
    rng = np.random.default_rng(seed)
    off = rng.uniform(-0.5, 0.5, frames)
    time_s = (np.arange(50) - 7 - off[:, None]) * INTERVAL_S
    samples = pulse(time_s).astype(complex)
    for delay_s, amplitude in RETURNS:
        samples += amplitude * pulse(time_s - delay_s)
    delay_s = np.linspace(9e-9, 29e-9, frames)[:, None]
    samples += echo * np.exp(-2j * np.pi * 8e9 * delay_s) * pulse(time_s - delay_s)
    samples += noise * (rng.normal(size=samples.shape) + 1j * rng.normal(size=samples.shape))
    return samples * np.exp(2j * np.pi * rng.uniform(size=(frames, 1))), off


def radar_of(**changes):
    values = {"model": "test", "center_frequency_hz": 8e9, "bandwidth_hz": 499.2e6, "frame_rate_hz": 48.0, "taps": 50}
    return Radar(**{**values, "sample_interval_s": INTERVAL_S, "noise_taps": 4, **changes})
