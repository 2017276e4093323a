"""The capture that hard cases start from: a small approach to one echo, made in memory, the same every time.

Simpler than the simulator, and apart from it, so that a stability verdict never changes with the models of a scene.
Samples are double precision: captures are stored as complex64, and what that costs is itself a case.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from uwbbench.api.arrays import ComplexArray, FloatArray, IntArray
from uwbbench.api.capture import Capture
from uwbbench.api.geometry import SPEED_OF_LIGHT_M_S, excess_path
from uwbbench.api.radar import Radar
from uwbbench.api.trial import RADAR
from uwbbench.api.truth import Obstacle, Trajectory, Truth

FRAMES, CREST_TAP = 160, 7.0
TAPS, NOISE_TAPS = RADAR.taps, RADAR.noise_taps
PULSE_TAPS = 3.2
"""Width of the Gaussian pulse at half its height."""
ECHO, NOISE = 0.12, 0.005
"""Amplitudes of the echo and of the noise (RMS), the direct path being 1: the echo stands 27 dB above the noise."""
START_M, STEP_M, SIDE_M = 3.2, 0.0125, 0.1
SEED, BACKGROUND_SEED = 20250612, 20250613
RINGING = ((1.0, 0.10 + 0.05j), (2.0, -0.03 + 0.04j))
"""Delay in taps and amplitude of what moves along with the robot."""


def pulse(tap: FloatArray) -> FloatArray:
    """Gaussian pulse of unit height around tap 0."""
    return np.asarray(np.exp(-4 * np.log(2) * (tap / PULSE_TAPS) ** 2))


def approach(
    *,
    echoes: Sequence[tuple[float, complex]] = ((0.0, ECHO),),
    standing: Callable[[IntArray], Sequence[tuple[float, ComplexArray]]] | None = None,
    direct: float = 1.0,
    frames: int = FRAMES,
) -> Capture:
    """Approach to one target, with a direct path, ringing and white noise.

    Delay, phase and gain of the direct path change from frame to frame, as on transceivers whose grid is not locked.
    The background is a recording of the same radar on the same way, with nothing in view.

    Parameters
    ----------
    echoes : sequence of (float, complex)
        Extra delay in taps, and amplitude, of each echo of the target.
    standing : callable, optional
        From the frame indices, more that keeps its delay: delay in taps behind the direct path, and amplitude in each
        frame.
    direct : float
        Amplitude of the direct path and of its ringing.
    frames : int
        Number of frames.
    """
    background = _recorded("hard-case background", (), None, direct, frames, BACKGROUND_SEED)
    capture = _recorded("hard-case", echoes, standing, direct, frames, SEED)
    return dataclasses.replace(capture, background=background)


def _recorded(
    name: str,
    echoes: Sequence[tuple[float, complex]],
    standing: Callable[[IntArray], Sequence[tuple[float, ComplexArray]]] | None,
    direct: float,
    frames: int,
    seed: int,
) -> Capture:
    rng = np.random.default_rng(seed)
    index = np.arange(frames)
    position_m = np.stack([index * STEP_M, np.zeros(frames), np.zeros(frames)], axis=1)
    target_m = np.array([START_M, SIDE_M, 0.0])
    seen_m = target_m - position_m
    tap_m = SPEED_OF_LIGHT_M_S * RADAR.sample_interval_s
    delay_taps = excess_path(seen_m, RADAR.baseline_m) / tap_m
    carrier = np.exp(-2j * np.pi * delay_taps * tap_m / RADAR.wavelength_m)
    slope = 2 * np.pi * (RADAR.array_spacing_m or 0.0) / RADAR.wavelength_m
    turn = np.exp(1j * slope * np.sin(np.arctan2(seen_m[:, 1], seen_m[:, 0])))
    direct_turn = np.exp(-1j * slope)  # the transmitter stands on the right of the receiver

    crest_tap = CREST_TAP + rng.uniform(-0.4, 0.4, frames)
    tap = np.arange(TAPS) - crest_tap[:, None]
    gain = 10 ** (rng.normal(0, 0.3, frames) / 20) * np.exp(2j * np.pi * rng.uniform(size=frames))
    fixed = direct * (pulse(tap) + sum(height * pulse(tap - late) for late, height in RINGING))
    for late, height in () if standing is None else standing(index):
        fixed = fixed + height[:, None] * pulse(tap - late)
    moving = sum(height * pulse(tap - delay_taps[:, None] - late) for late, height in echoes) * carrier[:, None]
    responses = []
    for antenna in (0, 0, 1):
        white = NOISE / np.sqrt(2) * (rng.normal(size=tap.shape) + 1j * rng.normal(size=tap.shape))
        clean = fixed * direct_turn**antenna + moving * turn[:, None] ** antenna
        responses.append(gain[:, None] * clean + white)
    target = Obstacle("target", "metal", target_m[None, :2])
    return Capture(
        name=name,
        radar=RADAR,
        trajectory=Trajectory(index / RADAR.frame_rate_hz, position_m, np.zeros(frames)),
        truth=Truth((target,) if echoes else ()),
        source="simulated",
        preamble=responses[0],
        sts1=responses[1],
        sts2=responses[2],
        first_path_index=crest_tap,
        first_path_index_sts1=crest_tap,
        first_path_index_sts2=crest_tap,
    )


def altered(capture: Capture, change: Callable[[ComplexArray], Any], *, receiver: bool = False) -> Capture:
    """Capture whose three responses (frames, taps) went through ``change``, which is given copies.

    Parameters
    ----------
    capture : Capture
    change : callable
    receiver : bool
        What changes is the receiver: so does its background.
    """
    parts: dict[str, Any] = {name: change(np.array(getattr(capture, name))) for name in ("preamble", "sts1", "sts2")}
    if receiver and capture.background is not None:
        parts["background"] = altered(capture.background, change)
    return dataclasses.replace(capture, **parts)


def on_radar(capture: Capture, radar: Radar, **parts: Any) -> Capture:
    """Capture, and its background, of another radar.

    Parameters
    ----------
    capture : Capture
    radar : Radar
    **parts
        What else is replaced in both.
    """
    background = None if capture.background is None else on_radar(capture.background, radar, **parts)
    return dataclasses.replace(capture, radar=radar, background=background, **parts)


def chosen(capture: Capture, rows: IntArray, timestamp_s: FloatArray | None = None) -> Capture:
    """Capture made of some frames of another, in the order of ``rows``, at their own times unless others are given.

    Parameters
    ----------
    capture : Capture
    rows : (n,) int array
        Indices of its frames; they may repeat.
    timestamp_s : (n,) array, optional
        Times of the chosen frames.

    Raises
    ------
    CaptureError
        If the times decrease.
    """
    track = capture.trajectory
    times = track.timestamp_s[rows] if timestamp_s is None else timestamp_s
    names = ("preamble", "sts1", "sts2", "first_path_index", "first_path_index_sts1", "first_path_index_sts2")
    parts: dict[str, Any] = {name: np.asarray(getattr(capture, name))[rows] for name in names}
    return dataclasses.replace(
        capture, trajectory=Trajectory(times, track.position_m[rows], track.yaw_rad[rows]), **parts
    )
