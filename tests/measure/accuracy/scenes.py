"""Posts before a receiver at the origin, and detections of them."""

import numpy as np

from uwbbench.api import SPEED_OF_LIGHT_M_S, Detections, Obstacle, Radar, Trajectory, Truth
from uwbbench.api.capture import CaptureHeader

WINDOW_M, RATE_HZ, GATE_M = 10.0, 10.0, 0.2

OF_DETECTIONS = ("frame", "peak", "object", "latest")
"""Scorings of detections, whatever columns these have besides their range."""


def capture_of(*objects, frames=4, exhaustive=True, has_sts=False, position_m=None, yaw_rad=None):
    """Capture of a receiver at the origin that looks along +x, unless it is told to move."""
    radar = Radar(
        model="test",
        center_frequency_hz=8e9,
        bandwidth_hz=5e8,
        sample_interval_s=2 * WINDOW_M / 100 / SPEED_OF_LIGHT_M_S,
        frame_rate_hz=RATE_HZ,
        taps=100,
        has_sts=has_sts,
    )
    position_m = np.zeros((frames, 3)) if position_m is None else np.asarray(position_m, float)
    yaw_rad = np.zeros(frames) if yaw_rad is None else np.asarray(yaw_rad, float)
    trajectory = Trajectory(np.arange(frames) / RATE_HZ, position_m, yaw_rad)
    return CaptureHeader(name="scene", radar=radar, trajectory=trajectory, truth=Truth(objects, exhaustive))


def post(x, y=0.0, *, structure=False):
    return Obstacle(f"post {x} {y}", "metal", np.array([[x, y]], float), structure)


def found_in(frames, *rows, amplitude=None, **columns):
    """Detections given as (frame, range_m) in a capture of so many processed frames."""
    frame, range_m = np.array(rows, float).reshape(-1, 2).T
    if amplitude is not None:
        columns["amplitude"] = amplitude
    return Detections(frame, range_m=range_m, processed=np.arange(frames), **columns)


def at_once(found):
    """The same detections, each frame answered after its own step."""
    return found.with_hand_outs(found.frame, found.processed)


def counts(scores):
    block = scores.filtering
    return block.tp, block.fp, block.fn
