"""Draw what the two detectors of a walking person say of a simulated walk."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import uwbbench
from uwbbench.detect.pipeline import load_detector
from uwbbench.show.figures.style import caption, figure, save, styled

NODES = ("101", "102")


def main(folder: Path) -> None:
    """Draw both pictures into a folder."""
    _draw(folder / "walker-svd.png", "walker-svd", "walker-p440", "nearest strong echo")
    _draw(folder / "kalman-track.png", "background-cfar-kalman", "walker", "track")


def _draw(path: Path, name: str, scene: str, what: str) -> None:
    """Range over time at both nodes: the truth, and what the detector found."""
    detector = load_detector(name)
    dataset = uwbbench.open_dataset("simulated", {"scenes": [scene], "background": True})
    with styled():
        drawn = figure(7.2, 2.9)
        for axes, node in zip(drawn.subplots(1, 2, sharey=True), NODES, strict=True):
            capture = dataset.open(next(one for one in dataset.names() if one.endswith(node)))
            time_s = capture.trajectory.timestamp_s
            sight = capture.truth.seen_from(capture.radar, capture.trajectory)
            person = [not one.structure for one in capture.truth.objects].index(True)
            found = detector.run(capture)
            coasts = np.isnan(found["amplitude"])
            axes.plot(time_s, sight.range_m[:, person], color="black", linewidth=0.8, label="truth")
            axes.plot(time_s[found.frame[~coasts]], found.range_m[~coasts], ".", markersize=2, label=what)
            if coasts.any():
                axes.plot(time_s[found.frame[coasts]], found.range_m[coasts], ".", markersize=2, label="coasting")
            axes.set(title=f"node {node}", xlabel="time (s)")
        drawn.axes[0].set_ylabel("range (m)")
        drawn.axes[1].legend(loc="upper right")
        caption(drawn, [f"SIMULATED: {scene}, {name}."])
        save(drawn, path)
