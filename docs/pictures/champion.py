"""Draw what ``champion`` finds in a hard room: in the world, and as ranges over time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import uwbbench
from uwbbench.api import BoolArray, Capture, Detections, FloatArray
from uwbbench.show.figures.style import BLUE, GREY, VERMILION, caption, figure, save, styled

SEED, ROOM = 7001, 2
GATE_M = 0.2


def main(path: Path) -> None:
    """Draw map and ranges of one room."""
    dataset = uwbbench.open_dataset("hard-rooms", {"seed": SEED, "count": ROOM})
    capture = dataset.open(dataset.names()[-1])
    found = uwbbench.load_detector("champion").run(capture)
    visible_m = _visible_m(capture)
    with np.errstate(invalid="ignore"):
        near = np.nanmin(np.abs(visible_m[found.frame] - found["range_m"][:, None]), axis=1, initial=np.inf) <= GATE_M
    with styled():
        drawn = figure(7.6, 3.4)
        left, right = drawn.subplots(1, 2, width_ratios=[1, 1.6])
        _map(left, capture, found, near)
        _ranges(right, capture, found, near, visible_m)
        said = "Blue: rows within 20 cm in range of a visible obstacle; red: others; pale: held."
        caption(drawn, [f"SIMULATED: {capture.name}, a development capture. {said}"])
        save(drawn, path)


def _visible_m(capture: Capture) -> FloatArray:
    """Range (frames, obstacles) of each obstacle; NaN where it is out of view or hidden."""
    sight = capture.truth.seen_from(capture.radar, capture.trajectory)
    seen = (np.abs(sight.azimuth_rad) <= np.pi / 4) & ~sight.occluded
    obstacles = [not item.structure for item in capture.truth.objects]
    return np.asarray(np.where(seen, sight.range_m, np.nan)[:, obstacles])


def _map(axes: Any, capture: Capture, found: Detections, near: BoolArray) -> None:
    """Rows where range and azimuth place them, by the true pose."""
    pose, radar = capture.trajectory, capture.radar
    yaw = pose.yaw_rad[found.frame]
    heading = yaw + radar.mount_yaw_rad + found["azimuth_rad"]
    mount = np.asarray(radar.mount_position_m)[:2]
    turn = np.stack([np.cos(yaw), -np.sin(yaw), np.sin(yaw), np.cos(yaw)], axis=-1).reshape(-1, 2, 2)
    place = pose.position_m[found.frame, :2] + turn @ mount
    place = place + found["range_m"][:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    for rows, colour in ((~near, VERMILION), (near, BLUE)):
        axes.plot(*place[rows].T, ".", color=colour, markersize=1, alpha=0.4, rasterized=True)
    for item in capture.truth.objects:
        outline = np.vstack([item.outline_m, item.outline_m[:1]])[:, :2]
        axes.plot(*outline.T, color=GREY if item.structure else "black", linewidth=1)
    axes.plot(*pose.position_m[:, :2].T, color=GREY, linewidth=0.8)
    walls = np.vstack([item.outline_m[:, :2] for item in capture.truth.objects])
    low, high = walls.min(axis=0) - 0.5, walls.max(axis=0) + 0.5
    axes.set(
        aspect="equal", xlabel="x (m)", ylabel="y (m)", title="map", xlim=(low[0], high[0]), ylim=(low[1], high[1])
    )


def _ranges(axes: Any, capture: Capture, found: Detections, near: BoolArray, visible_m: FloatArray) -> None:
    """Rows and visible obstacles over time."""
    time_s, held = capture.trajectory.timestamp_s, found["held"] > 0
    axes.plot(time_s, visible_m, color=GREY, linewidth=3, alpha=0.5)
    for rows, colour, alpha in (
        (~near & held, VERMILION, 0.15),
        (~near & ~held, VERMILION, 0.6),
        (near & held, BLUE, 0.15),
        (near & ~held, BLUE, 0.6),
    ):
        at = time_s[found.frame[rows]]
        axes.plot(at, found["range_m"][rows], ".", color=colour, markersize=1.2, alpha=alpha, rasterized=True)
    axes.set(xlabel="time (s)", ylabel="range (m)", title="rows; visible obstacles in grey", ylim=(0, 4))
