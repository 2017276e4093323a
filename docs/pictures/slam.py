"""Draw what slam-points makes of a simulated run: odometry, its own poses and map, and the truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse

import uwbbench
from uwbbench.api import Drive, Mapped
from uwbbench.detect.mapping import load_mapper
from uwbbench.show.figures.style import caption, figure, save, styled

SCENE, RUN = "rods-loop-walls", "rods-loop-walls/drift-0.02/1"
SIGMAS = 2.45
"""Standard deviations of the ellipse that holds 95 % in the plane."""


def main(folder: Path) -> None:
    """Draw the picture into a folder."""
    dataset = uwbbench.open_dataset("simulated", {"scenes": [SCENE], "seed": 7001})
    drive = dataset.open_run(RUN, dataset.runs()[RUN])
    with styled():
        drawn = figure(7.2, 3.6)
        for axes, name in zip(drawn.subplots(1, 2, sharey=True), ("odometry", "slam-points"), strict=True):
            mapped = load_mapper(name).run(drive).mapped
            assert mapped is not None  # noqa: S101 - what a mapper's detector gives
            _draw(axes, drive, mapped)
            axes.set(title=name, xlabel="x (m)", aspect="equal")
        drawn.axes[0].set_ylabel("y (m)")
        caption(drawn, [f"SIMULATED: {RUN}, seed 7001."])
        save(drawn, folder / "slam-points.png")


def _draw(axes: Axes, drive: Drive, mapped: Mapped) -> None:
    """The truth in black, the estimate in colour, moved onto the true trajectory."""
    truth = drive.header.trajectory.position_m[:, :2]
    for obstacle in drive.header.truth.objects:
        outline = np.concatenate([obstacle.outline_m, obstacle.outline_m[:1]])[:, :2]
        axes.plot(*(outline if obstacle.structure else outline.mean(0)[None]).T, "k-" if obstacle.structure else "k+")
    axes.plot(*truth.T, color="black", linewidth=0.8)
    places = mapped.poses.pose[:, :2]
    middle, true_middle = places.mean(0), truth.mean(0)
    left, _, right = np.linalg.svd((places - middle).T @ (truth - true_middle))
    turn = (left @ np.diag([1, np.sign(np.linalg.det(left @ right))]) @ right).T
    axes.plot(*((places - middle) @ turn.T + true_middle).T, color="tab:blue", linewidth=0.8)
    landmarks = mapped.map.landmarks
    for place, covariance in zip(landmarks.position_m, landmarks.covariance, strict=True):
        sizes, axes_of = np.linalg.eigh(turn @ covariance @ turn.T)
        width, height = 2 * SIGMAS * np.sqrt(sizes)
        angle = np.degrees(np.arctan2(axes_of[1, 0], axes_of[0, 0]))
        center = turn @ (place - middle) + true_middle
        axes.add_patch(Ellipse(tuple(center), width, height, angle=angle, fill=False, color="tab:orange"))
        axes.plot(*center, ".", color="tab:orange", markersize=3)
