"""Draw what slam-particles makes of two drives round the bat's room, a good one and a bad one."""

from __future__ import annotations

from pathlib import Path

import uwbbench
from uwbbench.show.figures.style import caption, figure, save, styled

RUNS = (9, 4)


def main(folder: Path) -> None:
    """Draw the picture into a folder."""
    mapper = uwbbench.load_mapper("slam-particles")
    dataset = uwbbench.open_dataset("simulated", {"scenes": ["bat-room"]})
    with styled():
        drawn = figure(7.2, 3.2)
        for axes, number in zip(drawn.subplots(1, 2, sharey=True), RUNS, strict=True):
            name = f"bat-room/{number}"
            drive = dataset.open_run(name, dataset.runs()[name])
            mapped = mapper.run(drive).mapped
            truth_m = drive.header.trajectory.position_m
            for wall in drive.header.truth.objects:
                axes.plot(*wall.outline_m[:, :2].T, color="0.75", linewidth=2.5)
            axes.plot(*truth_m[:, :2].T, color="black", linewidth=0.8, label="truth")
            axes.plot(*drive.odometry[:, :2].T, "--", linewidth=0.8, label="odometry")
            axes.plot(*mapped.poses.pose[:, :2].T, linewidth=0.8, label="poses")
            for number_of, piece in enumerate(mapped.map.segments_m):
                axes.plot(*piece.T, color="tab:red", linewidth=1.5, label=None if number_of else "walls")
            axes.set(title=name, xlabel="x (m)", aspect="equal")
        drawn.axes[0].set_ylabel("y (m)")
        drawn.axes[0].legend(loc="center", fontsize=6)
        caption(drawn, ["SIMULATED: bat-room, slam-particles."])
        save(drawn, folder / "slam-particles.png")
