"""The map that a detector made: clustered points among the true outlines."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from uwbbench.show.figures import style
from uwbbench.show.figures.source import Result
from uwbbench.show.figures.topview import check_located, draw_scene, limits

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_map(result: Result) -> Figure:
    """Draw the clusters, each in its own colour and marker, the points outside of them, outlines and path.

    Raises
    ------
    ConfigError
        If the detections have no positions.
    """
    points, header = result.detections, result.header
    check_located(points, header, result.detector)
    span_x, span_y = limits(header, points)
    with style.styled():
        shape = (span_y[1] - span_y[0]) / (span_x[1] - span_x[0])
        drawn = style.figure(style.PAGE_IN, float(np.clip(5.6 * shape, 1.2, 6.5)) + 0.8)
        axes = drawn.subplots()
        handles, labels = draw_scene(axes, header)
        cluster = points["cluster"] if "cluster" in points else np.full(len(points), -1)
        stray = cluster < 0
        if stray.any():
            look: dict[str, Any] = {"color": style.GREY, "ms": 3, "ls": "none", "zorder": 1}
            handles += axes.plot(points["x_m"][stray], points["y_m"][stray], "x", mew=0.6, **look)
            labels.append(f"in no cluster ({stray.sum()})" if "cluster" in points else f"points ({stray.sum()})")
        names = np.unique(cluster[~stray]).astype(int)
        for number, name in enumerate(names):
            rows = cluster == name
            colour, marker = style.SERIES[number % 7], style.MARKERS[(number + number // 7) % 7]
            drawn_points = axes.plot(
                points["x_m"][rows],
                points["y_m"][rows],
                marker,
                color=colour,
                ms=3,
                mew=0,
                alpha=0.7,
                ls="none",
                zorder=4,
            )
            if number < 12:
                handles += drawn_points
                labels.append(f"cluster {name} ({rows.sum()})")
        axes.set_aspect("equal", adjustable="datalim")  # fills the page
        axes.set_xlabel("x (m)")
        axes.set_ylabel("y (m)")
        axes.margins(0.05)
        style.legend(axes, handles, labels, loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)
        more = f"The {len(names) - 12} later clusters are not in the legend." if len(names) > 12 else ""
        style.caption(drawn, [result.subject, f"Points: {len(points)}. Clusters: {len(names)}.", more])
    return drawn
