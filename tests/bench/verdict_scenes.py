"""What detectors find in scenes that are drawn at random from uwbbench's simulator, as counts that a study draws from.

Each capture is a scene of its own: objects of random shape, material and place, sometimes a wall, a straight path of
random speed and length, channel, isolation, ringing and noise. So scenes differ as much as set-ups do, lengths are
unequal, and what is hard for one detector need not be for another. All of it is SIMULATED.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from uwbbench.api import Capture, FloatArray
from uwbbench.config.detector import read_detector
from uwbbench.config.source import open_dataset
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.accuracy.scoring import Region, ScoringRules, outcomes

DETECTORS = (
    "paper-filtering",
    "paper-metal",
    "paper-concrete",
    "paper-as-printed",
    "background-ema",
    "background-mean",
    "cfar-ca",
    "cfar-os",
)
RULES = ScoringRules("frame", 0.2, Region(0.6, None, None), None)
MATERIALS = ("metal", "concrete", "plywood", "chipboard", "glass", "plasterboard")


@dataclass(frozen=True)
class Counts:
    """Results of several detectors on captures, each of a scene of its own.

    Attributes
    ----------
    detectors : tuple of str
    tp, fp, fn : (detectors, captures) array
    errors_m : list of lists of array
        Absolute errors by detector and capture.
    """

    detectors: tuple[str, ...]
    tp: FloatArray
    fp: FloatArray
    fn: FloatArray
    errors_m: list[list[FloatArray]]

    @property
    def f1(self) -> tuple[FloatArray, FloatArray]:
        """Numerators and denominators of F1."""
        return 2 * self.tp, 2 * self.tp + self.fp + self.fn

    def save(self, path: Path) -> None:
        """Write them to a file."""
        sizes = np.array([[len(part) for part in row] for row in self.errors_m])
        every = np.concatenate([part for row in self.errors_m for part in row]).astype(np.float32)
        counted = {"tp": self.tp, "fp": self.fp, "fn": self.fn, "sizes": sizes, "errors_m": every}
        np.savez_compressed(path, detectors=np.array(self.detectors), **counted)

    @classmethod
    def load(cls, path: Path) -> Counts:
        """Read them from a file."""
        with np.load(path) as held:
            parts = iter(np.split(held["errors_m"].astype(float), np.cumsum(held["sizes"])[:-1]))
            errors_m = [[next(parts) for _ in row] for row in held["sizes"]]
            return cls(tuple(held["detectors"].tolist()), held["tp"], held["fp"], held["fn"], errors_m)


FAMILIES = ("mixed", "plates")
"""Scenes of all kinds, hard ones among them; and a single metal plate straight ahead, which most detectors find."""


def scene(rng: np.random.Generator, family: str) -> dict[str, Any]:
    """A scene file of a family as plain values."""
    length_m, speed_m_s = float(rng.uniform(1.5, 6.0)), float(rng.uniform(0.2, 0.6))
    easy = family == "plates"
    objects = [_plate(rng, length_m)] if easy else [_object(rng, at, length_m) for at in range(rng.integers(1, 4))]
    terms: list[dict[str, Any]] = [
        {"use": "direct", "params": {"isolation_db": float(rng.uniform(2, 10))}},
        {"use": "antenna"},
        {"use": "occlusion"},
        {
            "use": "ringing",
            "params": {"level_db": float(rng.uniform(-20, -6)), "decay_ns": float(rng.uniform(0.8, 2.5))},
        },
        {"use": "echo.plate"},
        {"use": "echo.cylinder"},
    ]
    if rng.random() < 0.4 and not easy:
        side = float(rng.uniform(1.2, 3.0))
        objects.append(
            {"id": "wall", "shape": "wall", "center_m": [length_m / 2, side], "yaw_deg": -90, "width_m": 12.0}
        )
        objects[-1] |= {"material": "plasterboard", "thickness_m": 0.0125}
        terms += [{"use": "echo.wall"}, {"use": "clutter.wall"}]
    terms += [
        {"use": "grid"},
        {"use": "frame_gain"},
        {"use": "noise", "params": {"snr_db": float(rng.uniform(35, 50))}},
    ]
    return {
        "schema": 1,
        "seed": int(rng.integers(1, 10**6)),
        "radar": {"channel": int(rng.choice([5, 9]))},
        "receivers": {"front": {"mount_position_m": [0.0, 0.125], "tx_position_m": [0.0, -0.125]}},
        "trajectory": {"kind": "straight", "start_m": [0.0, 0.0], "end_m": [length_m, 0.0], "speed_m_s": speed_m_s},
        "objects": objects,
        "terms": terms,
    }


def _object(rng: np.random.Generator, number: int, length_m: float) -> dict[str, Any]:
    ahead = [float(rng.uniform(1.5, length_m + 2.5)), float(rng.uniform(-1.0, 1.0))]
    one = {"id": f"object-{number}", "center_m": ahead, "height_m": float(rng.uniform(0.2, 1.2))}
    one["material"] = str(rng.choice(MATERIALS[:4]))
    if rng.random() < 0.3:
        return {**one, "shape": "rod", "radius_m": float(rng.uniform(0.02, 0.1)), "material": "metal"}
    facing = {"yaw_deg": 180.0 + float(rng.uniform(-25, 25)), "width_m": float(rng.uniform(0.2, 0.9))}
    if rng.random() < 0.5:
        return {**one, **facing, "shape": "plate", "material": "metal"}
    return {**one, **facing, "shape": "box", "depth_m": float(rng.uniform(0.2, 0.5))}


def _plate(rng: np.random.Generator, length_m: float) -> dict[str, Any]:
    ahead = [length_m + float(rng.uniform(0.3, 1.5)), float(rng.uniform(-0.3, 0.3))]
    size = {"width_m": float(rng.uniform(0.3, 1.2)), "height_m": float(rng.uniform(0.3, 1.0))}
    facing = {"yaw_deg": 180.0 + float(rng.uniform(-8, 8)), **size}
    return {"id": "plate", "shape": "plate", "center_m": ahead, **facing, "material": "metal"}


def captures(count: int, seed: int, family: str) -> Iterator[Capture]:
    """Captures of random scenes of a family, one after the other."""
    rng = np.random.default_rng([seed, FAMILIES.index(family)])
    with tempfile.TemporaryDirectory() as folder:
        for number in range(count):
            path = Path(folder) / f"scene-{number}.yaml"
            path.write_text(yaml.safe_dump(scene(rng, family)))
            dataset = open_dataset("simulated", {"scenes": [str(path)]}, [Path(folder)])
            yield dataset.open(dataset.names()[0])


def counted(
    count: int, seed: int, family: str, detectors: Sequence[str] = DETECTORS, *, spoken: bool = False
) -> Counts:
    """Run detectors on random scenes.

    Parameters
    ----------
    count : int
        Captures.
    seed : int
    family : str
        One of :data:`FAMILIES`.
    detectors : sequence of str
    spoken : bool
        Whether to say how far it is.
    """
    pipelines = [Pipeline(read_detector(name, None, {})) for name in detectors]
    tables: list[list[Any]] = [[] for _ in detectors]
    started = time.monotonic()
    for number, capture in enumerate(captures(count, seed, family), start=1):
        for into, pipeline in zip(tables, pipelines, strict=True):
            into.append(outcomes(pipeline.run(capture), capture.header, RULES)["filtering"])
        if spoken and number % 40 == 0:
            print(f"  {number} captures in {time.monotonic() - started:.0f} s", flush=True)
    sums = [
        np.array([[getattr(one, name).sum() for one in row] for row in tables], float) for name in ("tp", "fp", "fn")
    ]
    errors_m = [[np.abs(one.error_m[np.isfinite(one.error_m)]) for one in row] for row in tables]
    return Counts(tuple(detectors), *sums, errors_m)
