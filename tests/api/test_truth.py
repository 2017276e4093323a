"""Ground truth: what a receiver at a pose should see."""

import numpy as np
import pytest

from uwbbench.api import Obstacle, Radar, Trajectory, Truth


def radar(**parts):
    return Radar("test", 8e9, 5e8, 1e-9, 50.0, taps=8, **parts)


def standing(*positions, yaw=0.0):
    position_m = np.array(positions, float)
    return Trajectory(np.arange(len(positions)) / 50.0, position_m, np.full(len(positions), yaw))


BOX = np.array([[2.0, -0.5], [2, 0.5], [3, 0.5], [3, -0.5]])


def test_range_and_azimuth_are_those_of_the_nearest_point():
    sight = Truth((Obstacle("box", "metal", BOX),)).seen_from(radar(), standing((0, 0, 0), (0, 2.5, 0)))
    np.testing.assert_allclose(sight.range_m[:, 0], [2.0, np.hypot(2, 2)])
    np.testing.assert_allclose(sight.azimuth_rad[:, 0], [0.0, -np.pi / 4])


def test_mount_and_heading_of_the_receiver_count():
    mounted = radar(mount_position_m=(0.5, 0, 0), mount_yaw_rad=np.pi / 2)
    point = Truth((Obstacle("post", "metal", np.array([[0.0, 2.5]])),))
    sight = point.seen_from(mounted, standing((0, 0, 0), yaw=np.pi / 2))
    assert sight.range_m[0, 0] == pytest.approx(2.0)
    assert sight.azimuth_rad[0, 0] == pytest.approx(-np.pi / 2)


def test_the_height_of_a_point_counts_for_range_and_not_for_azimuth():
    ball = Truth((Obstacle("ball", "metal", np.array([[3.0, 3.0, 4.0]])),))
    sight = ball.seen_from(radar(), standing((0, 0, 0)))
    assert sight.range_m[0, 0] == pytest.approx(np.sqrt(34))
    assert sight.azimuth_rad[0, 0] == pytest.approx(np.pi / 4)


def test_a_moving_object_is_followed_and_unlabelled_frames_are_nan():
    walk = np.array([[[1.0, 0]], [[np.nan, np.nan]], [[0, 3.0]]])
    sight = Truth((Obstacle("person", "body", walk),)).seen_from(radar(), standing((0, 0, 0), (0, 0, 0), (0, 0, 0)))
    np.testing.assert_allclose(sight.range_m[:, 0], [1.0, np.nan, 3.0])
    np.testing.assert_allclose(sight.azimuth_rad[:, 0], [0.0, np.nan, np.pi / 2])
    assert not sight.occluded.any()


def test_what_stands_behind_another_object_is_occluded_and_what_stands_before_is_not():
    post = np.array([[5.0, 0.0]])
    truth = Truth((Obstacle("box", "metal", BOX), Obstacle("post", "metal", post)))
    sight = truth.seen_from(radar(), standing((0, 0, 0), (4, 0, 0), (0, 4, 0)))
    np.testing.assert_array_equal(sight.occluded, [[False, True], [False, False], [False, False]])


def test_a_moving_object_occludes_only_while_it_is_in_the_way():
    wall = np.array([[1.0, -0.2], [1.0, 0.2]])
    door = np.stack([wall, wall + np.array([0, 5])])
    truth = Truth((Obstacle("door", "wood", door), Obstacle("post", "metal", np.array([[3.0, 0.0]]))))
    np.testing.assert_array_equal(
        truth.seen_from(radar(), standing((0, 0, 0), (0, 0, 0))).occluded[:, 1], [True, False]
    )


def test_a_receiver_inside_an_outline_is_at_range_zero():
    sight = Truth((Obstacle("box", "metal", BOX),)).seen_from(radar(), standing((2.5, 0, 0)))
    assert sight.range_m[0, 0] == 0.0


def test_the_distance_of_points_to_outlines_is_zero_inside():
    truth = Truth((Obstacle("box", "metal", BOX), Obstacle("post", "metal", np.array([[0.0, 0.0]]))))
    points = np.array([[2.5, 0.0], [2.5, 1.5], [5, 2.5]])
    found = truth.distance_to(points, np.zeros(3, int))
    np.testing.assert_allclose(found[:, 0], [0, 1, np.hypot(2, 2)])
    np.testing.assert_allclose(found[:, 1], np.linalg.norm(points, axis=1))


def test_the_distance_to_a_moving_object_is_taken_in_the_frame_of_each_point():
    walk = np.array([[[1.0, 0]], [[2.0, 0]]])
    found = Truth((Obstacle("person", "body", walk),)).distance_to(np.zeros((2, 2)), np.array([1, 0]))
    assert found[:, 0].tolist() == [2.0, 1.0]


def test_no_frames_and_no_objects_are_seen_as_empty():
    assert Truth(()).seen_from(radar(), standing((0, 0, 0))).range_m.shape == (1, 0)
    nowhere = Trajectory(np.empty(0), np.empty((0, 3)), np.empty(0))
    assert Truth((Obstacle("box", "metal", BOX),)).seen_from(radar(), nowhere).range_m.shape == (0, 1)
