"""Draw what the trees say along one approach, with the robot that they know and with another one."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import uwbbench
from uwbbench.detect.pipeline import Pipeline, load_detector
from uwbbench.show.figures.style import caption, figure, save, styled

SCENE, ROOM = "coupling-indoor", 17
TARGETS = {"None": "nothing", "metal": "metal box", "person": "person"}


def main(path: Path) -> None:
    """Run the detector on a room that it has not seen, for two robots and three targets."""
    detector = load_detector("coupling-extra-trees", changes={"pipeline.filter.probability.params.minimum": 0})
    with styled():
        drawn = figure(7.2, 2.9)
        for axes, (robot, title) in zip(
            drawn.subplots(1, 2, sharey=True), {1: "the robot of the training", 2: "another robot"}.items(), strict=True
        ):
            for target, name in TARGETS.items():
                axes.plot(*_along(detector, robot, target), label=name)
            axes.set(title=title, xlabel="distance to the target's place (m)", ylim=(-0.03, 1.03))
            axes.axhline(0.5, color="grey", linewidth=0.6, linestyle="--")
            axes.invert_xaxis()
        drawn.axes[0].set_ylabel("probability that something is there")
        drawn.axes[1].legend(loc="lower left")
        caption(drawn, [f"SIMULATED: {SCENE}, room {ROOM}, which no weights were learned from. Dashed: the filter."])
        save(drawn, path)


def _along(detector: Pipeline, robot: int, target: str) -> tuple[np.ndarray, np.ndarray]:
    """Distance, and what the detector says there before the filter."""
    dataset = uwbbench.open_dataset("simulated", {"scenes": [SCENE], "set": {"robot_seed": robot}})
    capture = dataset.open(f"{SCENE}/target-{target}/{ROOM}")
    found = detector.run(capture)
    return 3.25 - capture.trajectory.position_m[found.frame, 0], found["probability"]
