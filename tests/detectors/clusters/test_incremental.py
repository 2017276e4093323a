"""Incremental clustering against scikit-learn, whose tree decides distances that tie with the radius exactly."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.cluster import DBSCAN

from uwbbench_detectors.clusters.incremental import IncrementalDbscan, dbscan


def oracle(points, eps, min_samples):
    """Labels (n,) and core mask (n,)."""
    model = DBSCAN(eps=eps, min_samples=min_samples, algorithm="kd_tree").fit(points)
    core = np.zeros(len(points), bool)
    core[model.core_sample_indices_] = True
    return model.labels_, core


def check_after_every_batch(points, eps, min_samples, cuts):
    clusters = IncrementalDbscan(eps, min_samples)
    start = 0
    for stop in [*sorted(cuts), len(points)]:
        stop = min(stop, len(points))
        clusters.insert(points[start:stop])
        start = stop
        if stop:
            labels, core = oracle(points[:stop], eps, min_samples)
            np.testing.assert_array_equal(clusters.core, core)
            np.testing.assert_array_equal(clusters.labels(), labels)
    once, core = dbscan(points, eps, min_samples)
    np.testing.assert_array_equal(once, clusters.labels())
    np.testing.assert_array_equal(core, clusters.core)


cuts = st.lists(st.integers(0, 400), max_size=8)
min_samples = st.integers(1, 25)


@pytest.mark.slow
@given(seed=st.integers(0, 10**6), count=st.integers(1, 400), min_samples=min_samples, cuts=cuts)
@settings(max_examples=80, deadline=None)
def test_blobs_in_noise(seed, count, min_samples, cuts):
    rng = np.random.default_rng(seed)
    blobs = rng.uniform(-3, 3, (5, 2))[rng.integers(5, size=count)] + rng.normal(0, 0.15, (count, 2))
    noise = rng.uniform(-3, 3, (count, 2))
    points = np.where(rng.uniform(size=count)[:, None] < 0.4, noise, blobs)
    check_after_every_batch(points, 0.2, min_samples, cuts)


@pytest.mark.slow
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(1, 300),
    width=st.integers(1, 14),
    eps=st.sampled_from([1.0, 2.0, 2.5, 5.0]),
    min_samples=min_samples,
    cuts=cuts,
)
@settings(max_examples=80, deadline=None)
def test_lattice_with_distances_that_equal_the_radius_and_points_on_top_of_each_other(
    seed, count, width, eps, min_samples, cuts
):
    points = np.random.default_rng(seed).integers(-width, width + 1, (count, 2)).astype(float)
    check_after_every_batch(points, eps, min_samples, cuts)


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(1, 300),
    min_samples=min_samples,
    angle_rad=st.floats(0, np.pi),
    cuts=cuts,
)
@settings(max_examples=40, deadline=None)
def test_points_on_a_line(seed, count, min_samples, angle_rad, cuts):
    along = np.random.default_rng(seed).uniform(0, 3, count)
    points = along[:, None] * np.array([np.cos(angle_rad), np.sin(angle_rad)])
    check_after_every_batch(points, 0.1, min_samples, cuts)


@given(
    seed=st.integers(0, 10**6),
    gap=st.floats(0.9, 1.1),
    angle_rad=st.floats(0, np.pi),
    min_samples=st.integers(1, 12),
    in_order=st.booleans(),
)
@settings(max_examples=40, deadline=None)
def test_dense_walls_about_a_radius_apart(seed, gap, angle_rad, min_samples, in_order):
    rng = np.random.default_rng(seed)
    along = np.sort(rng.uniform(0, 2, 900)) if in_order else rng.uniform(0, 2, 900)
    across = gap * rng.integers(2, size=900) + rng.choice([0.0, 0.01]) * rng.uniform(size=900)
    turn = np.array([[np.cos(angle_rad), np.sin(angle_rad)], [-np.sin(angle_rad), np.cos(angle_rad)]])
    check_after_every_batch(np.stack([along, across], axis=1) @ turn, 1.0, min_samples, [100, 500])


@given(seed=st.integers(0, 10**6), beyond=st.sampled_from([0.0, 2.0**-30]))
@settings(max_examples=30, deadline=None)
def test_one_pair_exactly_a_radius_apart_joins_two_dense_cells(seed, beyond):
    rng = np.random.default_rng(seed)
    west, east = rng.uniform(1, 2, (200, 2)), rng.uniform([5, 6], [6, 7], (200, 2))
    others = rng.permutation(np.concatenate([west, east]))
    points = np.concatenate([[[2.0, 2.0]], others, [[5.0 + beyond, 6.0]]])  # the pair is searched for deepest
    check_after_every_batch(points, 5.0, 4, [50, 400])
    assert dbscan(points, 5.0, 4)[0].max() == (1 if beyond else 0)


@given(seed=st.integers(0, 10**6), exponent=st.integers(-140, 140), min_samples=st.integers(1, 8))
@settings(max_examples=40, deadline=None)
def test_any_scale(seed, exponent, min_samples):
    scale = 2.0 ** (3 * exponent)
    points = np.random.default_rng(seed).normal(size=(200, 2)) * scale
    check_after_every_batch(points, 0.3 * scale, min_samples, [50])


@given(seed=st.integers(0, 10**6), spread=st.floats(1, 1e9))
@settings(max_examples=40, deadline=None)
def test_pairs_a_radius_apart_spread_over_many_radii(seed, spread):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-spread, spread, (200, 2))
    points[100:] = points[:100] + rng.integers(-2, 3, (100, 2)) * 2.0**-10
    check_after_every_batch(points, 2.0**-10, 2, [30])


def test_a_radius_larger_than_the_scene_makes_one_cluster():
    labels, core = dbscan(np.random.default_rng(0).uniform(-1, 1, (100, 2)), 10.0, 100)
    assert core.all()
    assert (labels == 0).all()


def test_a_border_point_joins_the_cluster_that_was_opened_first():
    east, west, between = [[1.0, 0.0]] * 4, [[-1.0, 0.0]] * 4, [[0.0, 0.0]]
    for arrivals in (east + west + between, between + west + east):
        points = np.array(arrivals)
        labels, core = dbscan(points, 1.0, 4 + 2)
        np.testing.assert_array_equal(labels, oracle(points, 1.0, 6)[0])
        labels, core = dbscan(points, 1.0, 4)
        assert core.all()
    points = np.array([[0.0, 0.0], *[[1.9, 0.0]] * 3, [1.0, 0.0], *[[-1.9, 0.0]] * 3, [-1.0, 0.0]])
    labels, core = dbscan(points, 1.0, 4)
    assert core.tolist() == [False, *[True] * 8]
    assert labels.tolist() == [0, 0, 0, 0, 0, 1, 1, 1, 1]


def test_a_cluster_that_gains_an_earlier_core_point_is_numbered_anew():
    first, second = np.zeros((3, 2)), np.full((4, 2), 5.0)
    clusters = IncrementalDbscan(1.0, 4)
    clusters.insert(np.concatenate([first, second]))
    assert clusters.labels().tolist() == [-1] * 3 + [0] * 4
    clusters.insert(np.zeros((1, 2)))
    assert clusters.labels().tolist() == [0] * 3 + [1] * 4 + [0]


def test_no_points_have_no_labels():
    clusters = IncrementalDbscan(1.0, 4)
    clusters.insert(np.empty((0, 2)))
    assert len(clusters) == len(clusters.labels()) == len(clusters.core) == 0


@pytest.mark.parametrize("coordinate", [np.nan, np.inf, 1e13, -1e300])
def test_points_that_cannot_be_told_apart_are_refused_and_leave_the_others(coordinate):
    clusters = IncrementalDbscan(1.0, 1)
    clusters.insert(np.zeros((1, 2)))
    with pytest.raises(ValueError, match="too far to resolve neighbours within 1"):
        clusters.insert(np.array([[0.0, coordinate]]))
    assert clusters.labels().tolist() == [0]


@pytest.mark.parametrize("eps", [0.0, -1.0, np.nan, np.inf, 1e-160, 1e160])
def test_a_radius_whose_square_is_no_number_is_refused(eps):
    with pytest.raises(ValueError, match="between 1e-150 and 1e150"):
        dbscan(np.zeros((1, 2)), eps, 1)
