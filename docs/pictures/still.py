"""Draw what ``champion-still`` says of simulated walks over their radargrams, and of the measured walk where it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import uwbbench
from uwbbench.api import Block, Capture
from uwbbench.api.errors import UwbbenchError
from uwbbench.api.registry import load_plugin
from uwbbench.detect.pipeline import load_detector
from uwbbench.show.figures.style import caption, figure, save, styled

SCENES = {"walker-p440": 1, "walker-stops": 1, "walkers-two": 2}
"""Persons that are looked for in each scene; node 101."""
SEED = 7001


def main(folder: Path) -> None:
    """Draw both pictures into a folder; the measured one where the recordings are found."""
    captures = {}
    for name in SCENES:
        dataset = uwbbench.open_dataset("simulated", {"scenes": [name], "seed": SEED})
        captures[name] = dataset.open(f"{name}/1/101")
    _draw(folder / "still-walkers.png", captures, f"SIMULATED, seed {SEED}, node 101.")
    walk = uwbbench.open_dataset("et4173-walk")
    try:
        nodes = {f"node {name}": walk.open(name) for name in walk.names()}
    except UwbbenchError as error:
        print(f"no picture of the measured walk: {error}")  # noqa: T201 - a script
        return
    _draw(folder / "still-measured.png", nodes, "MEASURED: et4173-walk; its path was fitted on the person's echo.")


def _draw(path: Path, captures: dict[str, Capture], words: str) -> None:
    """Power over noise behind the background, the truth, and what is found."""
    with styled():
        drawn = figure(7.2, 3.2)
        for axes, (name, capture) in zip(drawn.subplots(1, len(captures)), captures.items(), strict=True):
            targets = SCENES.get(name, 1)
            changes = {
                "pipeline.track.before_detect.params.targets": targets,
                "pipeline.track.hold.params.targets": targets,
            }
            found = load_detector("champion-still", changes=changes).run(capture)
            radar, time_s = capture.radar, capture.trajectory.timestamp_s
            start_m = radar.excess_m(np.array(radar.first_tap_delay_s)) / 2
            stop_m = radar.excess_m(np.array(radar.first_tap_delay_s + radar.taps * radar.sample_interval_s)) / 2
            axes.imshow(
                _power_db(capture).T,
                aspect="auto",
                origin="lower",
                cmap="Greys",
                vmin=0,
                vmax=30,
                extent=(0.0, float(time_s[-1]), float(start_m), float(stop_m)),
            )
            sight = capture.truth.seen_from(radar, capture.trajectory)
            for place, body in enumerate(capture.truth.objects):
                if not body.structure:
                    axes.plot(time_s, sight.range_m[:, place], color="tab:cyan", linewidth=0.7)
            held = np.isnan(found["amplitude"])
            for rows, color in ((~held, "tab:red"), (held, "tab:blue")):
                axes.plot(time_s[found.frame[rows]], found.range_m[rows], ".", markersize=1.5, color=color)
            axes.set(title=name, xlabel="time (s)", ylim=(float(start_m), 5.0))
        drawn.axes[0].set_ylabel("range (m)")
        caption(drawn, [words, "Grey: power over noise, 0 to 30 dB; cyan: truth; red: found; blue: held."])
        save(drawn, path)


def _power_db(capture: Capture) -> np.ndarray:
    """Power (frames, taps) over the noise, behind the background of the detector."""
    cls = load_plugin("stages", "clutter.exponential")
    stage = cls(cls.params_type()(memory_s=0.25))
    stage.open(capture.radar)
    amplitude = stage.step(Block(capture.frames().without_invalid())).frames.amplitude
    noise = np.median(amplitude, axis=1, keepdims=True) / np.sqrt(np.log(2))
    return np.asarray(20 * np.log10(np.maximum(amplitude, 1e-3 * noise + 1e-300) / np.maximum(noise, 1e-300)))
