"""Hard clusters: map coordinates, lattices whose spacing ties with the radius, and points on top of each other."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np

from uwbbench.api import Detections, Evidence, FloatArray, IntArray, NotApplicable, StagesOnTrial, Violation, hard_case

TAPS = StagesOnTrial.radar.taps


UTM_M = (691_608.25, 5_334_763.5)
"""Easting and northing of a place in zone 32 U; a unit in the last place is 1e-9 m."""


def _settings(subject: StagesOnTrial) -> tuple[float, int]:
    params: Any = subject.stage("dbscan").params
    if params.window is not None:
        raise NotApplicable("the detector clusters a window of its points")
    return params.eps_m, params.min_samples


def _clustered(subject: StagesOnTrial, points_m: FloatArray) -> IntArray:
    """Cluster of each point (n, 2), noise being -1, at the end of a stream."""
    stage = subject.stage("dbscan")
    rows = np.arange(len(points_m))
    found = Detections(rows, x_m=points_m[:, 0], y_m=points_m[:, 1], place=rows.astype(float))
    ready = subject.through(stage, subject.block_of(np.ones((len(rows), TAPS), complex), detections=found)).detections
    tail = stage.flush()
    parts = [ready] if tail is None else [ready, tail.detections]
    joined = Detections.join(parts)
    if not np.array_equal(np.sort(joined["place"]), rows):
        raise Violation("points were lost, or handed out twice")
    return np.asarray(joined["cluster"][np.argsort(joined["place"])])


def textbook_clusters(points_m: FloatArray, eps_m: float, min_samples: int) -> IntArray:
    """DBSCAN by its definition, distances compared in rational arithmetic: cluster of each point, noise being -1.

    A point is a core point where ``min_samples`` points, itself included, lie at most ``eps_m`` away (Ester, Kriegel,
    Sander, Xu, KDD 1996).

    Parameters
    ----------
    points_m : (points, 2) array
    eps_m : float
        Radius of the neighbourhood; a point at that very distance is inside.
    min_samples : int

    Returns
    -------
    (points,) int array
    """
    exact = [tuple(map(Fraction, point)) for point in points_m.tolist()]
    reach = Fraction(eps_m) ** 2
    near = [[(a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 <= reach for b in exact] for a in exact]
    neighbours = [np.flatnonzero(row) for row in near]
    core = [len(found) >= min_samples for found in neighbours]
    label = np.full(len(exact), -1)
    clusters = 0
    for seed in range(len(exact)):
        if not core[seed] or label[seed] >= 0:
            continue
        waiting = [seed]
        label[seed] = clusters
        while waiting:
            for other in neighbours[waiting.pop()]:
                if label[other] < 0:
                    label[other] = clusters
                    waiting += [int(other)] if core[other] else []
        clusters += 1
    return label


def _same_partition(found: IntArray, expected: IntArray) -> None:
    noise, expected_noise = int(np.sum(found < 0)), int(np.sum(expected < 0))
    if not np.array_equal(found < 0, expected < 0):
        raise Violation(f"{noise} points are noise, expected {expected_noise}, or others")
    pairs = {(int(a), int(b)) for a, b in zip(found, expected, strict=True)}
    if len(pairs) != len({a for a, _ in pairs}) or len(pairs) != len({b for _, b in pairs}):
        raise Violation("points fall into other clusters")


@hard_case("equal")
def map_coordinates(subject: StagesOnTrial) -> Evidence:
    """Points around a UTM coordinate of five million metres fall into the same clusters as around the origin."""
    eps_m, min_samples = _settings(subject)
    rng = np.random.default_rng(29)
    groups = [centre + rng.uniform(-0.4, 0.4, (2 * min_samples, 2)) * eps_m for centre in ((0, 0), (9, 2), (3, 7))]
    points_m = np.concatenate([*groups, rng.uniform(-60, -50, (10, 2))])
    rng.shuffle(points_m)
    found = _clustered(subject, points_m + UTM_M)
    _same_partition(found, _clustered(subject, points_m))
    return Evidence(f"{len(set(found.tolist()) - {-1})} clusters in both places")


@hard_case("equal")
def lattice_of_spacing_eps(subject: StagesOnTrial) -> Evidence:
    """On a lattice whose spacing equals the radius, neighbours count, as the definition says: at most eps away.

    Nine sites with so many points on each that only the middle one, with its four neighbours, is a core point. Brute
    force over distances in floating point decides such ties otherwise than the tree does. The reference compares in
    rational arithmetic.
    """
    eps_m, min_samples = _settings(subject)
    copies = math.ceil(min_samples / 5)
    steps = [0.0, eps_m, 2 * eps_m]
    sites = np.array([(x, y) for x in steps for y in steps])
    points_m = np.tile(sites, (copies, 1))
    expected = textbook_clusters(points_m, eps_m, min_samples)
    _same_partition(_clustered(subject, points_m), expected)
    return Evidence(f"{int(np.sum(expected >= 0))} of {len(points_m)} points in clusters")


@hard_case("equal")
def lattice_just_too_wide(subject: StagesOnTrial) -> Evidence:
    """On a lattice whose spacing exceeds the radius by a billionth, no neighbours count."""
    eps_m, min_samples = _settings(subject)
    wide = eps_m * (1 + 1e-9)
    sites = np.array([(x, y) for x in (0.0, wide, 2 * wide) for y in (0.0, wide, 2 * wide)])
    points_m = np.tile(sites, (math.ceil(min_samples / 5), 1))
    _same_partition(_clustered(subject, points_m), textbook_clusters(points_m, eps_m, min_samples))
    return Evidence(f"{len(points_m)} points, as the definition has them")


@hard_case("equal")
def duplicate_points(subject: StagesOnTrial) -> Evidence:
    """Points on top of each other are one cluster from ``min_samples`` of them on, and noise below."""
    eps_m, min_samples = _settings(subject)
    many = np.tile([1.0, 1.0], (3 * min_samples, 1))
    few = np.tile([1.0, 1.0 + 10 * eps_m], (min_samples - 1, 1))
    points_m = np.concatenate([many, few])
    _same_partition(_clustered(subject, points_m), textbook_clusters(points_m, eps_m, min_samples))
    return Evidence(f"{len(many)} points in one cluster, {len(few)} noise")


@hard_case("survive")
def points_without_position(subject: StagesOnTrial) -> Evidence:
    """Points that are not a number take no part: they come out as noise, and the others as without them."""
    _, min_samples = _settings(subject)
    points_m = np.tile([1.0, 1.0], (3 * min_samples, 1))
    lost = np.arange(0, len(points_m), 4)
    points_m[lost, 1] = np.nan
    found = _clustered(subject, points_m)
    if np.any(found[lost] != -1) or np.any(np.delete(found, lost) != 0):
        raise Violation("points without position are clustered, or disturb the others")
    return Evidence(f"{len(lost)} points without position are noise")
