"""Clustering again after every 50 new points, and once: against scikit-learn, and how the cost grows.

Run through ``python tests/bench/run.py dbscan``. A scene is 30 % noise among objects as wide as an azimuth error smears
them. The fixed one stays within 6 m x 6 m, so that it grows denser; the growing one keeps its density.
"""

from __future__ import annotations

from collections.abc import Iterator

import naive
import numpy as np
from harness import Disagreement, Effort, Interval, Row, Run, at_least, at_most, exponent, interleaved, ratio
from sklearn.cluster import DBSCAN

from uwbbench.api import FloatArray, IntArray
from uwbbench_detectors.clusters.incremental import IncrementalDbscan, dbscan

POINTS = 5_600
SIDE_M, OBJECTS = 6.0, 6
SIZES = [1_000, 3_160, 10_000, 31_600, 100_000]


def rows(effort: Effort) -> Iterator[Row]:
    """All targets of this module."""
    points_m = scene(POINTS)
    check(points_m)
    yield at_least("DBSCAN step of 50 points at 5 600, with all labels", 100, step_ratio(effort))
    yield at_least("DBSCAN once over 5 600 points", 8, one_shot_ratio(effort))
    yield at_least("DBSCAN again every 50 of 5 600 points, in total", 100, total_ratio(effort))
    for name, growing in (("fixed", False), ("growing", True)):
        title = f"exponent of the total cost to {SIZES[-1]:,} points".replace(",", " ")
        yield at_most(f"{title}, {name} scene", 1.4, growth_exponent(effort, growing), "")
        with_labels = growth_exponent(effort, growing, labels=True)
        yield at_most("... with all labels after every 50 points", 1.4, with_labels, "")


def scene(count: int, growing: bool = False) -> FloatArray:
    """Points (count, 2) in random order; a growing scene has room and objects in proportion to them."""
    rng = np.random.default_rng(7)
    share = count / POINTS if growing else 1.0
    side_m = SIDE_M * share**0.5
    centres = rng.uniform(0, side_m, (max(1, round(OBJECTS * share)), 2))
    objects = centres[rng.integers(len(centres), size=count)] + rng.normal(0, 0.15, (count, 2))
    noise = rng.uniform(0, side_m, (count, 2))
    return np.where(rng.uniform(size=count)[:, None] < 0.3, noise, objects)


def step_ratio(effort: Effort) -> Interval:
    """How many times longer scikit-learn takes over all points than a step of the last 50 with all labels."""
    points_m = scene(POINTS)

    def step() -> Run:
        clusters = IncrementalDbscan(naive.EPS_M, naive.MIN_SAMPLES)
        for start in range(0, POINTS - naive.EVERY, naive.EVERY):
            clusters.insert(points_m[start : start + naive.EVERY])
        clusters.labels()

        def run() -> IntArray:
            clusters.insert(points_m[-naive.EVERY :])
            return clusters.labels()

        return run

    spent = interleaved({"anew": lambda: lambda: anew(points_m), "step": step}, effort.rounds(41))
    return ratio(spent["anew"], spent["step"])


def one_shot_ratio(effort: Effort) -> Interval:
    """How many times longer scikit-learn takes over all points at once."""
    points_m = scene(POINTS)
    contenders = {"anew": lambda: lambda: anew(points_m), "once": lambda: lambda: once(points_m)}
    spent = interleaved(contenders, effort.rounds(41))
    return ratio(spent["anew"], spent["once"])


def total_ratio(effort: Effort) -> Interval:
    """How many times longer scikit-learn takes for all steps, each with all labels."""
    points_m = scene(POINTS)

    def all_anew() -> None:
        for stop in range(naive.EVERY, POINTS + 1, naive.EVERY):
            anew(points_m[:stop])

    contenders = {"anew": lambda: all_anew, "steps": lambda: lambda: steps(points_m, labels=True)}
    spent = interleaved(contenders, effort.rounds(5))
    return ratio(spent["anew"], spent["steps"])


def growth_exponent(effort: Effort, growing: bool, labels: bool = False) -> Interval:
    """Power of the number of points with which the cost of all steps grows."""
    sizes = SIZES[:3] if effort.quick else SIZES

    def prepared(count: int) -> Run:
        points_m = scene(count, growing)
        return lambda: steps(points_m, labels)

    contenders = {str(count): lambda count=count: prepared(count) for count in sizes}
    spent = interleaved(contenders, effort.rounds(7))
    return exponent(sizes, np.stack([spent[str(count)] for count in sizes], axis=1))


def steps(points_m: FloatArray, labels: bool) -> IncrementalDbscan:
    """All points, 50 at a time."""
    clusters = IncrementalDbscan(naive.EPS_M, naive.MIN_SAMPLES)
    for start in range(0, len(points_m), naive.EVERY):
        clusters.insert(points_m[start : start + naive.EVERY])
        if labels:
            clusters.labels()
    return clusters


def once(points_m: FloatArray) -> IntArray:
    """Labels by the compiled grid."""
    return dbscan(points_m, naive.EPS_M, naive.MIN_SAMPLES)[0]


def anew(points_m: FloatArray) -> IntArray:
    """Labels by scikit-learn."""
    model = DBSCAN(eps=naive.EPS_M, min_samples=naive.MIN_SAMPLES, algorithm="kd_tree").fit(points_m)
    return np.asarray(model.labels_)


def check(points_m: FloatArray) -> None:
    """All must give the same labels."""
    expected = anew(points_m)
    for labels in (once(points_m), steps(points_m, labels=True).labels()):
        if not np.array_equal(labels, expected):
            raise Disagreement("the labels are not those of scikit-learn")
