"""What each step of a detector leaves, from all peaks to clusters, seen from above."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from uwbbench.api.arrays import BoolArray
from uwbbench.api.text import printable
from uwbbench.show.figures import style
from uwbbench.show.figures.source import Result
from uwbbench.show.figures.topview import check_located, draw_scene, limits

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TALLEST = 0.95
"""Largest ratio of height to width of a panel."""


@dataclass(frozen=True)
class Panel:
    """Peaks left behind some steps.

    Attributes
    ----------
    title : str
    rows : (candidates,) bool array
    """

    title: str
    rows: BoolArray


def panels(result: Result) -> list[Panel]:
    """All peaks; those left behind each group of filters; those in clusters.

    Filters that follow each other without another step in between share a panel, so that ``paper`` has five: all
    peaks, behind the filters of shape, of SNR-score, of phase difference with the selection, and clusters.
    """
    peaks = result.candidates
    steps = list(result.detections.chain)
    # A step drops peaks for good, so what is left behind it is what no step up to it has dropped.
    dropped_at = np.where(np.isnan(peaks["rejected_by"]), np.inf, peaks["rejected_by"])
    shown = [Panel("all peaks", np.ones(len(peaks), bool))]
    group: list[str] = []
    for place, label in enumerate(steps):
        if label not in result.filters:
            continue
        group.append(label.removeprefix("filter.").removeprefix("select."))
        if place + 1 == len(steps) or steps[place + 1] not in result.filters:
            shown.append(Panel(", ".join(group), dropped_at > place))
            group = []
    if "cluster" in result.detections:
        shown.append(Panel("clusters", (peaks["retained"] == 1) & (peaks["cluster"] >= 0)))
    return shown


def draw_pipeline(result: Result) -> Figure:
    """Draw one panel in x and y for each group of filters, coloured by SNR-score.

    Raises
    ------
    ConfigError
        If the peaks have no positions.
    StoreError
        If they come from a run that did not keep the peaks before the filters.
    """
    peaks, header = result.candidates, result.header
    check_located(peaks, header, result.detector)
    shown = panels(result)
    span_x, span_y = limits(header, peaks)
    score = peaks["score_db"]
    finite = score[np.isfinite(score)]
    low, high = np.percentile(finite, [2, 98]) if len(finite) else (0.0, 1.0)
    columns = min(3, len(shown))
    rows = -(-(len(shown) + 1) // columns)
    with style.styled():
        import matplotlib as mpl
        from matplotlib.colors import Normalize

        wanted = (span_y[1] - span_y[0]) / TALLEST
        if wanted > span_x[1] - span_x[0]:  # a taller scene gets room at its sides, or the page would not hold it
            middle = (span_x[0] + span_x[1]) / 2
            span_x = (middle - wanted / 2, middle + wanted / 2)
        height = float(max(2.2 * (span_y[1] - span_y[0]) / (span_x[1] - span_x[0]), 0.8))
        colours = mpl.colormaps["viridis"].with_extremes(bad=style.GREY)  # grey: no score
        drawn = style.figure(style.PAGE_IN, rows * (height + 0.35) + 0.5)
        grid = drawn.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
        scale = Normalize(low, high if high > low else low + 1.0)
        for letter, axes, panel in zip("abcdefghijklmnop", grid, shown, strict=False):
            handles, labels = draw_scene(axes, header)
            order = np.flatnonzero(panel.rows)
            order = order[np.argsort(np.nan_to_num(score[order], nan=-np.inf))]  # strong ones on top
            points = axes.scatter(
                peaks["x_m"][order],
                peaks["y_m"][order],
                c=score[order],
                norm=scale,
                cmap=colours,
                s=3,
                lw=0,
                plotnonfinite=True,
                zorder=4,
                rasterized=len(order) > 5000,
            )
            axes.set_title(printable(f"({letter}) {panel.title}: {panel.rows.sum()}"), fontsize=7.5)
            axes.set_xlim(span_x)
            axes.set_ylim(span_y)
            axes.locator_params(nbins=5)
            axes.label_outer()
        for axes in grid[: len(shown)]:
            axes.set_xlabel("x (m)")
            axes.tick_params(labelbottom=True)
        for axes in grid[::columns]:
            axes.set_ylabel("y (m)")
        for axes in grid[len(shown) :]:
            axes.set_axis_off()
        spare = grid[len(shown)]
        bar = spare.inset_axes((0.08, 0.5, 0.84, 0.07))
        drawn.colorbar(points, cax=bar, orientation="horizontal", label="SNR-score (dB)", extend="both")
        style.legend(spare, handles, labels, loc="upper center", ncols=2)
        style.caption(drawn, [result.subject, "Numbers: peaks left behind the steps."])
    return drawn
