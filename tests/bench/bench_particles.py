"""The particle mapper: a step with 20 landmarks near by, and how it grows with the landmarks of a whole run.

Run through ``python tests/bench/run.py particles``.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from harness import Effort, Row, Run, at_most, exponent, interleaved, median

from uwbbench.api import Detections, Poses, Radar, Step
from uwbbench_detectors.mappers.landmark_table import AA, BB, HIGH, LOW, SUPPORT, WALL, A, B
from uwbbench_detectors.mappers.slam_particles import SlamParticles, SlamParticlesParams

STEPS, NEAR, MILLISECONDS, EXPONENT = 48, 20, 2.0, 1.2
SIZES = (10, 30, 100, 300, 1000)


def rows(effort: Effort) -> Iterator[Row]:
    """150 particles, two ears with two ranges each, at 24 Hz and 0.4 m/s."""
    spent = interleaved({str(size): _runs(size) for size in (NEAR, *SIZES)}, effort.rounds(7))
    each = {name: seconds / STEPS * 1e3 for name, seconds in spent.items()}
    yield at_most(f"slam.particles, step with {NEAR} landmarks", MILLISECONDS, median(each[str(NEAR)]), "ms")
    table = np.array([each[str(size)] for size in SIZES]).T
    yield at_most("  exponent, 10 to 1000 landmarks", EXPONENT, exponent(SIZES, table), "")


def _runs(landmarks: int):
    """What prepares a run through known walls of which at most 20 are near."""

    def prepare() -> Run:
        mapper = SlamParticles(SlamParticlesParams.model_validate({}))
        mapper.open({"left": _ear("left", 1), "right": _ear("right", -1)}, Poses.of_one(0, np.zeros(3)))
        for number in range(landmarks):
            planes = np.zeros((8, 150))
            near = number < NEAR
            planes[A], planes[B] = 2.0 + 0.1 * (number % NEAR), 0.3 * number
            planes[[AA, BB, SUPPORT]] = np.array([[1e-3], [1e-3], [50.0]])
            planes[LOW], planes[HIGH] = (-2.0, 2.0) if near else (100.0, 104.0)
            mapper._known.add(WALL, planes)
        steps = [_step(index) for index in range(STEPS)]
        return lambda: [mapper.step(step) for step in steps]

    return prepare


def _step(index: int) -> Step:
    frame, track = np.full(2, index), np.arange(2.0)
    heard = Detections(frame, range_m=np.array([2.5, 3.4]) - 0.016 * index, track=track, amplitude=np.ones(2))
    return Step(index, index / 24, np.array([0.016, 0.0, 0.0]), {"left": heard, "right": heard})


def _ear(name: str, side: int) -> Radar:
    place = (0.0, 0.125 * side, 0.0)
    yaw = side * np.pi / 4
    return Radar(
        "made", 7987.2e6, 499.2e6, 1.0016e-9, 24.0, 50, receiver=name, mount_position_m=place, mount_yaw_rad=yaw
    )
