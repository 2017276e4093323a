"""What mappers made of a run: the map over what was there, and trajectories with their errors over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.errors import ConfigError
from uwbbench.api.mapper import LandmarkKind
from uwbbench.config.rules import Table
from uwbbench.results.drives import Frame, MappedDrive, ellipses, poses_of, thinned
from uwbbench.show.figures import style
from uwbbench.show.figures.source import Result, about, mapped_of
from uwbbench.show.figures.topview import MARGIN_M, draw_scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ON_THE_WAY = 12
"""Ellipses of the robot's position along its path."""

FOUND = 4000
"""Echoes at most; more would hide the map."""

FRAMES = {
    "start": "The start of the estimate lies on the true one.",
    "aligned": "The estimate is turned and shifted so that all its positions fit best.",
}


def laid(result: Result, table: Table, frame: Frame) -> MappedDrive:
    """Poses and map of a result, over the truth.

    Parameters
    ----------
    result : Result
    table : {"filtering", "mapping"}
        Poses as they were handed out, or as they were known at the end.
    frame : {"start", "aligned"}

    Raises
    ------
    ConfigError
        If its detector has no mapper.
    StoreError
        If it has no such poses.
    """
    mapped = mapped_of(result)
    return MappedDrive(result.header, result.detections, mapped, poses_of(mapped, table, result.detector), frame)


def draw_drive_map(result: Result, table: Table = "filtering", frame: Frame = "start") -> Figure:
    """Draw the map of a run over the true outlines, with what the front ends have found, faint.

    Parameters
    ----------
    result : Result
    table : {"filtering", "mapping"}
        Poses of the path.
    frame : {"start", "aligned"}

    Raises
    ------
    ConfigError
        If its detector has no mapper.
    StoreError
        If it has no such poses.
    """
    drive = laid(result, table, frame)
    with style.styled():
        drawn = style.figure(style.PAGE_IN, _height(drive) + 0.9)
        axes = drawn.subplots()
        handles, labels = draw_scene(axes, drive.header)
        for name, handle in (_grid(axes, drive), _echoes(axes, drive), *_map(axes, drive), *_path(axes, drive)):
            if handle is not None:
                handles.append(handle)
                labels.append(name)
        low_m, high_m = drive.box_m
        axes.set_xlim(low_m[0] - MARGIN_M, high_m[0] + MARGIN_M)
        axes.set_ylim(low_m[1] - MARGIN_M, high_m[1] + MARGIN_M)
        _metres(axes, "box")
        style.legend(axes, handles, labels, loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)
        marks = drive.mapped.map.landmarks
        stated = f"Landmarks: {len(marks)}. Ellipses: 95 %, as the mapper states them." if len(marks) else ""
        style.caption(drawn, [result.subject, stated, FRAMES[frame]])
    return drawn


def draw_trajectories(results: list[Result], table: Table = "filtering", frame: Frame = "start") -> Figure:
    """Draw the paths of detectors on one run, and their errors over time; of a single one with ellipses and band.

    Parameters
    ----------
    results : list of Result
        Of one run.
    table : {"filtering", "mapping"}
    frame : {"start", "aligned"}

    Raises
    ------
    ConfigError
        If a detector has no mapper, or there are several runs.
    StoreError
        If a detector has no such poses.
    """
    runs = {(result.dataset, result.header.name) for result in results}
    if len(runs) > 1:
        names = ", ".join(f"{name} of {dataset}" if dataset else name for dataset, name in sorted(runs))
        raise ConfigError(f"choose one run with --capture and --dataset: {names}")
    drives = {result.detector: laid(result, table, frame) for result in results}
    alone = len(drives) == 1
    with style.styled():
        drawn = style.figure(style.PAGE_IN, min(_height(next(iter(drives.values()))), 3.2) + 1.2)
        above, over_time = drawn.subplots(1, 2)
        handles, labels = draw_scene(above, results[0].header)
        looks = zip(drives.items(), style.SERIES * 3, style.LINES * 3, strict=False)
        for (name, drive), colour, line in looks:
            look: dict[str, Any] = {"color": colour, "ls": line, "lw": 1.0, "zorder": 4}
            handles += above.plot(*drive.pose[:, :2].T, **look)
            labels.append(name)
            over_time.plot(drive.time_s, 100 * drive.error_m, **look)
            if alone:
                _ellipses_on_the_way(above, drive, colour)
                if drive.band_m is not None:
                    band = over_time.fill_between(drive.time_s, 100 * drive.band_m, color=colour, alpha=0.15, lw=0)
                    style.legend(over_time, [band], ["95 %, as stated"], loc="upper left")
        _metres(above, "datalim")
        over_time.set_xlabel("time (s)")
        over_time.set_ylabel("error of the position (cm)")
        over_time.set_ylim(bottom=0)
        over_time.margins(x=0.01)
        style.legend(above, handles, labels, loc="lower left", bbox_to_anchor=(0.0, 1.01), ncols=2, borderaxespad=0.0)
        who = f"Detector {results[0].detector}." if alone else ""
        style.caption(drawn, [about(results[0].header), who, FRAMES[frame]])
    return drawn


def _height(drive: MappedDrive) -> float:
    """Height in inches of a picture of what was there."""
    low_m, high_m = drive.box_m
    shape = (high_m[1] - low_m[1] + 2 * MARGIN_M) / (high_m[0] - low_m[0] + 2 * MARGIN_M)
    return float(np.clip(5.2 * shape, 1.4, 6.5))


def _metres(axes: Axes, adjustable: Literal["box", "datalim"]) -> None:
    axes.set_aspect("equal", adjustable=adjustable)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def _grid(axes: Axes, drive: MappedDrive) -> tuple[str, Any]:
    """Cells, the darker the more probably they are occupied."""
    from matplotlib.patches import Patch

    grid = drive.grid
    if grid is None or not grid.log_odds.size:
        return "", None
    rows, columns = grid.log_odds.shape
    corner = np.stack(np.meshgrid(np.arange(columns + 1), np.arange(rows + 1)), axis=-1)
    corner_m = drive.motion.of_points((grid.origin_m + grid.cell_m * corner).reshape(-1, 2)).reshape(*corner.shape)
    probable = np.ma.masked_equal(1 / (1 + np.exp(-grid.log_odds)), 0.5)
    axes.pcolormesh(*np.moveaxis(corner_m, -1, 0), probable, cmap="Greys", vmin=0, vmax=1.4, zorder=0, rasterized=True)
    return "probably occupied", Patch(fc="0.35")


def _echoes(axes: Axes, drive: MappedDrive) -> tuple[str, Any]:
    _, place_m = drive.found
    shown = place_m[thinned(len(place_m), FOUND)]
    if not len(shown):
        return "", None
    axes.plot(*shown.T, ".", color=style.SKY, ms=1.5, mew=0, alpha=0.5, zorder=1)
    return f"detections ({len(place_m)})", axes.plot([], [], ".", color=style.SKY, ms=5, mew=0)[0]


def _map(axes: Axes, drive: MappedDrive) -> list[tuple[str, Any]]:
    """Surfaces, segments, lines and landmarks."""
    drawn: list[tuple[str, Any]] = []
    if len(drive.points_m):
        drawn.append(("points", axes.plot(*drive.points_m.T, ".", color=style.ORANGE, ms=2, mew=0, zorder=3)[0]))
    for name, pieces_m, line in (("segments", drive.segments_m, "-"), ("lines", drive.lines_m, ":")):
        for number, piece_m in enumerate(pieces_m):
            handle = axes.plot(*piece_m.T, color=style.ORANGE, lw=1.6, ls=line, zorder=3)[0]
            if not number:
                drawn.append((name, handle))
    looks: dict[LandmarkKind, tuple[str, str, str]] = {
        "point": ("landmarks", "o", style.VERMILION),
        "anchor": ("anchors", "^", style.PURPLE),
    }
    for kind, (name, marker, colour) in looks.items():
        place_m, covariance = drive.marks(kind)
        if len(place_m):
            handle = axes.plot(*place_m.T, marker, color=colour, ms=4, mfc="none", mew=1.0, ls="none", zorder=6)[0]
            _outlines(axes, ellipses(place_m, covariance), colour)
            drawn.append((name, handle))
    return drawn


def _path(axes: Axes, drive: MappedDrive) -> list[tuple[str, Any]]:
    handle = axes.plot(*drive.pose[:, :2].T, color=style.BLUE, lw=1.0, zorder=4)[0]
    _ellipses_on_the_way(axes, drive, style.BLUE)
    return [("estimated path", handle)]


def _ellipses_on_the_way(axes: Axes, drive: MappedDrive, colour: str) -> None:
    if drive.spread_m2 is not None and drive.frame == "start":
        rows = thinned(len(drive.pose), ON_THE_WAY)
        _outlines(axes, ellipses(drive.pose[rows, :2], drive.spread_m2[rows]), colour)


def _outlines(axes: Axes, corners_m: FloatArray, colour: str) -> None:
    from matplotlib.collections import LineCollection

    axes.add_collection(LineCollection(list(corners_m), colors=colour, linewidths=0.6, alpha=0.8, zorder=5))
