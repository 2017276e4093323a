"""SIMULATED captures of a radar like the PulsON 440: real RF from 3.1 to 4.8 GHz, a bin every 61 ps.

The simulator that uwbbench ships knows DW3000 radars only. These scenes are made of points: each gives one pulse at its
delay. What is labelled is all that moves against the radar, so that every other detection is false.
"""

from __future__ import annotations

import numpy as np

from uwbbench.api import SPEED_OF_LIGHT_M_S, Capture, FloatArray, Obstacle, Radar, Trajectory, Truth

CARRIER_HZ, BAND_HZ = 3.95e9, 1.7e9
BIN_S = 1e-9 / (512 * 1.024) * 32
BINS = 640
START_M = 1.0
NOISE = 1.0


def echoes(range_m: FloatArray, amplitude: FloatArray) -> FloatArray:
    """Scans (frames, bins) of points at ranges (frames, points), each a Gaussian pulse on the carrier.

    Parameters
    ----------
    range_m : (frames, points) array
    amplitude : (frames, points) array
        Of the envelope.
    """
    delay_s = 2 * START_M / SPEED_OF_LIGHT_M_S + BIN_S * np.arange(BINS)
    # A Gaussian spectrum that is 10 dB down at the edges of the band.
    width_s = np.sqrt(np.log(10) / 2) / (np.pi * BAND_HZ / 2) * np.sqrt(2)
    scans = np.zeros((len(range_m), BINS))
    for place_m, height in zip(range_m.T, amplitude.T, strict=True):
        late_s = delay_s - 2 * place_m[:, None] / SPEED_OF_LIGHT_M_S
        envelope = height[:, None] * np.exp(-((late_s / width_s) ** 2))
        scans += envelope * np.cos(2 * np.pi * CARRIER_HZ * late_s)
    return scans


def radar(frame_rate_hz: float) -> Radar:
    """A radar that knows when it sent."""
    return Radar(
        model="simulated PulsON 440",
        center_frequency_hz=CARRIER_HZ,
        bandwidth_hz=BAND_HZ,
        sample_interval_s=BIN_S,
        frame_rate_hz=frame_rate_hz,
        taps=BINS,
        samples="rf",
        first_tap_delay_s=2 * START_M / SPEED_OF_LIGHT_M_S,
    )


def level(snr_db: FloatArray | float) -> FloatArray:
    """Envelope of an echo whose power is so far above that of the noise's envelope."""
    return np.asarray(NOISE * np.sqrt(2) * 10 ** (np.asarray(snr_db) / 20))


def passing(seed: int) -> Capture:
    """A radar that starts, passes two reflectors at some 5 m and stops; coupling between its antennas rides along."""
    rng = np.random.default_rng((440, seed))
    rate_hz, frames = 58.0, 300
    time_s = np.arange(frames) / rate_hz
    speed = np.interp(time_s, [0.5, 1.0, 4.4, 4.9], [0, 1, 1, 0]) * rng.uniform(0.3, 1.0)
    along_m = np.cumsum(speed) / rate_hz
    targets_m = np.column_stack([rng.uniform(3.5, 6.0, 2), along_m[-1] * rng.uniform(-0.2, 1.2, 2)])
    range_m = np.hypot(targets_m[:, 0], along_m[:, None] - targets_m[:, 1])
    scans = echoes(range_m, level(rng.uniform(15, 25, 2)) * (5.0 / range_m) ** 2)
    coupling_m = START_M + rng.exponential(0.6, 40)
    drift = 1 + 0.01 * np.cumsum(rng.normal(size=frames)) / np.sqrt(frames)
    heights = level(45.0) * np.exp(-(coupling_m - START_M) / 0.4) * rng.normal(size=40)
    scans += drift[:, None] * echoes(coupling_m[None], heights[None])
    scans += NOISE * rng.normal(size=scans.shape)
    position_m = np.column_stack([np.zeros(frames), along_m, np.zeros(frames)])
    objects = tuple(Obstacle(f"reflector {i}", "corner reflector", place[None]) for i, place in enumerate(targets_m))
    return _capture(f"passing-{seed}", radar(rate_hz), Trajectory(time_s, position_m, np.zeros(frames)), objects, scans)


def walking(seed: int) -> Capture:
    """A person who walks before a fixed radar, in a room whose furniture is stronger than he is."""
    rng = np.random.default_rng((441, seed))
    rate_hz, frames = 30.0, 500
    time_s = np.arange(frames) / rate_hz
    corners_m = np.column_stack([rng.uniform(1.5, 5.0, 5), rng.uniform(-1.5, 1.5, 5)])
    legs_m = np.linalg.norm(np.diff(corners_m, axis=0), axis=1)
    walked_m = np.cumsum(np.full(frames, legs_m.sum() / frames))
    path_m = np.column_stack([np.interp(walked_m, np.append(0, np.cumsum(legs_m)), axis) for axis in corners_m.T])
    limbs_m = rng.uniform(-0.18, 0.18, (6, 2))
    swing_m = rng.uniform(0, 0.12, 6) * np.sin(2 * np.pi * (1.8 * time_s[:, None] + rng.uniform(size=6)))
    range_m = np.linalg.norm(path_m[:, None] + limbs_m, axis=2) + swing_m
    scans = echoes(range_m, level(rng.uniform(8, 20, 6)) * (3.0 / range_m) ** 2)
    room_m = rng.uniform(1.0, 6.5, 60)
    scans += echoes(room_m[None], level(rng.normal(25, 8, 60))[None] * (3.0 / room_m) ** 2)
    scans += NOISE * rng.normal(size=scans.shape)
    person = Obstacle("person", "person", path_m[:, None])
    still = Trajectory(time_s, np.zeros((frames, 3)), np.zeros(frames))
    return _capture(f"walking-{seed}", radar(rate_hz), still, (person,), scans)


def _capture(name: str, sensor: Radar, track: Trajectory, objects: tuple[Obstacle, ...], scans: FloatArray) -> Capture:
    return Capture(
        name=name,
        radar=sensor,
        trajectory=track,
        truth=Truth(objects),
        source="simulated",
        license="made here",
        preamble=scans.astype(np.float32),
        receivers=(sensor.receiver,),
    )
