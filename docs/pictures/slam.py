"""Draw what mappers make of a simulated run: odometry, their own poses and map, and the truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse

import uwbbench
from uwbbench.api import Drive, FloatArray, Landmarks, Mapped
from uwbbench.detect.mapping import load_mapper
from uwbbench.show.figures.style import caption, figure, save, styled

SCENE, RUN = "rods-loop-walls", "rods-loop-walls/drift-0.02/1"
SIGMAS = 2.45
"""Standard deviations of the ellipse that holds 95 % in the plane."""


def main(folder: Path) -> None:
    """Draw the pictures into a folder."""
    dataset = uwbbench.open_dataset("simulated", {"scenes": [SCENE], "seed": 7001})
    drive = dataset.open_run(RUN, dataset.runs()[RUN])
    _compare(folder / "slam-points.png", drive, ("odometry", "slam-points"))
    _compare(folder / "slam-lines.png", drive, ("odometry", "slam-lines"))


def _compare(path: Path, drive: Drive, names: tuple[str, str]) -> None:
    """Two detectors beside each other."""
    with styled():
        drawn = figure(7.2, 3.6)
        for axes, name in zip(drawn.subplots(1, 2, sharey=True), names, strict=True):
            mapped = load_mapper(name).run(drive).mapped
            assert mapped is not None  # noqa: S101 - what a mapper's detector gives
            _draw(axes, drive, mapped)
            axes.set(title=name, xlabel="x (m)", aspect="equal")
        drawn.axes[0].set_ylabel("y (m)")
        caption(drawn, [f"SIMULATED: {RUN}, seed 7001."])
        save(drawn, path)


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
    for segment in mapped.map.segments_m:
        axes.plot(*((segment - middle) @ turn.T + true_middle).T, color="tab:orange", linewidth=1.5)
    points = [mapped.map.landmarks.of(kind) for kind in ("point", "anchor")]
    for landmarks in points:
        _ellipses(axes, landmarks, turn, middle, true_middle)


def _ellipses(axes: Axes, landmarks: Landmarks, turn: FloatArray, middle: FloatArray, true_middle: FloatArray) -> None:
    """Landmarks that have places, moved as the trajectory is."""
    for place, covariance in zip(landmarks.position_m, landmarks.covariance, strict=True):
        sizes, axes_of = np.linalg.eigh(turn @ covariance @ turn.T)
        width, height = 2 * SIGMAS * np.sqrt(sizes)
        angle = np.degrees(np.arctan2(axes_of[1, 0], axes_of[0, 0]))
        center = turn @ (place - middle) + true_middle
        axes.add_patch(Ellipse(tuple(center), width, height, angle=angle, fill=False, color="tab:orange"))
        axes.plot(*center, ".", color="tab:orange", markersize=3)
