"""Draw what the still detectors compare, and print their errors by cell: ``python docs/pictures/still_robot.py``.

Takes the captures of the experiment ``related-still``. The table goes to standard output, the picture to
``docs/images/still-robot.png``.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from uwbbench import load_detector, open_dataset
from uwbbench.api import Block, Capture
from uwbbench.api.geometry import bistatic_range
from uwbbench.api.locate import shipped
from uwbbench.run.experiment import read_experiment

IMAGE = Path(__file__).parents[1] / "images" / "still-robot.png"
SHOWN = ("box, 0.5 m", "person, 0.5 m", "person who fades, 0.5 m")
STATISTICS = (("ucir-bma", "window_mean", "mean"), ("ucir-bsda", "window_sd", "standard deviation"))


def main() -> None:
    """Run the detectors on every capture, draw the first of some cells, and print the table."""
    experiment = read_experiment(shipped("experiments")["related-still"])
    detectors = {config.name: load_detector(config.name) for config in experiment.detectors}
    errors_m: dict[tuple[str, str], list[float]] = defaultdict(list)
    figure, axes = plt.subplots(2, len(SHOWN), figsize=(9, 4.6), sharex=True, sharey="row", layout="constrained")
    for dataset in experiment.datasets:
        for place, reference in enumerate(dataset.references()):
            capture = open_dataset(dataset.use, dataset.params).open(reference.name)
            for name, detector in detectors.items():
                errors_m[dataset.label, name].append(error_m(detector, capture))
            if dataset.label in SHOWN and not place:
                draw(axes[:, SHOWN.index(dataset.label)], dataset.label, capture)
        print_row(dataset.label, [errors_m[dataset.label, name] for name in detectors])
    figure.savefig(IMAGE, dpi=130)


def error_m(detector, capture: Capture) -> float:
    """Mean error of the answers about a capture; where there is nothing to find, their mean range. NaN without any."""
    found = detector.run(capture)
    known = np.isfinite(found.range_m)
    if not known.any():
        return np.nan
    return float(np.mean(found.range_m[known] - true_m(capture)[found.frame[known]]))


def true_m(capture: Capture) -> np.ndarray:
    """Range of the object (frames,); 0 where there is none."""
    obstacle = [not item.structure for item in capture.truth.objects]
    range_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[:, obstacle]
    return range_m[:, 0] if range_m.shape[1] else np.zeros(len(range_m))


def print_row(label: str, errors_m: list[list[float]]) -> None:
    """One line of the table: mean absolute error in cm, and how many captures were answered."""
    cells = []
    for values in map(np.array, errors_m):
        known = np.isfinite(values)
        mean = f"{100 * np.abs(values[known]).mean():.1f}" if known.any() else "–"
        cells.append(f"{known.sum()} of {len(values)}" if label.startswith("background") else f"{mean} ({known.sum()})")
    sys.stdout.write(f"| {label} | {' | '.join(cells)} |\n")
    sys.stdout.flush()


def draw(axes, label: str, capture: Capture) -> None:
    """Statistics of the first window of a capture and of its background over range, and where the object is."""
    for axis, (name, part, title) in zip(axes, STATISTICS, strict=True):
        stream = load_detector(name).open(capture)
        stage = next(stage for stage in stream.stages if hasattr(stage, "background"))
        steps = stream.stages[: stream.stages.index(stage)]
        block = Block(capture.frames())
        for step in steps:
            block = step.step(block)
        windows = getattr(block, part)
        excess_m = capture.radar.excess_m((windows.bins.taps - stage.crest_tap) * capture.radar.sample_interval_s)
        ahead = np.tile([1.0, 0.0, 0.0], (len(excess_m), 1))
        range_m = bistatic_range(excess_m, ahead, capture.radar.baseline_m)
        quiet = stage.background.mean if part == "window_mean" else stage.background.sd
        axis.plot(range_m, 20 * np.log10(quiet), color="0.6", label="background")
        axis.plot(range_m, 20 * np.log10(windows.value[0]), color="C0", label="window of 5 s")
        axis.axvline(true_m(capture)[0], color="C3", lw=1, ls="--", label="object")
        found = load_detector(name).run(capture)
        if len(found):
            axis.axvline(found.range_m[0], color="C2", lw=1, label=name)
        axis.set_title(f"{label}: {title}", fontsize=8)
        axis.set_xlim(0, 4.5)
        axis.legend(fontsize=6)
        axis.tick_params(labelsize=7)
        if axis.get_subplotspec().is_first_col():
            axis.set_ylabel("dB over the direct path", fontsize=7)
    axes[-1].set_xlabel("Range (m), simulated", fontsize=7)


if __name__ == "__main__":
    main()
