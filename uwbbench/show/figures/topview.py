"""The world from above: robot path, true outlines, points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from uwbbench.api.capture import CaptureHeader
from uwbbench.api.detections import Detections
from uwbbench.api.errors import ConfigError
from uwbbench.results.ground_truth import outlines
from uwbbench.show.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARGIN_M = 0.3


def draw_scene(axes: Axes, header: CaptureHeader) -> tuple[list[Any], list[str]]:
    """Draw the path of the robot with its start, and the outlines; handles and labels for a legend."""
    from matplotlib.patches import Polygon

    path = header.trajectory.position_m
    handles: list[Any] = [
        axes.plot(path[:, 0], path[:, 1], color=style.BLACK, ls="--", lw=0.9, zorder=2)[0],
        axes.plot(path[:1, 0], path[:1, 1], ">", color=style.BLACK, ms=4, zorder=3, ls="none")[0],
    ]
    labels = ["robot path", "start"]
    looks = {False: ("true outline", style.BLACK, 1.2), True: ("structure", style.GREY, 0.6)}
    for outline in outlines(header):
        label, colour, width = looks[outline.structure]
        points_m = outline.points_m
        if outline.moves:
            handle: Any = axes.plot(*points_m.T, color=style.GREEN, lw=0.9, ls=":")[0]
            label = "path of a moving object"
        elif len(points_m) == 1:
            handle = axes.plot(*points_m.T, "*", color=colour, ms=7, mfc="none", ls="none", zorder=5)[0]
            label = "true place"
        else:
            handle = axes.add_patch(Polygon(points_m, closed=True, fill=False, ec=colour, lw=width, zorder=5))
        if label not in labels:
            handles.append(handle)
            labels.append(label)
    axes.set_aspect("equal")
    return handles, labels


def limits(header: CaptureHeader, detections: Detections) -> tuple[tuple[float, float], tuple[float, float]]:
    """Span in x and in y that holds path, outlines and points."""
    points = [header.trajectory.position_m[:, :2], np.stack([detections["x_m"], detections["y_m"]], axis=1)]
    points += [outline.points_m for outline in outlines(header)]
    located = np.concatenate(points)
    located = located[np.isfinite(located).all(axis=1)]
    low, high = located.min(axis=0) - MARGIN_M, located.max(axis=0) + MARGIN_M
    return (float(low[0]), float(high[0])), (float(low[1]), float(high[1]))


def check_located(detections: Detections, header: CaptureHeader, detector: str) -> None:
    """Refuse detections without a place in the world.

    Parameters
    ----------
    detections : Detections
    header : CaptureHeader
        Capture that they belong to.
    detector : str
        Name for the message.

    Raises
    ------
    ConfigError
        If they have none: the detector lacks the stage ``position``, or the capture the two antennas.
    """
    if not len(header):
        raise ConfigError(f"capture '{header.name}' has no frames")
    if "x_m" not in detections:
        sts = "" if header.radar.has_sts else "; the capture has no STS responses, from which an azimuth would come"
        raise ConfigError(
            f"detector '{detector}' gives no positions on capture '{header.name}'{sts}. "
            "Kinds that need none: cir, radargram, properties, cdf"
        )
