"""Bearings behind clutter.sts."""

import numpy as np

from uwbbench.api import Radar


def drive(radar: Radar, ringing: float) -> dict[str, np.ndarray]:
    """A weak echo that recedes at 25 degrees, in two antennas with ringing of their own."""
    frames, taps = 200, np.arange(radar.taps)
    rng = np.random.default_rng(1)
    place = 20 + 0.05 * np.arange(frames)[:, None]
    phase = 2 * np.pi * 0.0178 / radar.wavelength_m * np.sin(np.radians(25))

    def response(turn: float, own: complex) -> np.ndarray:
        direct = np.exp(-((taps - 7.0) ** 2) / 2) + ringing * own * np.exp(-np.maximum(taps - 8, 0) / 10) * (taps > 8)
        echo = 0.05 * np.exp(-((taps - place) ** 2) / 2 + 11j * place + 1j * turn)
        noise = 1e-4 * (rng.normal(size=echo.shape) + 1j * rng.normal(size=echo.shape))
        return direct + echo + noise

    random = np.exp(1j * rng.uniform(0, 2 * np.pi, (frames, 1)))
    return {
        "preamble": response(0.0, 1j) * random,
        "sts1": response(0.0, 1j) * random,
        "sts2": response(phase, -1.0) * random,
    }


def bearing_error(block, radar: Radar) -> float:
    """Root mean square error in degrees at the echo's tap, behind 100 frames."""
    rows = np.arange(100, 200)
    at = np.round(20 + 0.05 * rows).astype(int)
    alpha = np.angle(block.frames.sts2[rows, at] / block.frames.sts1[rows, at])
    azimuth = np.degrees(np.arcsin(np.clip(alpha * radar.wavelength_m / (2 * np.pi * 0.0178), -1, 1)))
    return float(np.sqrt(np.mean((azimuth - 25) ** 2)))


def test_ringing_no_longer_drags_the_bearing(make_radar, make_block, make_stage, run_stage):
    radar = make_radar(has_sts=True, array_spacing_m=0.0178)
    block = make_block(**{"samples": (made := drive(radar, 0.5)).pop("preamble"), **made})
    cleaned = run_stage(make_stage("clutter.sts", memory=0.97), radar, block)
    assert bearing_error(block, radar) > 8
    assert bearing_error(cleaned, radar) < 3


def test_responses_are_the_same_however_frames_are_cut(make_radar, make_block, make_stage, run_stage, one_by_one):
    radar = make_radar(has_sts=True, array_spacing_m=0.0178)
    block = make_block(**{"samples": (made := drive(radar, 0.5)).pop("preamble"), **made})
    whole = run_stage(make_stage("clutter.sts"), radar, block)
    cut = run_stage(make_stage("clutter.sts"), radar, block, one_by_one(len(block.frames)))
    np.testing.assert_array_equal(whole.frames.sts1, cut.frames.sts1)
    np.testing.assert_array_equal(whole.frames.sts2, cut.frames.sts2)
