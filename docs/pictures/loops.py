"""Draw what anchors in a bare corridor, and smoothing among rods, make of a simulated run."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import numpy as np

import uwbbench
from uwbbench.api import Mapped
from uwbbench.detect.mapping import load_mapper
from uwbbench.show.figures.style import BLACK, BLUE, GREY, VERMILION, caption, figure, save, styled

SHARE_95 = 5.991
"""Squared Mahalanobis distance within which 95 % of a plane's normal distribution lie."""


def main(folder: Path) -> None:
    """Draw both pictures into a folder; without the extra ``slam`` that of the graph stays the one there is."""
    _draw_corridor(folder / "slam-anchors.png")
    if importlib.util.find_spec("gtsam") is None:
        sys.stderr.write("slam-graph.png: left as it is; drawing it takes pip install 'uwbbench[slam]'\n")
        return
    _draw_rods(folder / "slam-graph.png")


def _mapped(detector: str, scene: str, run: str) -> tuple[Any, Mapped]:
    """A run and what a detector made of it."""
    dataset = uwbbench.open_dataset("simulated", {"scenes": [scene]})
    drive = dataset.open_run(run, dataset.runs()[run])
    return drive, load_mapper(detector).run(drive).mapped


def _draw_corridor(path: Path) -> None:
    """Top view, the way across stretched: truth, odometry, estimate, and the anchors with their ellipses."""
    drive, mapped = _mapped("slam-anchors", "corridor-featureless", "corridor-featureless/1")
    true_m, anchors = drive.header.trajectory.position_m, mapped.map.landmarks.of("anchor")
    around = np.exp(2j * np.pi * np.linspace(0, 1, 73))
    with styled():
        drawn = figure(7.2, 2.6)
        axes = drawn.subplots()
        axes.plot(true_m[:, 0], true_m[:, 1], color=BLACK, linewidth=0.8, label="truth")
        axes.plot(*drive.odometry[:, :2].T, "--", color=GREY, linewidth=0.8, label="odometry")
        axes.plot(*mapped.poses.pose[:, :2].T, color=BLUE, linewidth=1.0, label="slam-anchors")
        for place, covariance in zip(anchors.position_m, anchors.covariance, strict=True):
            ring = np.linalg.cholesky(SHARE_95 * covariance) @ np.array([around.real, around.imag])
            axes.plot(place[0] + ring[0], place[1] + ring[1], color=VERMILION, linewidth=0.6)
        axes.plot(*anchors.position_m.T, ".", color=VERMILION, markersize=4, label="anchors, 95 %")
        axes.plot(*drive.captures[0].anchors.position_m.T, "x", color=BLACK, markersize=4, label="where they stand")
        axes.set(xlabel="along the corridor (m)", ylabel="across (m), stretched")
        axes.legend(loc="upper left", ncols=3)
        caption(drawn, ["SIMULATED: corridor-featureless, run 1, 20 m out and back, slam-anchors."])
        save(drawn, path)


def _draw_rods(path: Path) -> None:
    """Position error over time, on the way and smoothed; and the map."""
    drive, mapped = _mapped("slam-graph", "rods-loop", "rods-loop/drift-0.05/1")
    assert mapped.smoothed is not None  # noqa: S101 - slam-graph looks back
    true_m, landmarks = drive.header.trajectory.position_m[:, :2], mapped.map.landmarks
    rods = [body.outline_m[..., :2].mean(axis=0) for body in drive.header.truth.objects]
    with styled():
        drawn = figure(7.2, 3.0)
        top, over_time = drawn.subplots(1, 2)
        series = (
            ("odometry", drive.odometry, "--", GREY),
            ("on the way", mapped.poses.pose, "-", VERMILION),
            ("smoothed", mapped.smoothed.pose, "-", BLUE),
        )
        top.plot(*true_m.T, color=BLACK, linewidth=0.8, label="truth")
        for name, poses, line, color in series:
            top.plot(*poses[:, :2].T, line, color=color, linewidth=0.8)
            error_cm = 100 * np.hypot(*(poses[:, :2] - true_m).T)
            over_time.plot(drive.time_s, error_cm, line, color=color, linewidth=0.8, label=name)
        top.plot(*np.array(rods).T, "x", color=BLACK, markersize=4, label="rods")
        top.plot(*landmarks.position_m.T, ".", color=BLUE, markersize=4, label="landmarks")
        top.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", ylim=(-3.6, 3.1))
        top.legend(loc="lower center", ncols=3)
        over_time.set(xlabel="time (s)", ylabel="position error (cm)")
        over_time.legend(loc="upper left")
        caption(drawn, ["SIMULATED: rods-loop, odometry with 5 % drift, run 1, slam-graph; start as odometry has it."])
        save(drawn, path)
