"""The filter of the mappers: a step with 50 landmarks, growth with their number, and memory over ten minutes.

Run through ``python tests/bench/run.py mappers``.
"""

from __future__ import annotations

import itertools
import tracemalloc
from collections.abc import Callable, Iterator

import numpy as np
from harness import Effort, Row, Run, at_most, exponent, interleaved, median, once, told

from uwbbench.api import Detections, Poses, Radar, Step
from uwbbench_detectors.mappers.ekf import Ekf
from uwbbench_detectors.mappers.motion import MotionParams
from uwbbench_detectors.mappers.point import PointModel
from uwbbench_detectors.mappers.slam_points import SlamPoints, SlamPointsParams

MICROSECONDS = 200.0
EXPONENT = 1.2
GROWTH_KB = 100.0
SIZES = (10, 100, 1000)
NOISE = np.diag([0.05**2, np.radians(5) ** 2])
MODEL = PointModel()
APART_M = 0.5
"""Way between two landmarks of the corridor, so that as many are near however long it is."""


def rows(effort: Effort) -> Iterator[Row]:
    """Time of a step, its growth, and memory."""
    steps = 50 if effort.quick else 400
    filters = {size: corridor(size) for size in SIZES}
    makers = {str(size): runner(filters[size], size, steps) for size in SIZES}
    spent = interleaved({"fifty": crowd(steps), **makers}, effort.rounds(7))
    each = {name: seconds / steps * 1e6 for name, seconds in spent.items()}
    yield at_most("filter of mappers, a step, 50 landmarks", MICROSECONDS, median(each["fifty"]), "us")
    grown = exponent(SIZES, np.array([each[str(size)] for size in SIZES]).T)
    yield at_most("  exponent, 10 to 1000 landmarks", EXPONENT, grown, "")
    for size in SIZES:
        yield told(f"  a step in a corridor with {size}", median(each[str(size)]), "us")
    yield at_most("slam.points, memory from 2 to 10 minutes", GROWTH_KB, once(grown_kb(effort)), "kB")


def crowd(steps: int) -> Callable[[], Run]:
    """Steps among 50 landmarks, all of them near: a movement, whose a measurement is, and an update."""
    rng = np.random.default_rng(1)
    ekf = Ekf(np.zeros(3), MotionParams.model_validate({}))
    for bearing, range_m in zip(rng.uniform(-np.pi, np.pi, 50), rng.uniform(1, 4, 50), strict=True):
        ekf.add(MODEL, np.array([range_m, bearing]), NOISE)
    handles = itertools.cycle(ekf.near("point"))
    seen = np.array([2.0, 1.0])

    def run() -> None:
        for _ in range(steps):
            ekf.predict(np.array([0.02, 0.0, 0.0101]))
            ekf.distances(MODEL, seen, NOISE)
            ekf.update(MODEL, next(handles), seen, 1e6 * NOISE)

    return lambda: run


def corridor(size: int) -> Ekf:
    """A filter that has driven past so many landmarks."""
    ekf = Ekf(np.zeros(3), MotionParams.model_validate({}))
    for _ in range(size):
        ekf.predict(np.array([APART_M, 0.0, 0.0]))
        ekf.add(MODEL, np.array([1.0, np.pi / 2]), NOISE)
    ekf.predict(np.array([0.0, 0.0, np.pi]))
    return ekf


def runner(ekf: Ekf, size: int, steps: int) -> Callable[[], Run]:
    """Steps up and down the corridor, each of 5 cm, with an update."""
    state = {"x": size * APART_M, "ahead": -1.0}

    def run() -> None:
        for _ in range(steps):
            if not 0 <= state["x"] + 0.05 * state["ahead"] <= size * APART_M:
                state["ahead"] *= -1
                ekf.predict(np.array([0.0, 0.0, np.pi]))
            state["x"] += 0.05 * state["ahead"]
            ekf.predict(np.array([0.05, 0.0, 0.0]))
            near = ekf.near("point")
            places = np.array([ekf.place(handle) for handle in near])
            handle = near[int(np.argmin(np.hypot(*(places - ekf.pose[:2]).T)))]
            seen = MODEL.expected(ekf.pose, ekf.place(handle)[None])[0][0]
            ekf.distances(MODEL, seen, NOISE)
            ekf.update(MODEL, handle, seen, NOISE)

    return lambda: run


def grown_kb(effort: Effort) -> float:
    """Memory that a run of ten minutes holds at its end more than after two, in kB; rounds among twelve points."""
    minutes = (0.2, 1.0) if effort.quick else (2.0, 10.0)
    radar = Radar("made up", 7987.2e6, 499.2e6, 1e-9, 24.0, 50, receiver="front")
    marks = 2.5 * np.column_stack([np.cos(np.arange(12) * np.pi / 6), np.sin(np.arange(12) * np.pi / 6)])
    mapper = SlamPoints(SlamPointsParams.model_validate({}))
    mapper.open({"front": radar}, Poses.of_one(0, np.array([1.5, 0.0, np.pi / 2])))
    held, moved = [], np.array([0.4 / 24, 0.0, 0.4 / 24 / 1.5])
    tracemalloc.start()
    for index in range(int(minutes[1] * 60 * 24)):
        turn = index * moved[2]
        pose = np.array([1.5 * np.cos(turn), 1.5 * np.sin(turn), turn + np.pi / 2])
        range_m, bearing = MODEL.expected(pose, marks)[0].T
        bearing = (bearing + np.pi) % (2 * np.pi) - np.pi
        seen = (range_m < 3) & (np.abs(bearing) < 1)
        found = Detections(np.full(seen.sum(), index), range_m=range_m[seen], azimuth_rad=bearing[seen])
        mapper.step(Step(index, index / 24, moved if index else np.zeros(3), {"front": found}))
        if index in (int(minutes[0] * 60 * 24), int(minutes[1] * 60 * 24) - 1):
            held.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    return (held[1] - held[0]) / 1024
