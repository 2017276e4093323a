"""A robot on a way past rods, seen and counted without a simulator."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from tests.detectors.conftest import build_radar
from uwbbench.api import Detections, Map, Mapper, Poses, Radar, Step, compose, relative
from uwbbench.api.registry import load_plugin

RODS = np.array([(0.0, 0.6), (0.9, -0.3), (-0.9, -0.4), (2.6, 0.2), (0.7, 2.3), (-2.6, 0.4), (-0.6, -2.3)])
RATE_HZ = 12.0
SPEED_M_S = 0.4


@dataclass
class Course:
    """True poses (steps, 3), odometry between them (steps, 3), and what stands around (rods, 2)."""

    truth: np.ndarray
    moved: np.ndarray
    rods: np.ndarray
    noise: tuple[float, float] = (0.03, np.radians(3))
    seed: int = 1

    @property
    def radars(self) -> dict[str, Radar]:
        """To the front and to the left."""
        return {
            "front": build_radar(receiver="front"),
            "side": build_radar(receiver="side", mount_position_m=(-0.125, 0.0, 0.0), mount_yaw_rad=np.pi / 2),
        }

    def steps(self) -> Iterator[Step]:
        """Each step with what both receivers see, within 3.5 m and 60 degrees."""
        rng = np.random.default_rng(self.seed)
        for index, (pose, moved) in enumerate(zip(self.truth, self.moved, strict=True)):
            found = {name: self._seen(index, pose, radar, rng) for name, radar in self.radars.items()}
            yield Step(index, index / RATE_HZ, moved, found)

    def _seen(self, index: int, pose: np.ndarray, radar: Radar, rng: np.random.Generator) -> Detections:
        x, y, yaw = compose(pose, np.array([*radar.mount_position_m[:2], radar.mount_yaw_rad]))
        east, north = (self.rods - (x, y)).T
        range_m = np.hypot(east, north)
        azimuth = (np.arctan2(north, east) - yaw + np.pi) % (2 * np.pi) - np.pi
        seen = (range_m > 0.5) & (range_m < 3.5) & (np.abs(azimuth) < np.radians(60))
        errors = rng.normal(size=(2, len(self.rods))) * np.array(self.noise)[:, None]
        return Detections(
            np.full(seen.sum(), index), range_m=(range_m + errors[0])[seen], azimuth_rad=(azimuth + errors[1])[seen]
        )


def drifting(truth: np.ndarray, drift: float, seed: int) -> np.ndarray:
    """Odometry (steps, 3) with scale errors drawn once, and 50 degrees of heading noise times the drift."""
    rng = np.random.default_rng(seed)
    stretch, turned = 1 + drift * rng.standard_normal(2)
    moved = relative(truth[:-1], truth[1:])
    walk = np.radians(50 * drift) * np.sqrt(np.hypot(moved[:, 0], moved[:, 1])) * rng.standard_normal(len(moved))
    steps = np.column_stack([stretch * moved[:, :2], turned * moved[:, 2] + walk])
    return np.concatenate([np.zeros((1, 3)), steps])


def way(corners: np.ndarray) -> np.ndarray:
    """Poses (steps, 3) along straight lines between corners, turning on the spot."""
    poses = []
    for start, end in pairwise(corners):
        count = round(np.hypot(*(end - start)) / SPEED_M_S * RATE_HZ)
        along = start + (end - start) * np.arange(count)[:, None] / count
        poses.append(np.column_stack([along, np.full(count, np.arctan2(*(end - start)[::-1]))]))
    return np.concatenate(poses)


@pytest.fixture(scope="session")
def loop() -> Callable[..., Course]:
    """Rounds of 3.6 by 2.8 m among seven rods."""

    def made(drift: float = 0.02, seed: int = 1, rounds: int = 2, **changes: Any) -> Course:
        corners = np.array([(-1.8, -1.4), (1.8, -1.4), (1.8, 1.4), (-1.8, 1.4)] * rounds + [(-1.8, -1.4)])
        truth = way(corners)
        return Course(truth, drifting(truth, drift, seed), **{"rods": RODS, "seed": seed, **changes})

    return made


@pytest.fixture(scope="session")
def straight() -> Callable[..., Course]:
    """A straight way of 6 m along x."""
    return lambda rods, **changes: Course(
        truth := way(np.array([(0.0, 0.0), (6.0, 0.0)])), drifting(truth, 0.0, 1), np.asarray(rods), **changes
    )


@dataclass
class Driven:
    """What a mapper has said."""

    pose: np.ndarray
    covariance: np.ndarray
    map: Map
    notes: list[str]


def drive(name: str, course: Course, start: np.ndarray | None = None, **params: Any) -> Driven:
    """A mapper on a course."""
    plugin = load_plugin("mappers", name)
    mapper: Mapper[Any] = plugin(plugin.params_type().model_validate(params))
    mapper.open(course.radars, Poses.of_one(0, course.truth[0] if start is None else start))
    poses = Poses.join([mapper.step(step) for step in course.steps()])
    _, learnt = mapper.finish()
    assert poses.covariance is not None
    return Driven(poses.pose, poses.covariance, learnt, mapper.notes)


@pytest.fixture(scope="session")
def driven() -> Callable[..., Driven]:
    return drive


def aligned(estimate: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and shift that bring places nearest to the true ones (least squares)."""
    a, b = estimate[:, :2].mean(0), truth[:, :2].mean(0)
    u, _, v = np.linalg.svd((estimate[:, :2] - a).T @ (truth[:, :2] - b))
    turn = (u @ np.diag([1, np.sign(np.linalg.det(u @ v))]) @ v).T
    return turn, b - turn @ a


@pytest.fixture(scope="session")
def error() -> Callable[..., float]:
    """Aligned trajectory error in metres."""

    def of(estimate: np.ndarray, truth: np.ndarray) -> float:
        turn, shift = aligned(estimate, truth)
        return float(np.sqrt(((estimate[:, :2] @ turn.T + shift - truth[:, :2]) ** 2).sum(1).mean()))

    return of
