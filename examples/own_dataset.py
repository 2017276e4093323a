"""A dataset of one's own: NPZ files of a recorder that uwbbench has never heard of, scored like any other.

The recording is simulated here: an echo that walks away over noise. Leaves ``own_dataset.png``, its radargram.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import uwbbench
from uwbbench.api import SPEED_OF_LIGHT_M_S, Capture, Card, Dataset, Obstacle, Params, Radar, Trajectory, Truth

RADAR = Radar(
    model="recorder",
    center_frequency_hz=7.9872e9,
    bandwidth_hz=499.2e6,
    sample_interval_s=1e-9,
    frame_rate_hz=50.0,
    taps=64,
    first_tap_delay_s=0.0,
)


class WalksParams(Params):
    """Which files."""

    files: list[str]


class Walks(Dataset[WalksParams]):
    """One capture an NPZ file with cir (frames, taps), time_s (frames,) and the walker's x_m (frames,)."""

    card = Card(title="Walks", license="CC0-1.0", citation="none", source="this example", origin="simulated")

    def names(self) -> list[str]:  # noqa: D102
        return self.params.files

    def open(self, name: str) -> Capture:  # noqa: D102
        with np.load(self.file(name), allow_pickle=False) as data:
            cir, time_s, x_m = data["cir"], data["time_s"], data["x_m"]
        return Capture(
            name=name,
            radar=RADAR,
            trajectory=Trajectory(time_s, np.zeros((len(time_s), 3)), np.zeros(len(time_s))),  # the radar stands still
            truth=Truth((Obstacle("walker", "person", np.stack([x_m, 0 * x_m], axis=1)[:, None]),)),  # (frames, 1, xy)
            source=self.card.origin,
            preamble=cir,
        )


def record(path: Path) -> None:
    """Stand in for the recorder: a pulse at the delay of the walker, over white noise."""
    rng = np.random.default_rng(1)
    time_s = np.arange(400) / RADAR.frame_rate_hz
    x_m = 1.5 + 0.6 * time_s
    offset = np.arange(RADAR.taps) - (2 * x_m / SPEED_OF_LIGHT_M_S / RADAR.sample_interval_s)[:, None]
    noise = rng.normal(size=offset.shape) + 1j * rng.normal(size=offset.shape)
    cir = np.exp(-((offset / 2) ** 2) + 2j * np.pi * rng.random((400, 1))) / x_m[:, None] + 0.02 * noise
    np.savez(path, cir=cir.astype(np.complex64), time_s=time_s, x_m=x_m)


def main(folder: Path) -> None:
    """Record, open, detect, score, draw."""
    scratch = Path(tempfile.mkdtemp())
    record(scratch / "walk.npz")
    uwbbench.register("datasets", "walks", Walks)
    capture = uwbbench.open_dataset("walks", {"files": ["walk.npz"]}, data_dir=scratch).open("walk.npz")
    detector = uwbbench.load_detector("background-svd")
    print(uwbbench.score(detector.run(capture), capture, scoring="frame", gate_m=0.2))
    uwbbench.plot("radargram", capture, folder / "own_dataset.png", detector=detector)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).parent)
