"""Draw what becomes of the paper's blind zone and of its weak objects with a threshold or a removal in its chain."""

from __future__ import annotations

from pathlib import Path

import uwbbench
from uwbbench.detect.pipeline import load_detector
from uwbbench.show.figures.style import caption, figure, save, styled

NAMES = ("paper", "paper-adaptive", "paper-near")
SCENES = ("approach-plywood/channel-5/1", "suite-near/channel-5/1")


def main(path: Path) -> None:
    """Draw range over time of three detectors on a weak object, and on one that comes near."""
    dataset = uwbbench.open_dataset("simulated", {"scenes": [name.split("/")[0] for name in SCENES], "seed": 7001})
    with styled():
        drawn = figure(7.2, 4.6)
        rows = drawn.subplots(len(SCENES), len(NAMES), sharey="row")
        for row, name in zip(rows, SCENES, strict=True):
            capture = dataset.open(name)
            time_s = capture.trajectory.timestamp_s
            range_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[:, 0]
            for axes, detector in zip(row, NAMES, strict=True):
                found = load_detector(detector).run(capture)
                axes.plot(time_s, range_m, color="black", linewidth=0.8, label="truth")
                axes.plot(time_s[found.frame], found.range_m, ".", markersize=2, label="found")
                axes.set(ylim=(0, 1.1 * range_m.max()), xlabel="time (s)")
        for axes, detector in zip(rows[0], NAMES, strict=True):
            axes.set_title(detector)
        for row in rows:
            row[0].set_ylabel("range (m)")
        rows[0, 0].legend(loc="upper right")
        caption(drawn, ["SIMULATED, channel 5, seed 7001: plywood from 3.4 m on (above), metal from 1 m on (below)."])
        save(drawn, path)


if __name__ == "__main__":
    main(Path("paper-next.png"))
