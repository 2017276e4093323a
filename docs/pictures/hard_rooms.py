"""Draw a hard room: its map with the robot's way, and its radargram with the ranges that are to be found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import uwbbench
from uwbbench.api import SPEED_OF_LIGHT_M_S, Capture, FloatArray
from uwbbench.show.figures.style import BLUE, GREY, VERMILION, caption, figure, save, styled

SEED, ROOM = 7001, 2
DEEPEST_DB = -50.0


def main(path: Path) -> None:
    """Draw map and radargram of one room."""
    dataset = uwbbench.open_dataset("hard-rooms", {"seed": SEED, "count": ROOM})
    capture = dataset.open(dataset.names()[-1])
    with styled():
        drawn = figure(7.6, 3.4)
        left, right = drawn.subplots(1, 2, width_ratios=[1, 1.6])
        _map(left, capture)
        _radargram(right, capture)
        caption(drawn, [f"SIMULATED: {capture.name}. Right: frames aligned to the direct path, less their median."])
        save(drawn, path)


def _map(axes: Any, capture: Capture) -> None:
    """Outlines, the way of the robot, and where odometry has it."""
    for item in capture.truth.objects:
        outline = np.vstack([item.outline_m, item.outline_m[:1]])
        axes.plot(*outline[:, :2].T, color=GREY if item.structure else VERMILION, linewidth=1)
        if not item.structure:
            axes.annotate(item.name, item.outline_m[:, :2].mean(axis=0), fontsize=6, ha="center")
    axes.plot(*capture.trajectory.position_m[:, :2].T, color=BLUE, label="robot")
    axes.plot(*capture.odometry_position_m[:, :2].T, color=BLUE, linestyle=":", linewidth=0.8, label="by odometry")
    axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)", title="map")
    axes.legend(loc="upper right", fontsize=6)


def _radargram(axes: Any, capture: Capture) -> None:
    """Echoes over time, and the taps of visible obstacles."""
    frames = capture.frames().preamble
    crest = np.abs(frames).argmax(axis=1)
    scaled = frames / frames[np.arange(len(frames)), crest][:, None]
    moving = scaled - np.median(scaled.real, axis=0) - 1j * np.median(scaled.imag, axis=0)
    level_db = 20 * np.log10(np.abs(moving) + 10 ** (DEEPEST_DB / 20))
    time_s = capture.trajectory.timestamp_s
    half = 0.5 / capture.radar.frame_rate_hz
    extent = (time_s[0] - half, time_s[-1] + half, frames.shape[1] - 0.5, -0.5)
    axes.imshow(level_db.T, aspect="auto", vmin=DEEPEST_DB, vmax=-10, extent=extent, cmap="Greys", interpolation="none")
    tap = _taps(capture) + np.median(crest)
    axes.plot(time_s, tap, color=VERMILION, linewidth=0.9)
    axes.set(xlabel="time (s)", ylabel="tap", title="radargram, visible obstacles in red")


def _taps(capture: Capture) -> FloatArray:
    """Delay (frames, obstacles) in taps after the direct path; NaN where an obstacle is out of view."""
    radar, sight = capture.radar, capture.truth.seen_from(capture.radar, capture.trajectory)
    seen = (np.abs(sight.azimuth_rad) <= np.pi / 4) & ~sight.occluded & (sight.range_m >= 0.6)
    ahead = sight.range_m[..., None] * np.stack([np.cos(sight.azimuth_rad), np.sin(sight.azimuth_rad)], axis=-1)
    excess_m = sight.range_m + np.linalg.norm(ahead - radar.baseline_m[:2], axis=-1) - radar.baseline_length_m
    obstacles = [not item.structure for item in capture.truth.objects]
    late = np.where(seen, excess_m / SPEED_OF_LIGHT_M_S / radar.sample_interval_s, np.nan)
    return np.asarray(late[:, obstacles])
