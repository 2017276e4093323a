"""Draw what the still detectors compare; alone, print their errors in each cell of the experiment ``related-still``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

from uwbbench.api import Block, Capture, bistatic_range
from uwbbench.api.locate import shipped
from uwbbench.config.datasets import DatasetSource
from uwbbench.detect.pipeline import Pipeline, load_detector
from uwbbench.run.experiment import read_experiment
from uwbbench.show.figures.style import BLUE, GREEN, GREY, VERMILION, caption, figure, save, styled

SHOWN = ("box, 0.5 m", "person, 0.5 m", "person who fades, 0.5 m")
STATISTICS = (("ucir-bma", "window_mean", "mean"), ("ucir-bsda", "window_sd", "standard deviation"))


def main(path: Path) -> None:
    """Draw statistics of the first window, and of the background, of the first capture of some cells."""
    cells = {dataset.label: dataset for dataset in _cells()}
    with styled():
        drawn = figure(7.2, 4.2)
        rows = drawn.subplots(2, len(SHOWN), sharex=True, sharey="row")
        for label, column in zip(SHOWN, rows.T, strict=True):
            capture = cells[label].references()[0].open()
            for axes, (name, part, title) in zip(column, STATISTICS, strict=True):
                _draw(axes, load_detector(name), part, capture)
                axes.set_title(f"{label}: {title}")
            column[-1].set_xlabel("range (m)")
        for axes in rows[:, 0]:
            axes.set_ylabel("dB over the direct path")
        drawn.axes[0].legend(loc="upper right")
        caption(drawn, ["SIMULATED: related-still, first capture of each cell, windows of 5 s."])
        save(drawn, path)


def _cells() -> tuple[DatasetSource, ...]:
    return read_experiment(shipped("experiments")["related-still"]).datasets


def _draw(axes: Any, detector: Pipeline, part: str, capture: Capture) -> None:
    """Statistic of a window and of the background over range, the object, and what the detector finds."""
    stages = detector.open(capture).stages
    place = next(place for place, stage in enumerate(stages) if "background" in stage.needs)
    block = Block(capture.frames())
    for stage in stages[:place]:
        block = stage.step(block)
    windows, compared = block.windows(part), stages[place]
    excess_m = capture.radar.excess_m((windows.bins.place - compared.crest_tap) * capture.radar.sample_interval_s)
    range_m = bistatic_range(excess_m, np.tile([1.0, 0.0, 0.0], (len(excess_m), 1)), capture.radar.baseline_m)
    quiet = compared.background.mean if part == "window_mean" else compared.background.sd
    axes.plot(range_m, 20 * np.log10(quiet), color=GREY, label="background")
    axes.plot(range_m, 20 * np.log10(windows.value[0]), color=BLUE, label="window")
    axes.axvline(_true_m(capture)[0], color=VERMILION, linestyle="--", label="object")
    for found_m in detector.run(capture).range_m[:1]:
        axes.axvline(found_m, color=GREEN, label="found")
    axes.set_xlim(0, 4.5)


def _true_m(capture: Capture) -> np.ndarray:
    """Range of the object (frames,); 0 where there is none."""
    obstacle = [not item.structure for item in capture.truth.objects]
    range_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[:, obstacle]
    return range_m[:, 0] if range_m.shape[1] else np.zeros(len(range_m))


def table() -> None:
    """Mean absolute error in cm and captures answered for each cell; of the background the captures with an alarm."""
    names = [config.name for config in read_experiment(shipped("experiments")["related-still"]).detectors]
    detectors = [load_detector(name) for name in names]
    sys.stdout.write(f"| cell | {' | '.join(names)} |\n|{' --- |' * (len(names) + 1)}\n")
    for dataset in _cells():
        captures = [reference.open() for reference in dataset.references()]
        cells = []
        for detector in detectors:
            errors_m = np.array([_error_m(detector, capture) for capture in captures])
            known = np.isfinite(errors_m)
            mean = f"{100 * errors_m[known].mean():.1f}" if known.any() else "none"
            empty = dataset.label.startswith("background")
            cells.append(f"{known.sum()} of {len(known)}" if empty else f"{mean} ({known.sum()})")
        sys.stdout.write(f"| {dataset.label} | {' | '.join(cells)} |\n")


def _error_m(detector: Pipeline, capture: Capture) -> float:
    """Mean absolute error of the answers about a capture; NaN without any."""
    found = detector.run(capture)
    found = found.take(np.isfinite(found.range_m))
    return float(np.mean(np.abs(found.range_m - _true_m(capture)[found.frame]))) if len(found) else np.nan


if __name__ == "__main__":
    table()
