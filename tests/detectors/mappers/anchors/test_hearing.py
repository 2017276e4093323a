"""Which messages of anchors a filter believes."""

from collections.abc import Callable

import numpy as np
import pytest

from uwbbench.api import Messages
from uwbbench_detectors.mappers.ekf import Ekf
from uwbbench_detectors.mappers.hearing import AnchorParams, Hearing
from uwbbench_detectors.mappers.motion import MotionParams

Build = Callable[..., "tuple[Hearing, Ekf]"]


def said(anchor: int, azimuth_rad: float, range_m: float, placed: bool = False) -> Messages:
    return Messages(np.array([anchor]), np.array([azimuth_rad]), np.array([range_m]), np.array([placed]))


@pytest.fixture
def build(radars) -> Build:
    """A filter that has placed anchor 7 four metres ahead and a metre to the left, and has doubts about its pose."""

    def built(**params: object) -> tuple[Hearing, Ekf]:
        hearing = Hearing(AnchorParams.model_validate(params), radars(front=(0.0, 0.0, 0.0), back=(0.0, 0.0, np.pi)))
        ekf = Ekf(np.zeros(3), MotionParams())
        hearing.take_in(ekf, {"front": said(7, np.arctan2(1.0, 4.0), np.hypot(4.0, 1.0), placed=True)})
        ekf.doubt(np.diag([0.2**2, 0.2**2, np.radians(5.0) ** 2]))
        return hearing, ekf

    return built


def spread(ekf: Ekf) -> float:
    return float(np.trace(ekf.pose_covariance))


def test_message_makes_the_pose_more_certain(build: Build) -> None:
    hearing, ekf = build()
    before = spread(ekf)
    hearing.take_in(ekf, {"front": said(7, np.arctan2(1.0, 4.0), np.hypot(4.0, 1.0) + 0.18)})
    assert spread(ekf) < 0.8 * before
    np.testing.assert_allclose(ekf.pose, 0, atol=1e-9)
    assert hearing.notes == []


@pytest.mark.parametrize(
    ("azimuth_rad", "range_m"), [(np.arctan2(1.0, 4.0), np.nan), (np.nan, np.hypot(4.0, 1.0) + 0.18)]
)
def test_message_with_direction_or_distance_alone_counts(build: Build, azimuth_rad: float, range_m: float) -> None:
    hearing, ekf = build()
    before = spread(ekf)
    hearing.take_in(ekf, {"front": said(7, azimuth_rad, range_m)})
    assert spread(ekf) < before


def test_without_use_range_distances_do_not_count(build: Build) -> None:
    poses = []
    for range_m in (4.2, 9.0):
        hearing, ekf = build(use_range=False)
        hearing.take_in(ekf, {"front": said(7, 0.2, range_m)})
        poses.append(ekf.pose)
        assert hearing.notes == []
    np.testing.assert_array_equal(poses[0], poses[1])
    assert np.any(poses[0])


def test_anchor_behind_the_receiver_is_never_used(build: Build) -> None:
    hearing, ekf = build(gate=0.999999)
    before = ekf.pose_covariance
    for azimuth_rad in (np.pi, -np.pi, np.radians(46.0), np.radians(-46.0)):
        hearing.take_in(ekf, {"front": said(7, azimuth_rad, 4.3)})
    np.testing.assert_array_equal(ekf.pose_covariance, before)
    assert hearing.notes == []


def test_anchor_behind_the_robot_is_heard_by_a_receiver_that_faces_it(build: Build) -> None:
    hearing, ekf = build()
    ekf.predict(np.array([0.0, 0.0, np.pi]))
    before = spread(ekf)
    hearing.take_in(ekf, {"back": said(7, np.arctan2(1.0, 4.0), np.hypot(4.0, 1.0) + 0.18)})
    assert spread(ekf) < before


def test_wrong_identity_is_rejected_and_counted(build: Build) -> None:
    hearing, ekf = build()
    hearing.take_in(ekf, {"front": said(8, np.arctan2(-3.0, 5.0), np.hypot(5.0, 3.0), placed=True)})
    before = ekf.pose
    hearing.take_in(ekf, {"front": said(7, np.arctan2(-3.0, 5.0), np.hypot(5.0, 3.0) + 0.18)})
    np.testing.assert_array_equal(ekf.pose, before)
    assert hearing.notes == ["1 of 1 messages of anchors lay outside the gate: 1 of anchor 7"]


def test_rejections_that_chance_explains_are_not_noted(build: Build) -> None:
    hearing, ekf = build()
    for _ in range(200):
        hearing.take_in(ekf, {"front": said(7, np.arctan2(1.0, 4.0), np.hypot(4.0, 1.0) + 0.18)})
    hearing.take_in(ekf, {"front": said(7, -0.5, 4.0)})
    assert hearing.notes == []


def test_anchor_that_was_never_set_down_is_not_used_and_named(build: Build) -> None:
    hearing, ekf = build()
    hearing.take_in(ekf, {"front": said(9, 0.0, 4.0)})
    assert len(ekf) == 1
    assert hearing.notes == ["messages of anchor 9, which the robot has not set down, were not used"]


@pytest.mark.parametrize("range_m", [0.5, 12.0])
def test_anchor_too_near_or_too_far_is_not_used(build: Build, range_m: float) -> None:
    hearing, ekf = build()
    hearing.take_in(ekf, {"front": said(8, 0.0, range_m, placed=True)})
    before = ekf.pose_covariance
    hearing.take_in(ekf, {"front": said(8, 0.0, range_m + 0.18)})
    np.testing.assert_array_equal(ekf.pose_covariance, before)


def test_anchor_that_two_receivers_report_in_a_step_is_one(build: Build) -> None:
    hearing, ekf = build()
    hearing.take_in(ekf, {"front": said(8, 0.0, 2.0, placed=True), "back": said(8, np.pi, 2.0, placed=True)})
    assert len(ekf) == 2


def test_anchor_that_is_set_down_again_stands_at_the_new_place(build: Build) -> None:
    hearing, ekf = build()
    hearing.take_in(ekf, {"front": said(7, 0.0, 2.0, placed=True)})
    assert ekf.landmarks().identity.tolist() == [7]
    np.testing.assert_allclose(ekf.landmarks().position_m, [[2.0, 0.0]], atol=1e-12)


def test_anchor_set_down_on_the_receiver_has_the_spread_of_any_other(radars) -> None:
    hearing, ekf = Hearing(AnchorParams(), radars(front=(0.0, 0.0, 0.0))), Ekf(np.zeros(3), MotionParams())
    hearing.take_in(ekf, {"front": said(7, 0.0, 0.0, placed=True)})
    np.testing.assert_allclose(ekf.landmarks().covariance[0], 0.01 * np.eye(2), atol=1e-12)
