"""slam.points on ways past rods, without a simulator."""

import dataclasses

import numpy as np
import pytest
from pydantic import ValidationError

from uwbbench.api import Detections, Poses, Step, compose
from uwbbench_detectors.mappers.slam_points import SlamPoints, SlamPointsParams


@pytest.mark.slow
def test_good_detections_give_a_third_of_the_error_of_odometry_and_every_rod_once(loop, driven, error):
    course = loop()
    odometry, slam = driven("odometry", course), driven("slam.points", course)
    assert error(slam.pose, course.truth) < 0.05
    assert error(slam.pose, course.truth) < error(odometry.pose, course.truth) / 3
    landmarks = slam.map.landmarks
    assert len(landmarks) == len(course.rods)
    distance = np.hypot(*(landmarks.position_m[:, None] - course.rods).transpose(2, 0, 1))
    assert sorted(distance.argmin(axis=1)) == list(range(len(course.rods)))
    assert slam.notes == []


def test_without_drift_the_error_is_below_a_centimetre(loop, driven, error):
    course = loop(drift=0.0, rounds=1)
    assert error(driven("slam.points", course).pose, course.truth) < 0.01


def test_without_features_the_poses_are_those_of_odometry(loop, driven):
    course = loop(rounds=1, rods=np.zeros((0, 2)))
    slam, odometry = driven("slam.points", course), driven("odometry", course)
    np.testing.assert_array_equal(slam.pose, odometry.pose)
    np.testing.assert_array_equal(slam.covariance, odometry.covariance)
    assert len(slam.map.landmarks) == 0


def test_odometry_alone_is_dead_reckoning(loop, driven):
    course = loop(rounds=1)
    pose = course.truth[0]
    for moved, found in zip(course.moved, driven("odometry", course).pose, strict=True):
        pose = compose(pose, moved)
        np.testing.assert_allclose(found, pose, atol=1e-9)


def test_turning_and_shifting_the_start_does_so_with_poses_and_map_and_nothing_else(loop, driven):
    course = loop(rounds=1)
    start = np.array([3.0, -2.0, 2.5])
    here, there = driven("slam.points", course), driven("slam.points", course, start=start)
    turn = start[2] - course.truth[0, 2]
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    shift = start[:2] - rotation @ course.truth[0, :2]
    np.testing.assert_allclose(there.pose[:, :2], here.pose[:, :2] @ rotation.T + shift, atol=1e-8)
    np.testing.assert_allclose(np.cos(there.pose[:, 2] - here.pose[:, 2]), np.cos(turn), atol=1e-9)
    np.testing.assert_allclose(
        there.map.landmarks.position_m, here.map.landmarks.position_m @ rotation.T + shift, atol=1e-8
    )


def test_rows_that_are_not_finite_count_for_nothing(loop, driven, monkeypatch):
    course = loop(rounds=1)
    clean = driven("slam.points", course)
    seen = type(course)._seen

    def spoilt(self, index, *rest):
        rows = seen(self, index, *rest)
        more = {"range_m": [np.nan, 1.0, np.inf], "azimuth_rad": [0.1, np.nan, 0.0]}
        return Detections.join([rows, Detections([index] * 3, **more)])

    monkeypatch.setattr(type(course), "_seen", spoilt)
    np.testing.assert_array_equal(driven("slam.points", course).pose, clean.pose)


def test_while_the_robot_stands_nothing_is_learnt_and_nothing_lost(loop):
    course = loop(rounds=1)
    mapper = SlamPoints(SlamPointsParams.model_validate({}))
    mapper.open(course.radars, Poses.of_one(0, course.truth[0]))
    steps = list(course.steps())
    before = [mapper.step(step) for step in steps[:100]][-1]
    still = dataclasses.replace(steps[99], moved=np.zeros(3))
    after = [mapper.step(dataclasses.replace(still, index=100 + k, time_s=10 + k)) for k in range(50)][-1]
    np.testing.assert_array_equal(after.pose, before.pose)
    np.testing.assert_array_equal(after.covariance, before.covariance)


@pytest.mark.parametrize("name", ["slam.points", "odometry"])
def test_a_jump_of_odometry_is_noted_and_widens_the_covariance_by_as_much(loop, driven, name):
    course = loop(rounds=1)
    course.moved[200] += (1.5, 0.0, 0.3)
    found = driven(name, course)
    assert any("odometry jumped by 1." in note for note in found.notes)
    assert found.covariance[200, 0, 0] >= 1.5**2 > 10 * found.covariance[199, 0, 0]
    assert np.hypot(*(found.pose[200] - found.pose[199])[:2]) < 0.05


def test_the_mirror_point_of_a_wall_ahead_is_no_landmark(straight, driven):
    found = driven("slam.points", straight([(8.0, 0.0)], noise=(0.01, np.radians(3))))
    assert len(found.map.landmarks) == 0


def test_the_mirror_point_of_a_wall_beside_is_no_landmark(straight, driven):
    course = straight(np.zeros((0, 2)))
    mapper = SlamPoints(SlamPointsParams.model_validate({}))
    mapper.open(course.radars, Poses.of_one(0, course.truth[0]))
    rng = np.random.default_rng(1)
    for step in course.steps():
        row = Detections([step.index], range_m=1.2 + rng.normal(0, 0.02, 1), azimuth_rad=rng.normal(0, 0.05, 1))
        pose = mapper.step(dataclasses.replace(step, found={"side": row})).pose[0]
    _, learnt = mapper.finish()
    assert len(learnt.landmarks) == 0
    assert np.hypot(*(pose - course.truth[-1])[:2]) < 0.02


def test_a_filter_that_diverges_says_so(loop, driven):
    course = loop(drift=0.0)
    course.moved[:, 2] *= 1.15  # five times what the filter takes for the standard deviation of this error
    assert any("diverged" in note for note in driven("slam.points", course).notes)


def test_a_second_gate_inside_the_first_is_refused():
    with pytest.raises(ValidationError, match=r"begin, 4, must not be below gate, 9.21"):
        SlamPointsParams.model_validate({"begin": 4.0})


def test_a_step_without_receivers_is_dead_reckoning(loop):
    course = loop(rounds=1)
    mapper = SlamPoints(SlamPointsParams.model_validate({}))
    mapper.open(course.radars, Poses.of_one(0, course.truth[0]))
    found = mapper.step(Step(0, 0.0, np.array([0.1, 0.0, 0.2]), {}))
    np.testing.assert_allclose(found.pose[0], compose(course.truth[0], np.array([0.1, 0.0, 0.2])))
