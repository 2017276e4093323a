"""What a robot could have seen of the outlines around it, and what a map says is there."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.measure.accuracy.scenes import capture_of, post
from uwbbench.api import Grid, Landmarks, Map, Obstacle
from uwbbench.measure.accuracy.region import Region
from uwbbench.measure.accuracy.surfaces import along, cells, distances, outlines, points_of, seen

WIDE = Region(min_range_m=0.1, max_range_m=8.0, half_angle_rad=math.pi / 2)


def box(x, y, side=1.0, **about):
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float) * side + [x, y]
    return Obstacle("box", "wood", corners, **about)


def test_points_along_segments_are_evenly_spaced_and_no_farther_apart_than_asked_for():
    points = along(np.array([[[0, 0], [0, 0.05]], [[1, 1], [1, 1]]], float), 0.02)
    np.testing.assert_allclose(points, [[0, 0.05 / 6], [0, 0.025], [0, 0.25 / 6], [1, 1]])


def test_outlines_are_points_lines_and_closed_polygons_and_nothing_that_moves():
    line = Obstacle("line", "metal", np.array([[0, 0], [1, 0]], float))
    moving = Obstacle("person", "person", np.zeros((4, 1, 2)))
    found = outlines([post(3), line, box(0, 0), moving], spacing_m=0.1)
    assert np.bincount(found.owner, minlength=4).tolist() == [1, 10, 40, 0]


def test_of_a_box_the_side_that_faces_the_receiver_is_seen():
    found = seen(capture_of(box(2, -0.5)), WIDE)
    assert np.allclose(found.points_m[:, 0], 2.0)
    assert len(found.points_m) == 50


def test_what_stands_behind_something_is_not_seen():
    assert seen(capture_of(box(2, -0.5), post(4)), WIDE).owner.max() == 0
    assert 1 in seen(capture_of(box(2, -0.5), post(4, 3.0)), WIDE).owner


def test_inside_a_room_its_walls_are_seen():
    found = seen(capture_of(box(-2, -2, side=4.0, structure=True)), Region(0.1, 8.0, math.pi))
    assert len(found.points_m) == 800


@pytest.mark.parametrize(("x_m", "y_m", "there"), [(3, 0, True), (0.05, 0, False), (9, 0, False), (-3, 0, False)])
def test_the_region_says_how_far_and_how_wide(x_m, y_m, there):
    assert len(seen(capture_of(post(x_m, y_m)), WIDE).points_m) == there


def test_a_robot_sees_on_its_way_what_it_did_not_see_at_first():
    yaw_rad = np.linspace(0, math.pi, 40)
    capture = capture_of(post(-3), frames=40, yaw_rad=yaw_rad)
    assert len(seen(capture, WIDE).points_m) == 1
    assert not len(seen(capture_of(post(-3), frames=40), WIDE).points_m)


def test_every_receiver_of_a_run_counts():
    capture = capture_of(post(-3))
    back = dataclasses.replace(capture.radar, receiver="back", mount_yaw_rad=math.pi)
    assert len(seen(dataclasses.replace(capture, radars=(capture.radar, back)), WIDE).points_m) == 1


def brute_seen(capture, region):
    """Every point from every place, against every edge, one after the other."""
    edges = []
    for item in capture.truth.objects:
        corners = item.outline_m[:, :2]
        edges += [(corners[k], corners[(k + 1) % len(corners)]) for k in range(len(corners))]
    surface, found = outlines(capture.truth.objects), []
    for point in surface.points_m:
        for place, yaw in zip(capture.trajectory.position_m[:, :2], capture.trajectory.yaw_rad, strict=True):
            way = point - place
            aside = math.remainder(math.atan2(way[1], way[0]) - yaw, 2 * math.pi)
            low, high = region.limits_m(capture.radar)
            if not (low <= math.hypot(*way) <= high and abs(aside) <= region.half_angle_rad):
                continue
            if not any(crossed(place, point, *edge) for edge in edges):
                found.append(point)
                break
    return np.array(found).reshape(-1, 2)


def crossed(eye, point, start, end):
    """Whether the way to a point is stopped by an edge, short of the point."""
    matrix = np.stack([point - eye, start - end], axis=1)
    if abs(np.linalg.det(matrix)) < 1e-12:
        return False
    along_way, along_edge = np.linalg.solve(matrix, start - eye)
    return 1e-9 < along_way < 1 - 1e-9 and 0 <= along_edge <= 1


def test_what_is_seen_is_what_trying_every_place_finds():
    rng = np.random.default_rng(5)
    objects = [box(*rng.uniform(-3, 3, 2), side=rng.uniform(0.1, 0.6)) for _ in range(4)]
    position_m = np.column_stack([np.linspace(-4, 4, 9), np.full(9, -3.5), np.zeros(9)])
    capture = capture_of(*objects, frames=9, position_m=position_m, yaw_rad=np.linspace(0, 3, 9))
    region = Region(0.5, 5.0, 0.8)
    expected = brute_seen(capture, region)
    assert 10 < len(expected) < len(outlines(objects).points_m)
    np.testing.assert_array_equal(seen(capture, region).points_m, expected)


def landmarks(*places, kind=0):
    count = len(places)
    a, b = np.array(places, float).reshape(-1, 2).T
    whole = np.arange(count)
    return Landmarks(whole, np.full(count, kind), a, b, np.zeros((count, 2, 2)), np.ones(count, np.int64))


def test_a_map_is_its_points_segments_point_landmarks_and_occupied_cells():
    grid = Grid(np.array([10.0, 20.0]), 0.1, np.array([[0.0, 2.0], [-1.0, 0.0], [1.0, 0.0]]))
    found = Map(landmarks((1, 2)), np.array([[[0, 0], [0.04, 0]]], float), np.array([[5.0, 5.0]]), grid)
    expected = [[0.01, 0], [0.03, 0], [5, 5], [1, 2], [10.15, 20.05], [10.05, 20.25]]
    np.testing.assert_allclose(points_of(found), expected)
    assert not len(points_of(Map(landmarks((1, 2), kind=1))))  # a line has no ends


def test_large_cells_of_a_grid_leave_no_holes():
    points = points_of(Map(grid=Grid(np.zeros(2), 0.4, np.ones((1, 1)))))
    assert len(points) == 16
    assert np.ptp(points, axis=0) == pytest.approx([0.3, 0.3])


def test_distances_are_to_the_nearest_and_infinite_where_there_is_none():
    from_m, to_m = np.random.default_rng(1).normal(0, 1, (2, 30, 2))
    brute = np.hypot(*(from_m[:, None] - to_m[None]).transpose(2, 0, 1)).min(axis=1)
    np.testing.assert_allclose(distances(from_m, to_m), brute)
    assert np.isinf(distances(from_m, np.zeros((0, 2)))).all()
    assert not len(distances(np.zeros((0, 2)), to_m))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_cells_are_those_of_the_points_and_the_ring_around_them(seed):
    points = np.random.default_rng(seed).uniform(-1, 1, (12, 2))
    expected = {
        (math.floor(x / 0.1) + dx, math.floor(y / 0.1) + dy)
        for x, y in points
        for dx in (-1, 0, 1)
        for dy in (-1, 0, 1)
    }
    assert cells(points).tolist() == sorted(x * 2**31 + y for x, y in expected)


def test_a_map_far_off_has_cells_as_well():
    assert len(cells(np.array([[1e300, -1e300]]))) == 9
