"""Draw what detectors of segments find in a simulated room: ``python docs/pictures/segments.py``."""

from __future__ import annotations

import tempfile
from pathlib import Path

import matplotlib as mpl
import numpy as np
from draw import shrink

from uwbbench.api import Block, Capture, bistatic_range, direction
from uwbbench.config.source import open_dataset
from uwbbench.detect.pipeline import load_detector

mpl.use("Agg")
from matplotlib import pyplot as plt

IMAGES = Path(__file__).parents[1] / "images" / "systems"
CAPTURE = "segments-rooms/channel-9_near-metal/33"
"""A room that the shipped weights have not seen."""
PICTURES = {"entropy": ("entropy",), "wavelet-lstm": ("dwt-lstm", "dwt-bilstm")}


def main() -> None:
    """One picture for each page."""
    capture = open_dataset("simulated", {"scenes": ["segments-rooms"]}, ()).open(CAPTURE)
    IMAGES.mkdir(exist_ok=True)
    for name, detectors in PICTURES.items():
        figure, axes = plt.subplots(
            1, len(detectors), figsize=(9, 3.4), sharey=True, squeeze=False, layout="constrained"
        )
        for axis, detector in zip(axes[0], detectors, strict=True):
            draw(axis, detector, capture)
        axes[0, 0].set_ylabel("range in m")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "picture.png"
            figure.savefig(path, dpi=110)
            shrink(path, IMAGES / f"{name}.png")
        plt.close(figure)


def draw(axis: plt.Axes, detector: str, capture: Capture) -> None:
    """Magnitudes behind the clutter removal, the obstacles, and the segments."""
    pipeline = load_detector(detector)
    signal = Block.join(list(pipeline.arriving(capture, pipeline.config.steps[3].label)))
    found = pipeline.run(capture)
    radar = capture.radar
    tap = np.arange(radar.taps)
    delay_s = (tap - float(np.median(signal.part("first_path")))) * radar.sample_interval_s
    range_m = bistatic_range(radar.excess_m(delay_s), direction(np.zeros(len(tap))), radar.baseline_m)
    behind = range_m > 0
    level_db = 20 * np.log10(signal.frames.amplitude + 1e-4)
    time_s = capture.trajectory.timestamp_s
    axis.pcolormesh(
        time_s,
        range_m[behind],
        level_db.T[behind],
        cmap="Greys",
        vmin=-60,
        vmax=-10,
        shading="nearest",
        rasterized=True,
    )
    bars = time_s[found.frame], found["range_start_m"], found["range_stop_m"]
    axis.vlines(*bars, color="tab:orange", alpha=0.5, linewidth=2, label="segments")
    sight = capture.truth.seen_from(radar, capture.trajectory)
    for number, item in enumerate(capture.truth.objects):
        if not item.structure:
            label = "obstacles" if number == 0 else None
            axis.plot(time_s, sight.range_m[:, number], color="tab:blue", linestyle="--", label=label)
    axis.set(title=f"{detector}, SIMULATED", xlabel="time in s", ylim=(0, 6))
    axis.legend(loc="lower left")


if __name__ == "__main__":
    main()
