"""Draw the maps of evidence of champion-map on the measured rail and tree.

    UWBBENCH_DATA=DATA python docs/pictures/evidence_map.py

Apart from ``make pictures``, as it needs the recordings.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, cast

import numpy as np

from uwbbench.api import Capture
from uwbbench.config.source import data_roots, open_dataset
from uwbbench.detect.pipeline import load_detector
from uwbbench.show.figures.style import caption, figure, save, styled
from uwbbench_detectors.integrate.backprojection import Backprojection

SHOWN: tuple[tuple[str, str, dict[str, Any], tuple[float, float], tuple[float, float]], ...] = (
    ("rail: two corner reflectors", "pulson440-rail", {"frames": "moving"}, (0.0, 5.2), (-3.0, 6.0)),
    ("tree, 23 stops", "pulson440-tree", {}, (4.0, 12.0), (-5.0, 5.0)),
)


def main(path: Path) -> None:
    """Draw both maps into a file."""
    roots = data_roots(Path(os.environ["UWBBENCH_DATA"]))
    with styled():
        drawn = figure(7.2, 4.4)
        for axes, (title, use, params, x_m, y_m) in zip(drawn.subplots(1, 2), SHOWN, strict=True):
            dataset = open_dataset(use, params, roots)
            _draw(axes, dataset.open(dataset.names()[0]))
            axes.set(title=title, xlim=x_m, ylim=y_m, xlabel="x (m)", aspect="equal")
        drawn.axes[0].set_ylabel("y (m)")
        drawn.axes[1].legend(loc="upper right")
        caption(drawn, ["Measured: evidence of champion-map at the end of the way, from 10 dB (dark) to its largest."])
        save(drawn, path)


def _draw(axes: Any, capture: Capture) -> None:
    """One map, the objects found and the labelled ones, these at their slant distance from the way."""
    stream = load_detector("champion-map").open(capture)
    found = stream.step(capture.frames())
    x_m, y_m, evidence = cast(Backprojection, stream.stages[-1]).evidence()
    axes.pcolormesh(x_m, y_m, 10 * np.log10(np.maximum(evidence, 10)), cmap="magma", rasterized=True)
    last = found.take(found.frame == found.frame.max())
    axes.plot(last["x_m"], last["y_m"], "+", color="white", markersize=5, label="found")
    place_m = capture.trajectory.position_m
    assert capture.truth is not None  # noqa: S101 - both recordings are labelled
    for number, one in enumerate(capture.truth.objects):
        point = one.outline_m[0]
        depth_m = np.hypot(point[0] - place_m[:, 0], (point[2] if len(point) > 2 else 0.0) - place_m[:, 2]).mean()
        axes.plot(
            place_m[:, 0].mean() + depth_m, point[1], "o", markersize=10, markerfacecolor="none", color="cyan",
            label=None if number else "labelled",
        )  # fmt: skip


if __name__ == "__main__":
    main(Path(__file__).parents[1] / "images" / "systems" / "evidence-map.png")
