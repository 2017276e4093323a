"""The frames that are timed: simulated, all distinct, in the numbers and sizes that the targets name.

A processor learns the branches of a few hundred frames by heart and then looks twice too fast, so that no benchmark
repeats fewer than thousands.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from uwbbench.api import Capture, ComplexArray, FloatArray, Radar, Samples, Trajectory
from uwbbench.api.registry import load_plugin
from uwbbench_datasets.simulator.engine import simulate
from uwbbench_datasets.simulator.scene import read_scenes

FRAMES = 5600
FRAME_RATE_HZ = 96.0
_ROOM = Path(__file__).parents[2] / "configs" / "scenes" / "room.yaml"
_ROUND_M = 10.0  # length of the robot's way through the shipped room
_PULSE_TAPS = 3.2  # full width at half height of a 500 MHz pulse, in taps of 1 ns


def approach(frames: int = FRAMES, *, channel: int = 9, sts: bool = True, seed: int = 1) -> Capture:
    """The built-in simulated approach to a metal plate, slow enough to last for so many frames (50 taps)."""
    speed_m_s = 2.8 * FRAME_RATE_HZ / (frames - 0.5)
    changes = {"channel": channel, "sts": sts, "seed": seed, "speed_m_s": speed_m_s, "frame_rate_hz": FRAME_RATE_HZ}
    adapter = load_plugin("datasets", "approach")
    dataset = adapter(adapter.params_type().model_validate(changes), ())
    return dataset.open(dataset.names()[0])


def tour(frames: int = FRAMES) -> Capture:
    """The shipped room seen from a robot that goes round once in so many frames (50 taps, STS); for mapping."""
    changes = {"trajectory.speed_m_s": _ROUND_M * FRAME_RATE_HZ / (frames - 0.5), "radar.frame_rate_hz": FRAME_RATE_HZ}
    return simulate(read_scenes(_ROOM, changes)[0]).captures[0]


def echoes(frames: int, taps: int, seed: int = 1) -> Capture:
    """Frames of any length: a direct path, one echo for every 12 taps, and noise as a receiver's filter shapes it."""
    rng = np.random.default_rng(seed)
    at = np.arange(taps)
    reach = np.arange(-8, 9)
    response = np.zeros((frames, taps), complex)
    for column in np.linspace(18, taps, taps // 12, endpoint=False):
        arrival = column + rng.uniform(-5, 5, (frames, 1))
        response += _complex(rng, (frames, 1)) * 0.3 * _pulse(at - arrival)
    response += _pulse(at - (7 + rng.uniform(-0.5, 0.5, (frames, 1)))) * np.exp(2j * np.pi * rng.uniform())
    noise = np.fft.ifft(np.fft.fft(_complex(rng, (frames, taps))) * np.fft.fft(_pulse(reach), taps))
    return recorded((response + 0.01 * noise).astype(np.complex64))


def comb(frames: int, taps: int, seed: int = 1) -> Capture:
    """Frames of alternating high and low taps, highest in the middle.

    Every second tap is a peak whose higher neighbours lie only towards the middle, so that a search for its bases that
    walks tap by tap crosses half a frame: its work grows with the square of the taps.
    """
    rng = np.random.default_rng(seed)
    at = np.arange(taps)
    hill = 1 - np.abs(2 * at / taps - 1 + rng.uniform(-0.1, 0.1, (frames, 1)))
    height = np.where(at % 2 == 0, 1 + hill, 0.2 + 0.05 * rng.uniform(size=(frames, taps)))
    return recorded((height * np.exp(2j * np.pi * rng.uniform(size=(frames, taps)))).astype(np.complex64))


def lengthened(capture: Capture, frames: int) -> Capture:
    """A capture of so many frames, those of ``capture`` again and again; a recording that never fits into memory."""
    changes: dict[str, Any] = {"preamble": _Repeated(capture.preamble, frames), "trajectory": _track(frames)}
    for name in ("sts1", "sts2"):
        if (samples := getattr(capture, name)) is not None:
            changes[name] = _Repeated(samples, frames)
    for name in ("first_path_index", "first_path_index_sts1", "first_path_index_sts2"):
        if (values := getattr(capture, name)) is not None:
            changes[name] = np.resize(values, frames)
    return dataclasses.replace(capture, **changes)


class _Repeated:
    """Rows of an array over and over, made when they are asked for."""

    def __init__(self, samples: Samples, frames: int) -> None:
        self._samples = np.asarray(samples[:])
        self.shape = (frames, samples.shape[1])

    def __getitem__(self, key: slice) -> ComplexArray:
        return self._samples.take(np.arange(*key.indices(self.shape[0])), axis=0, mode="wrap")


def recorded(preamble: ComplexArray) -> Capture:
    """A capture of these samples by a radar like that of the approach, which stands still and has no STS."""
    radar = Radar(
        model="simulated",
        center_frequency_hz=7987.2e6,
        bandwidth_hz=499.2e6,
        sample_interval_s=1 / (2 * 499.2e6),
        frame_rate_hz=FRAME_RATE_HZ,
        taps=preamble.shape[1],
        channel=9,
        tx_position_m=(0.0, -0.25, 0.0),
        noise_taps=4,
    )
    track = _track(len(preamble))
    return Capture(name="benchmark", radar=radar, trajectory=track, source="simulated", preamble=preamble)


def _track(frames: int) -> Trajectory:
    return Trajectory(np.arange(frames) / FRAME_RATE_HZ, np.zeros((frames, 3)), np.zeros(frames))


def _complex(rng: np.random.Generator, shape: tuple[int, ...]) -> ComplexArray:
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def _pulse(taps: FloatArray) -> FloatArray:
    return np.exp(-4 * np.log(2) * (taps / _PULSE_TAPS) ** 2)
