"""The filter itself, with known associations."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from uwbbench.api import LandmarkKind, compose
from uwbbench_detectors.mappers.ekf import Ekf
from uwbbench_detectors.mappers.motion import MotionParams
from uwbbench_detectors.mappers.point import PointModel

POINT = PointModel()
NOISE = np.diag([0.05**2, np.radians(4) ** 2])


class Offset:
    """Where a landmark lies from the robot, in the axes of the map: a linear measurement."""

    kind: ClassVar[LandmarkKind] = "point"

    def expected(self, pose, marks):
        by_pose = np.concatenate([-np.eye(2), np.zeros((2, 1))], axis=1)
        return marks - pose[:2], np.tile(by_pose, (len(marks), 1, 1)), np.tile(np.eye(2), (len(marks), 1, 1))

    def differences(self, measured, expected):
        return measured - expected

    def placed(self, pose, measured):
        return pose[:2] + measured, np.concatenate([np.eye(2), np.zeros((2, 1))], axis=1), np.eye(2)


def test_linear_filter_equals_least_squares_over_the_whole_run():
    rng = np.random.default_rng(1)
    sd_m, noise = 0.1, np.array([[0.04, 0.01], [0.01, 0.02]])
    certain = {"heading_sd_deg": 0.0, "turn_sd_deg": 0.0, "distance_scale_sd": 0.0, "turn_scale_sd": 0.0}
    ekf = Ekf(
        np.zeros(3), MotionParams.model_validate({"along_sd_m": sd_m, "across_sd_m": 2 * sd_m, **certain}), np.inf
    )
    marks = rng.uniform(-3, 3, (4, 2))
    steps, handles = 12, []
    size = 2 * (steps + len(marks))
    information, vector = np.zeros((size, size)), np.zeros(size)

    def know(rows, derivative, value, covariance):
        weight = np.linalg.inv(covariance)
        information[np.ix_(rows, rows)] += derivative.T @ weight @ derivative
        vector[rows] += derivative.T @ weight @ value

    position = np.zeros(2)
    for step in range(steps):
        length = rng.uniform(0.5, 1.5)
        position = position + np.array([length, 0.0]) + rng.normal(0, sd_m, 2)
        ekf.predict(np.array([length, 0.0, 0.0]))
        here, before = [2 * step, 2 * step + 1], [2 * step - 2, 2 * step - 1]
        moved = length * np.diag([sd_m**2, 4 * sd_m**2])
        rows, derivative = (before + here, np.hstack([-np.eye(2), np.eye(2)])) if step else (here, np.eye(2))
        know(rows, derivative, np.array([length, 0.0]), moved)
        for number in range(len(marks)):
            measured = marks[number] - position + rng.multivariate_normal(np.zeros(2), noise)
            if number == len(handles):
                handles.append(ekf.add(Offset(), measured, noise))
            else:
                ekf.update(Offset(), handles[number], measured, noise)
            mark = [2 * (steps + number), 2 * (steps + number) + 1]
            know(here + mark, np.hstack([-np.eye(2), np.eye(2)]), measured, noise)
    solution, covariance = np.linalg.solve(information, vector), np.linalg.inv(information)
    last = slice(2 * steps - 2, 2 * steps)
    np.testing.assert_allclose(ekf.pose[:2], solution[last], atol=1e-6)
    np.testing.assert_allclose(ekf.pose_covariance[:2, :2], covariance[last, last], atol=1e-6)
    landmarks = ekf.landmarks()
    np.testing.assert_allclose(landmarks.position_m.ravel(), solution[2 * steps :], atol=1e-6)
    for number in range(len(marks)):
        rows = slice(2 * (steps + number), 2 * (steps + number) + 2)
        np.testing.assert_allclose(landmarks.covariance[number], covariance[rows, rows], atol=1e-6)


@dataclass
class Wandering:
    """A robot among many points that knows which is which."""

    near_m: float
    seed: int = 1
    bend: float = 0.0
    drift: float = 0.02

    def drive(self, steps: int = 800) -> tuple[Ekf, np.ndarray]:
        """The filter at the end, and the normalised squared errors of the pose on the way."""
        rng = np.random.default_rng(self.seed)
        motion = MotionParams.model_validate({"distance_scale_sd": self.drift, "turn_scale_sd": self.drift})
        stretch, turned = 1 + self.drift * rng.standard_normal(2)
        marks = rng.uniform(-12, 12, (80, 2))
        ekf, pose, handles, squared = Ekf(np.zeros(3), motion, self.near_m, 4.0), np.zeros(3), {}, []
        for step in range(steps):
            moved = np.array([0.1, 0.0, self.bend + 0.03 * np.sin(step / 60)])
            spread = np.sqrt(
                [0.1 * 0.005**2, 0.1 * 0.005**2, 0.1 * np.radians(1) ** 2 + np.radians(0.5) ** 2 * abs(moved[2])]
            )
            ekf.predict(moved)
            pose = compose(pose, moved * (stretch, stretch, turned) + spread * rng.standard_normal(3))
            range_m = np.hypot(*(marks - pose[:2]).T)
            if step % 4 == 0:
                for number in np.flatnonzero(range_m < 3.5)[:3]:
                    measured = POINT.expected(pose, marks[[number]])[0][0] + rng.normal(0, np.sqrt(np.diag(NOISE)))
                    if number in handles:
                        ekf.update(POINT, handles[number], measured, NOISE, trusted=number % 7 > 0)
                    else:
                        handles[number] = ekf.add(POINT, measured, NOISE)
            if step % 200 == 150:
                oldest = min(handles, key=handles.__getitem__)
                ekf.remove(handles.pop(oldest))
            if step % 20 == 19:
                off = ekf.pose - pose
                off[2] = (off[2] + np.pi) % (2 * np.pi) - np.pi
                squared.append(off @ np.linalg.solve(ekf.pose_covariance, off))
        return ekf, np.array(squared)


def test_landmarks_at_rest_change_nothing_but_the_cost():
    (whole, _), (sparing, _) = Wandering(np.inf).drive(), Wandering(7.0).drive()
    assert len(sparing.near("point")) < len(sparing) / 2
    np.testing.assert_allclose(sparing.pose, whole.pose, atol=1e-9)
    np.testing.assert_allclose(sparing.pose_covariance, whole.pose_covariance, atol=1e-12)
    np.testing.assert_array_equal(sparing.landmarks().identity, whole.landmarks().identity)
    np.testing.assert_allclose(sparing.landmarks().position_m, whole.landmarks().position_m, atol=1e-9)
    np.testing.assert_allclose(sparing.landmarks().covariance, whole.landmarks().covariance, atol=1e-12)


@pytest.mark.slow
def test_the_filter_is_right_about_itself_though_scale_errors_are_drawn_once_a_run():
    runs = [Wandering(7.0, seed, bend=0.033).drive(400)[1] for seed in range(20)]
    assert 1.3 < np.mean(runs) < 4.5


def test_a_landmark_straight_behind_is_seen_across_the_wrap():
    ekf = Ekf(np.zeros(3), MotionParams.model_validate({}))
    handle = ekf.add(POINT, np.array([2.0, np.pi - 0.01]), NOISE)
    squared = ekf.update(POINT, handle, np.array([2.0, -np.pi + 0.01]), NOISE)
    assert squared < 0.1
    np.testing.assert_allclose(ekf.place(handle), [-2.0, 0.0], atol=1e-3)


def test_an_untrusted_measurement_moves_its_landmark_alone():
    ekf = Ekf(np.zeros(3), MotionParams.model_validate({}))
    near, other = ekf.add(POINT, np.array([2.0, 0.0]), NOISE), ekf.add(POINT, np.array([1.0, 1.0]), NOISE)
    ekf.predict(np.array([1.0, 0.0, 0.3]))
    pose, covariance, place, apart = ekf.pose, ekf.pose_covariance, ekf.place(near), ekf.place(other)
    ekf.update(POINT, near, np.array([1.1, -0.2]), NOISE, trusted=False)
    np.testing.assert_array_equal(ekf.pose, pose)
    np.testing.assert_array_equal(ekf.pose_covariance, covariance)
    np.testing.assert_array_equal(ekf.place(other), apart)
    assert np.hypot(*(ekf.place(near) - place)) > 0.02


def test_two_landmarks_that_are_one_meet_between_and_count_together():
    ekf = Ekf(np.zeros(3), MotionParams.model_validate({}))
    kept, dropped = ekf.add(POINT, np.array([2.0, 0.0]), NOISE), ekf.add(POINT, np.array([2.1, 0.0]), NOISE)
    assert ekf.apart(kept, dropped) == pytest.approx(0.1**2 / (2 * 0.05**2))
    ekf.merge(kept, dropped, 1e-6 * np.eye(2))
    np.testing.assert_allclose(ekf.place(kept), [2.05, 0.0], atol=1e-3)
    assert len(ekf) == 1
    assert ekf.support(kept) == 2


def test_what_is_near_does_not_grow_with_the_way():
    ekf = Ekf(np.zeros(3), MotionParams.model_validate({}))
    most = 0
    for _ in range(150):
        ekf.predict(np.array([1.0, 0.0, 0.0]))
        ekf.add(POINT, np.array([2.0, 0.5]), NOISE)
        most = max(most, len(ekf.near("point")))
    assert len(ekf) == 150
    assert most < 20
