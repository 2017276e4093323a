"""A stage of one's own in a chain of built-in ones: it keeps ranges near the last one, as a plate does not jump.

A simulated approach to a plywood plate. Leaves ``own_stage.png``: what is found without and with the stage.
"""

import sys
from pathlib import Path

from matplotlib.figure import Figure
from pydantic import Field

import uwbbench
from uwbbench.api import Block, BoolArray, Filter, Params, Radar, ports

CHAIN = "{use: peaks}, {use: filter.first_path, params: {guard_taps: 3}}, {use: select.strongest}, {use: range}"
DETECTORS = {"without": CHAIN, "with": CHAIN + ", {use: filter.steady}"}


class SteadyParams(Params):
    """How far the range may be from the one kept last."""

    tolerance_m: float = Field(0.3, gt=0, description="Largest step.")


class Steady(Filter[SteadyParams]):
    """Keeps ranges near the one kept last, and starts anew after half a second without any."""

    consumes = ports("detections", "range_m")

    def open(self, radar: Radar) -> None:
        """Start: whatever a stage remembers from frame to frame lives on the instance."""
        super().open(radar)
        self.patience, self.frame, self.range_m = round(radar.frame_rate_hz / 2), -1_000_000, 0.0

    def keep(self, block: Block) -> BoolArray:
        """Decide frame by frame, so that the answer does not depend on how frames are cut into blocks."""
        kept = block.detections["range_m"] > 0
        for row, (frame, range_m) in enumerate(zip(block.detections.frame, block.detections["range_m"], strict=True)):
            lost = frame - self.frame > self.patience
            kept[row] = lost or abs(range_m - self.range_m) <= self.params.tolerance_m
            if kept[row]:
                self.frame, self.range_m = frame, range_m
        return kept


def main(folder: Path) -> None:
    """Run the detector without and with the stage, score both, draw what they find."""
    uwbbench.register("stages", "filter.steady", Steady)
    plates = uwbbench.open_dataset("approach", {"material": "plywood"})
    capture = plates.open(plates.names()[0])
    time_s = capture.trajectory.timestamp_s
    figure = Figure(figsize=(7, 3.4), layout="constrained")
    for axes, (name, chain) in zip(figure.subplots(1, 2, sharey=True), DETECTORS.items(), strict=True):
        found = uwbbench.detector_from_yaml(f"{{schema: 1, name: {name}, pipeline: [{chain}]}}").run(capture)
        scores = uwbbench.score(found, capture, scoring="frame", gate_m=0.2)
        print(f"{name} the stage: precision {scores.precision:.3f}, recall {scores.recall:.3f}")
        axes.plot(time_s, capture.truth.seen_from(capture.radar, capture.trajectory).range_m, "k-", lw=1, label="truth")
        axes.plot(time_s[found.frame], found["range_m"], ".", ms=4, label="detections")
        axes.set(title=f"{name} the stage: precision {scores.precision:.2f}", xlabel="time (s)")
    figure.suptitle(f"SIMULATED capture {capture.name}")
    figure.axes[0].set(ylabel="range (m)")
    figure.axes[0].legend()
    figure.savefig(folder / "own_stage.png", dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).parent)
