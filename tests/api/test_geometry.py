"""Geometry against independent oracles: high-precision bistatic ranges and brute-force outlines."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api.geometry import (
    bistatic_range,
    bistatic_range_sine,
    direction,
    excess_path,
    inside,
    nearest_on_outline,
    nearest_on_visible,
    receiver_pose,
    rotate_z,
    segments_cross,
    to_world,
    wrap_angle,
)


def exact_excess(point, baseline):
    """|p - t| + |p| - |t| with 50 digits."""
    with mpmath.workdps(50):
        p, t = [mpmath.mpf(float(x)) for x in point], [mpmath.mpf(float(x)) for x in baseline]
        norm = lambda v: mpmath.sqrt(sum(x * x for x in v))  # noqa: E731
        return float(norm([a - b for a, b in zip(p, t, strict=True)]) + norm(p) - norm(t))


def test_the_bistatic_range_inverts_a_thousand_random_geometries():
    rng = np.random.default_rng(0)
    worst = 0.0
    for index in range(1000):
        baseline = rng.normal(size=3) * 10.0 ** rng.uniform(-2, 0.5)
        towards = rng.normal(size=3)
        towards /= np.linalg.norm(towards)
        # every second target is close to the receiver, so that its path is almost the direct one
        range_m = 10.0 ** (rng.uniform(-12, -3) if index % 2 else rng.uniform(-1, 2))
        excess = exact_excess(range_m * towards, baseline)
        found = bistatic_range(np.array([excess]), towards[None], baseline)[0]
        assert found == pytest.approx(range_m, rel=1e-9)
        worst = max(worst, abs(found - range_m))
    assert worst < 1e-9


def test_a_monostatic_radar_halves_the_path():
    excess = np.array([0.0, 1.0, 7.5])
    np.testing.assert_array_equal(bistatic_range(excess, direction(np.zeros(3)), np.zeros(3)), excess / 2)


def test_a_path_shorter_than_the_baseline_has_no_range():
    found = bistatic_range(np.array([-1e-3, 0.0]), direction(np.zeros(2)), np.array([0, -0.25, 0]))
    np.testing.assert_array_equal(found, [np.nan, 0.0])


def test_no_detections_have_no_ranges():
    assert bistatic_range(np.empty(0), np.empty((0, 3)), np.array([0, 0.2, 0])).shape == (0,)


@given(st.floats(-1.5, 1.5), st.floats(1e-3, 20), st.floats(0.01, 1))
def test_the_sine_form_equals_the_exact_one_for_a_transmitter_to_the_right(azimuth, excess, distance):
    angle, path = np.array([azimuth]), np.array([excess])
    exact = bistatic_range(path, direction(angle), np.array([0, -distance, 0]))
    np.testing.assert_allclose(bistatic_range_sine(path, angle, distance), exact, rtol=1e-9)


@pytest.mark.parametrize("baseline", [(0, 0.25, 0), (-0.25, 0, 0), (0, 0, 0.25), (0.15, -0.2, 0)])
def test_the_sine_form_is_wrong_for_any_other_placement(baseline):
    angle, path = np.array([0.3]), np.array([4.0])
    exact = bistatic_range(path, direction(angle), np.array(baseline))
    assert abs(bistatic_range_sine(path, angle, 0.25) - exact)[0] > 0.01


@given(st.floats(-100, 100))
def test_wrapped_angles_lie_in_the_half_open_circle_and_point_the_same_way(angle):
    wrapped = wrap_angle(np.array([angle]))[0]
    assert -np.pi <= wrapped < np.pi
    np.testing.assert_allclose([np.cos(wrapped), np.sin(wrapped)], [np.cos(angle), np.sin(angle)], atol=1e-9)


def test_plus_pi_wraps_to_minus_pi():
    assert wrap_angle(np.array([np.pi]))[0] == -np.pi


def test_a_quarter_turn_carries_forward_to_left():
    np.testing.assert_allclose(rotate_z(np.array([[1.0, 0, 5]]), np.pi / 2), [[0, 1, 5]], atol=1e-15)


def test_the_mount_turns_with_the_robot():
    place, heading = receiver_pose(np.array([[1.0, 2, 0]]), np.array([np.pi / 2]), np.array([0.5, 0, 0.2]), 0.1)
    np.testing.assert_allclose(place, [[1, 2.5, 0.2]], atol=1e-15)
    np.testing.assert_allclose(heading, [np.pi / 2 + 0.1])


def test_world_points_of_a_detection_lie_at_its_range_and_bearing():
    points = to_world(np.array([2.0]), np.array([np.pi / 2]), np.array([[1.0, 1, 3]]), np.array([np.pi / 2]))
    np.testing.assert_allclose(points, [[-1, 1]], atol=1e-15)


def test_the_excess_path_of_a_point_between_the_antennas_is_zero():
    baseline = np.array([0.0, -1, 0])
    np.testing.assert_allclose(excess_path(np.array([[0, -0.5, 0], [0, 1, 0]]), baseline), [0, 2])


# Outlines against brute force.

coordinate = st.floats(-3, 3).map(lambda value: round(value, 3))


def outlines(dimensions):
    return st.lists(st.tuples(*[coordinate] * dimensions), min_size=1, max_size=6).map(np.array)


def on_edges(outline, steps=4001):
    share = np.linspace(0, 1, steps)[:, None]
    return np.concatenate([a + share * (b - a) for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True)])


@settings(max_examples=60, deadline=None)
@given(st.sampled_from([2, 3]).flatmap(lambda k: st.tuples(st.tuples(*[coordinate] * k).map(np.array), outlines(k))))
def test_the_nearest_point_of_an_outline_is_that_of_densely_sampled_edges(case):
    point, outline = case
    if len(point) == 2 and len(outline) >= 3 and inside(point[None], outline)[0]:
        np.testing.assert_array_equal(nearest_on_outline(point[None], outline)[0], point)
        return
    sampled = np.linalg.norm(on_edges(outline) - point, axis=1).min()
    found = np.linalg.norm(nearest_on_outline(point[None], outline)[0] - point)
    assert found <= sampled + 1e-12
    assert found == pytest.approx(sampled, abs=4e-3)


def star(corners, rng):
    """Outline (corners, 2) whose edges do not cross, with dents, around the origin."""
    angle = 2 * np.pi * (np.arange(corners) + rng.uniform(0.1, 0.9, corners)) / corners
    return rng.uniform(0.3, 1.5, corners)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def seen_samples(outline, eye, steps=1200):
    """Samples of the edges to which the straight way from an eye meets no other edge, one by one."""
    seen = []
    edges = list(zip(outline, np.roll(outline, -1, axis=0), strict=True))
    for number, (a, b) in enumerate(edges):
        samples = a + np.linspace(0, 1, steps)[:, None] * (b - a)
        others = [edge for other, edge in enumerate(edges) if other != number]
        hidden = np.zeros(steps, bool)
        for c, d in others:
            matrix = np.stack([samples - eye, np.broadcast_to(c - d, samples.shape)], axis=-1)
            share = np.linalg.solve(matrix, np.broadcast_to(c - eye, samples.shape)[..., None])[..., 0]
            hidden |= (share[:, 0] > 0) & (share[:, 0] < 1 - 1e-6) & (share[:, 1] > 0) & (share[:, 1] < 1)
        seen.append(samples[~hidden])
    return np.concatenate(seen)


@pytest.mark.parametrize("from_inside", [False, True])
@pytest.mark.parametrize("seed", range(40))
def test_the_nearest_visible_point_is_that_of_densely_sampled_edges_that_can_be_seen(seed, from_inside):
    rng = np.random.default_rng(seed)
    corners = 3 + seed % 7
    outline, points = star(corners, rng), rng.uniform(-2, 2, (5, 2))
    eye = rng.uniform(-0.05, 0.05, 2) if from_inside else rng.uniform(2, 4) * np.array([np.cos(seed), np.sin(seed)])
    found = np.linalg.norm(nearest_on_visible(points, outline, np.tile(eye, (5, 1))) - points, axis=1)
    sampled = np.linalg.norm(seen_samples(outline, eye)[:, None] - points, axis=2).min(axis=0)
    np.testing.assert_allclose(found, sampled, atol=5e-3)


def test_the_visible_faces_of_a_box_are_those_towards_the_eye():
    box = np.array([[2.0, -1], [3, -1], [3, 1], [2, 1]])
    points = np.array([[2.5, 0.2], [3.2, 0.0], [1.5, 0.0]])
    ahead = nearest_on_visible(points, box, np.zeros((3, 2)))
    np.testing.assert_allclose(ahead, [[2, 0.2], [2, 0], [2, 0]], atol=1e-12)
    beside = nearest_on_visible(points, box, np.tile([0.0, -5.0], (3, 1)))
    np.testing.assert_allclose(beside, [[2, 0.2], [3, -1], [2, 0]], atol=1e-12)
    each = nearest_on_visible(points[:2], np.stack([box, box + 1]), np.zeros((2, 2)))
    np.testing.assert_allclose(each, [[2, 0.2], [3, 0]], atol=1e-12)


def test_points_segments_and_places_on_the_outline_are_seen_as_they_are():
    post, wall = np.array([[1.0, 1.0]]), np.array([[1.0, -1.0], [1.0, 1.0]])
    point = np.array([[3.0, 0.5]])
    np.testing.assert_allclose(nearest_on_visible(point, post, np.zeros((1, 2))), post)
    for eye in ([0.0, 0.0], [5.0, 0.0], [1.0, 0.0]):
        np.testing.assert_allclose(nearest_on_visible(point, wall, np.array([eye])), [[1.0, 0.5]])
    assert len(nearest_on_visible(np.empty((0, 2)), wall, np.empty((0, 2)))) == 0


@settings(max_examples=60, deadline=None)
@given(st.integers(3, 9), st.integers(0, 2**31))
def test_inside_agrees_with_the_half_planes_of_a_convex_outline(corners, seed):
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, corners))
    outline = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = rng.uniform(-1.2, 1.2, (200, 2))
    edge = np.roll(outline, -1, axis=0) - outline
    offset = points[:, None] - outline
    side = edge[:, 0] * offset[..., 1] - edge[:, 1] * offset[..., 0]
    np.testing.assert_array_equal(inside(points, outline), np.all(side > 0, axis=1))


def turn(a, b, c):
    return np.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


@settings(max_examples=60, deadline=None)
@given(st.integers(2, 6), st.integers(0, 2**31))
def test_crossing_agrees_with_the_orientation_test_edge_by_edge(corners, seed):
    rng = np.random.default_rng(seed)
    outline, start, end = rng.normal(size=(corners, 2)), rng.normal(size=(40, 2)), rng.normal(size=(40, 2))
    expected = [
        any(
            turn(a, b, c) != turn(a, b, d) and turn(c, d, a) != turn(c, d, b)
            for c, d in zip(outline, np.roll(outline, -1, axis=0), strict=True)
        )
        for a, b in zip(start, end, strict=True)
    ]
    np.testing.assert_array_equal(segments_cross(start, end, outline), expected)


def test_a_segment_that_only_touches_an_outline_with_its_end_does_not_cross_it():
    wall = np.array([[1.0, -1], [1, 1]])
    assert not segments_cross(np.zeros((1, 2)), np.array([[1.0, 0]]), wall)[0]
    assert segments_cross(np.zeros((1, 2)), np.array([[1.1, 0]]), wall)[0]


def test_one_outline_for_each_point_is_taken_by_row():
    each = np.array([[[1.0, 0]], [[np.nan, np.nan]], [[0, 3.0]]])
    np.testing.assert_array_equal(nearest_on_outline(np.zeros((3, 2)), each), each[:, 0])
