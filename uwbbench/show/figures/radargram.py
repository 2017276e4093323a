"""A whole capture as an image over time and range, with what was there and what was found."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.block import Block
from uwbbench.api.capture import Capture, CaptureHeader
from uwbbench.api.detections import Detections
from uwbbench.api.errors import ConfigError
from uwbbench.api.frames import BATCH_FRAMES
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.accuracy.scoring import Region
from uwbbench.results.ground_truth import true_ranges
from uwbbench.results.radargram import levels
from uwbbench.show.figures import style
from uwbbench.show.figures.source import about

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS, ROWS = 1500, 500
"""Largest image: more than a page prints at 200 dots an inch."""
FLOOR_DB = -60.0


def draw_radargram(capture: Capture, detector: Pipeline | None = None) -> Figure:
    """Draw amplitude over time and range, with true ranges, and the detections where a detector is given.

    The amplitude is that which the detector searches, without the clutter that it removes; each frame is shifted so
    that its delays count from the first path.

    Raises
    ------
    ConfigError
        If the capture has no frames, or the detector gives no ranges.
    """
    if not len(capture):
        raise ConfigError(f"capture '{capture.name}' has no frames")
    detections = None if detector is None else detector.run(capture)
    if detections is not None and len(detections) and "range_m" not in detections:
        raise ConfigError("the detections have no range_m; add the stage 'range' to the detector")
    range_m = np.linspace(0.0, capture.radar.window_m, min(ROWS, 4 * capture.radar.taps))
    shown = np.arange(0, len(capture), _step(len(capture)), dtype=np.int64)
    time_s = capture.trajectory.timestamp_s[shown] - capture.trajectory.timestamp_s[0]
    blocks: Iterable[Block]
    if detector is None:
        blocks = (Block(frames) for frames in capture.blocks(BATCH_FRAMES))
    else:
        blocks = detector.signals(capture)
    image_db, zero = levels(blocks, capture.radar, range_m, shown, FLOOR_DB)
    with style.styled():
        drawn = style.figure(style.PAGE_IN, 3.4)
        axes = drawn.subplots()
        weakest = np.percentile(image_db[np.isfinite(image_db)], 5) if np.isfinite(image_db).any() else FLOOR_DB
        floor = min(max(FLOOR_DB, 5 * np.floor(weakest / 5)), -5.0)
        mesh = axes.pcolormesh(
            _edges(time_s), _edges(range_m), image_db.T, cmap="Greys", vmin=floor, vmax=0.0, rasterized=True
        )
        axes.grid(visible=False)
        drawn.colorbar(mesh, ax=axes, label="Amplitude (dB below the strongest)", pad=0.01, extend="min")
        handles, labels = _truth(axes, capture)
        if detections is not None:
            handles.append(_detections(axes, capture, detections))
            labels.append(f"detections ({len(detections)})")
        axes.set_xlabel("Time (s)")
        axes.set_ylabel("Range (m)")
        axes.set_xlim(*_edges(time_s)[[0, -1]])
        seen = range_m[np.isfinite(image_db).any(axis=0)]
        axes.set_ylim(*((seen[0], seen[-1]) if len(seen) > 1 else (0.0, capture.radar.window_m)))
        style.legend(axes, handles, labels, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4)
        after = "Amplitude as stored" if detector is None else "Amplitude that the detector searches"
        text = f"{after}; delays count from {zero}; ranges of the image hold on boresight."
        if handles and capture.truth is not None:
            widest_deg = np.rad2deg(Region().widest_rad(capture.radar))
            text += f" Truth is thin farther than {widest_deg:g} degrees from boresight, and left out where hidden."
        step = _step(len(capture))
        thinned = "" if step == 1 else f"One frame in {step} is shown, and all detections."
        style.caption(drawn, [about(capture), "" if detector is None else f"Detector {detector.name}.", text, thinned])
    return drawn


def _step(frames: int) -> int:
    return -(-frames // COLUMNS)


def _edges(centres: FloatArray) -> FloatArray:
    """Cell borders (n + 1,) half way between centres (n,)."""
    if len(centres) == 1:
        return np.array([centres[0] - 0.5, centres[0] + 0.5])
    middle = (centres[1:] + centres[:-1]) / 2
    return np.concatenate([[2 * centres[0] - middle[0]], middle, [2 * centres[-1] - middle[-1]]])


def _truth(axes: Axes, header: CaptureHeader) -> tuple[list[Any], list[str]]:
    """Draw the true range of each obstacle: thin outside the sector that scores look at, nothing where it is hidden."""
    from matplotlib import patheffects

    time_s = header.trajectory.timestamp_s - header.trajectory.timestamp_s[0]
    handles: list[Any] = []
    labels = []
    halo = [patheffects.withStroke(linewidth=2.6, foreground="white")]
    colours = (style.BLUE, style.GREEN, style.PURPLE, style.SKY, style.ORANGE)
    for number, one in enumerate(true_ranges(header)):
        look: dict[str, Any] = {"color": colours[number % 5], "ls": style.LINES[1 + number % 6], "lw": 1.3}
        axes.plot(time_s, one.range_m, **{**look, "lw": 0.6, "ls": "-"}, zorder=2)
        handles += axes.plot(time_s, one.ahead_m, path_effects=halo, zorder=3, **look)
        labels.append(f"true range, {one.name}")
    return handles, labels


def _detections(axes: Axes, header: CaptureHeader, detections: Detections) -> Any:
    time_s = header.trajectory.timestamp_s - header.trajectory.timestamp_s[0]
    crowded = len(detections) > 3 * len(header)
    look: dict[str, Any] = {"ms": 1.2 if crowded else 2.4, "mew": 0.0, "alpha": 0.6 if crowded else 0.9}
    return axes.plot(time_s[detections.frame], detections.range_m, "o", color=style.VERMILION, zorder=4, **look)[0]
