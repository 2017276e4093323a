"""A corridor with nothing to see, out and back, with anchors set down on the way: at measurement level, no samples."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from uwbbench.api import Detections, FloatArray, Messages, Radar, Step, wrap_angle
from uwbbench.api.drive import relative

STEP_M = 0.1
LENGTH_M = 20.0


@dataclass(frozen=True)
class Setting:
    """How a corridor is driven and what its anchors say."""

    anchors: int = 3
    seed: int = 7001
    length_m: float = LENGTH_M
    distance_error: float = 0.02
    rotation_error: float = 0.02
    heading_sd_deg: float = 1.0
    placing_sd_m: float = 0.05
    azimuth_sd_deg: float = 5.0
    range_sd_m: float = 0.10
    range_bias_m: float = 0.18
    every: int = 2
    wrong_identity: float = 0.0
    rods: int = 0
    mount: tuple[float, float, float] = (0.0, 0.125, 0.0)
    field_of_view_deg: float = 45.0


@dataclass(frozen=True)
class Corridor:
    """True poses and odometry (n, 3) of a drive, its steps, where its anchors stand, and messages with a wrong name."""

    truth: FloatArray
    odometry: FloatArray
    steps: list[Step]
    anchors: dict[int, FloatArray] = field(default_factory=dict)
    wrong: int = 0


def build_radars(**mounts: tuple[float, float, float]) -> dict[str, Radar]:
    """Radars of receivers with these mounts: x and y in metres, yaw in radians."""
    return {
        name: Radar("test", 7987.2e6, 499.2e6, 1e-9, 50, 24.0, mount_position_m=(x, y, 0.0), mount_yaw_rad=yaw)
        for name, (x, y, yaw) in mounts.items()
    }


def drive(setting: Setting) -> Corridor:
    """Out along x, a turn on the spot, and back; anchors are set down at equal distances on the way out."""
    rng, sight = np.random.default_rng(setting.seed), np.random.default_rng(setting.seed + 1)
    rods = np.column_stack([setting.length_m * sight.random(setting.rods), 3 * sight.random(setting.rods) - 1.5])
    out = np.arange(0.0, setting.length_m + 1e-9, STEP_M)
    x = np.concatenate([out, out[::-1]])
    truth = np.column_stack([x, np.zeros_like(x), np.repeat([0.0, np.pi], len(out))])
    moved = np.zeros_like(truth)
    moved[1:] = relative(truth[:-1], truth[1:])
    way = np.hypot(moved[:, 0], moved[:, 1])
    moved[:, :2] *= 1 + setting.distance_error * rng.standard_normal()
    moved[:, 2] *= 1 + setting.rotation_error * rng.standard_normal()
    moved[:, 2] += np.radians(setting.heading_sd_deg) * np.sqrt(way) * rng.standard_normal(len(way))
    places: dict[int, FloatArray] = {}
    odometry, steps, wrong = np.zeros_like(truth), list[Step](), 0
    for index, pose in enumerate(truth):
        if index:
            odometry[index] = _after(odometry[index - 1], moved[index])
        rows = []
        if len(places) < setting.anchors and index * STEP_M >= (len(places) + 1) * setting.length_m / (
            setting.anchors + 1
        ):
            offset = np.array([0.0, 0.3])
            miss = setting.placing_sd_m * rng.standard_normal(2)
            places[101 + len(places)] = _after(pose, np.append(offset + miss, 0.0))[:2]
            away = offset - setting.mount[:2]
            rows.append((100 + len(places), np.arctan2(away[1], away[0]) - setting.mount[2], np.hypot(*away), True))
        if index % setting.every == 0:
            heard, misnamed = _heard(places, _after(pose, np.array(setting.mount)), setting, rng)
            rows, wrong = rows + heard, wrong + misnamed
        found = {"front": _seen(index, rods, _after(pose, np.array(setting.mount)), sight)}
        messages = {"front": _messages(rows)} if rows else {}
        steps.append(Step(index, index / 5.0, moved[index], found, messages))
    return Corridor(truth, odometry, steps, places, wrong)


def _heard(
    places: dict[int, FloatArray], receiver: FloatArray, setting: Setting, rng: np.random.Generator
) -> tuple[list[Any], int]:
    rows, wrong = [], 0
    for name, place in places.items():
        away = place - receiver[:2]
        range_m = np.hypot(*away)
        azimuth = wrap_angle(np.arctan2(away[1], away[0]) - receiver[2])
        if 1.0 <= range_m <= 10.0 and abs(azimuth) <= np.radians(setting.field_of_view_deg):
            said = name
            if rng.random() < setting.wrong_identity:
                wrong += 1
                said = int(rng.choice([other for other in places if other != name] or [name + 1]))
            measured = azimuth + np.radians(setting.azimuth_sd_deg) * rng.standard_normal()
            rows.append(
                (said, measured, range_m + setting.range_bias_m + setting.range_sd_m * rng.standard_normal(), False)
            )
    return rows, wrong


def _messages(rows: list[Any]) -> Messages:
    anchor, azimuth, range_m, placed = zip(*rows, strict=True)
    return Messages(np.array(anchor), np.array(azimuth), np.array(range_m), np.array(placed))


def _seen(index: int, rods: FloatArray, receiver: FloatArray, rng: np.random.Generator) -> Detections:
    away = rods - receiver[:2]
    range_m = np.hypot(*away.T)
    azimuth = wrap_angle(np.arctan2(away[:, 1], away[:, 0]) - receiver[2])
    near = (range_m < 3.5) & (np.abs(azimuth) < np.radians(50.0))
    noise = np.array([[0.03], [np.radians(3.0)]]) * rng.standard_normal((2, int(near.sum())))
    rows = np.full(int(near.sum()), index)
    return Detections(rows, range_m=range_m[near] + noise[0], azimuth_rad=azimuth[near] + noise[1])


def _after(pose: FloatArray, moved: FloatArray) -> FloatArray:
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    x, y = cosine * moved[0] - sine * moved[1], sine * moved[0] + cosine * moved[1]
    return np.array([pose[0] + x, pose[1] + y, wrap_angle(pose[2] + moved[2])])


@pytest.fixture(scope="session")
def corridor() -> Callable[..., Corridor]:
    """``drive`` with changes of a :class:`Setting`."""
    return lambda **changes: drive(Setting(**changes))


@pytest.fixture(scope="session")
def radars() -> Callable[..., dict[str, Radar]]:
    """``build_radars``."""
    return build_radars
