"""Prominence and width of true peaks against distance, by material."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.detections import Detections
from uwbbench.api.errors import ConfigError, ScoringError
from uwbbench.show.figures import style
from uwbbench.show.figures.source import Result, about

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BIN_M, LEAST = 0.2, 5
"""Width of the running median's window, and the fewest peaks in it."""

PROPERTIES = {"prominence": "Prominence", "width_taps": "Width (taps)"}


def draw_properties(results: list[Result], gate_m: float = 0.20) -> Figure:
    """Draw prominence and width of every peak near an obstacle, before the filters where they are known.

    Parameters
    ----------
    results : list of Result
        One detector on one or more captures.
    gate_m : float
        Largest difference between the range of a peak and that of the obstacle it is taken for.

    Raises
    ------
    ScoringError
        If a capture has no truth.
    ConfigError
        If the detector measures neither, or no peak lies near an obstacle.
    """
    points: dict[tuple[str, str], list[FloatArray]] = defaultdict(list)
    for result in results:
        number = result.header.radar.channel
        channel = f"channel {number}" if number else ""
        for material, rows in _near_obstacles(result, gate_m).items():
            points[channel, material].append(rows)
    if not points:
        raise ConfigError(f"no peak of '{results[0].detector}' lies within {gate_m:g} m of an obstacle in range")
    columns = sorted({channel for channel, _ in points})
    materials = sorted({material for _, material in points})
    with style.styled():
        drawn = style.figure(style.PAGE_IN if len(columns) > 1 else 5.0, 4.4)
        grid = drawn.subplots(2, len(columns), sharex=True, sharey="row", squeeze=False)
        for place, material in enumerate(materials):
            colour, marker = style.SERIES[place % 7], style.MARKERS[place % 7]
            for column, channel in enumerate(columns):
                if (channel, material) not in points:
                    continue
                distance_m, *values = np.concatenate(points[channel, material]).T
                for axes, value in zip(grid[:, column], values, strict=True):
                    axes.plot(distance_m, value, marker, color=colour, ms=1.6, mew=0, alpha=0.35, rasterized=True)
                    at_m, median = running_median(distance_m, value)
                    axes.plot(at_m, median, color="white", lw=2.4)
                    axes.plot(at_m, median, color=colour, ls=style.LINES[place % 7], lw=1.6)
        for axes, label in zip(grid[:, 0], PROPERTIES.values(), strict=True):
            axes.set_ylabel(label)
            axes.set_ylim(bottom=0.0)
        for axes, channel in zip(grid[0], columns, strict=True):
            axes.set_title(channel)
        for axes in grid[1]:
            axes.set_xlabel("Distance (m)")
        from matplotlib.lines import Line2D

        handles = [
            Line2D([], [], color=style.SERIES[n % 7], marker=style.MARKERS[n % 7], ls=style.LINES[n % 7])
            for n in range(len(materials))
        ]
        style.legend(grid[0, -1], handles, materials, loc="upper right")
        count = sum(len(rows) for parts in points.values() for rows in parts)
        text = f"{count} peaks within {gate_m:g} m of an obstacle; lines: running medians over {BIN_M:g} m."
        style.caption(drawn, [*_subjects(results), f"Detector {results[0].detector}.", text])
    return drawn


def _subjects(results: list[Result]) -> list[str]:
    named = list(dict.fromkeys(about(result.header) for result in results))
    if len(named) <= 3:
        return named
    simulated = sum(result.header.source == "simulated" for result in results)
    return [f"{len(results)} captures, {simulated} of them SIMULATED."]


def _near_obstacles(result: Result, gate_m: float) -> dict[str, FloatArray]:
    """Distance, prominence and width (n, 3) of the peaks that are taken for obstacles of each material."""
    header, peaks = result.header, result.detections
    if header.truth is None:
        raise ScoringError(f"capture '{header.name}' has no ground truth, so the distances of its peaks are unknown")
    known = peaks.candidates
    peaks = peaks if known is None else known
    missing = [name for name in (*PROPERTIES, "range_m") if len(peaks) and name not in peaks]
    if missing:
        raise ConfigError(f"detector '{result.detector}' does not measure {' and '.join(missing)} of its peaks")
    sight = header.truth.seen_from(header.radar, header.trajectory)
    error_m = np.abs(peaks["range_m"][:, None] - sight.range_m[peaks.frame])
    error_m = np.where(np.isnan(error_m) | sight.occluded[peaks.frame], np.inf, error_m)
    rows: dict[str, list[FloatArray]] = defaultdict(list)
    for column, obstacle in enumerate(header.truth.objects):
        mine = (error_m[:, column] <= gate_m) & (error_m[:, column] == error_m.min(axis=1, initial=np.inf))
        if mine.any() and not obstacle.structure:
            chosen = _one_a_frame(peaks.take(mine), error_m[mine, column])
            distance_m = sight.range_m[chosen.frame, column]
            rows[obstacle.material].append(np.stack([distance_m, *(chosen[name] for name in PROPERTIES)], axis=1))
    return {material: np.concatenate(parts) for material, parts in rows.items()}


def _one_a_frame(peaks: Detections, error_m: FloatArray) -> Detections:
    """The peak nearest to the obstacle in each frame."""
    order = np.lexsort((error_m, peaks.frame))
    _, first = np.unique(peaks.frame[order], return_index=True)
    return peaks.take(order[first])


def running_median(distance_m: FloatArray, value: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Medians over windows of :data:`BIN_M` metres, at steps of a quarter of that.

    Returns
    -------
    (k,) array, (k,) array
        Centres and medians; NaN where fewer than :data:`LEAST` values lie in the window.
    """
    finite = np.isfinite(distance_m) & np.isfinite(value)
    distance_m, value = distance_m[finite], value[finite]
    if not len(value):
        return np.empty(0), np.empty(0)
    centres = np.arange(distance_m.min(), distance_m.max() + BIN_M / 4, BIN_M / 4)
    order = np.argsort(distance_m)
    start, stop = np.searchsorted(distance_m[order], [centres - BIN_M / 2, centres + BIN_M / 2])
    medians = [
        float(np.median(value[order][a:b])) if b - a >= LEAST else np.nan for a, b in zip(start, stop, strict=True)
    ]
    return centres, np.array(medians)
