"""What a receiver says of an anchor."""

import numpy as np
import pytest

from uwbbench_detectors.mappers.anchor import AZIMUTH, RANGE, AnchorModel

MOUNT = np.array([0.2, -0.1, np.pi / 2])
POSE = np.array([1.0, 2.0, 0.7])
ANCHORS_M = np.array([[3.0, 1.0], [-2.0, 4.0]])


def test_range_and_azimuth_are_from_the_receiver_and_its_boresight() -> None:
    looks_left = AnchorModel(np.array([0.0, 0.5, np.pi / 2]), (RANGE, AZIMUTH), 0.18)
    measured, _, _ = looks_left.expected(np.zeros(3), np.array([[0.0, 3.5], [2.0, 0.5]]))
    np.testing.assert_allclose(measured, [[3.18, 0.0], [2.18, -np.pi / 2]], atol=1e-12)


@pytest.mark.parametrize("said", [(RANGE, AZIMUTH), (AZIMUTH,), (RANGE,)])
def test_derivatives_are_those_of_small_steps(said: tuple[int, ...]) -> None:
    model = AnchorModel(MOUNT, said, 0.18)
    _, by_pose, by_mark = model.expected(POSE, ANCHORS_M)
    step = 1e-6
    for column in range(3):
        ahead, behind = (model.expected(POSE + sign * step * np.eye(3)[column], ANCHORS_M)[0] for sign in (1, -1))
        np.testing.assert_allclose(by_pose[:, :, column], (ahead - behind) / (2 * step), atol=1e-8)
    for column in range(2):
        ahead, behind = (model.expected(POSE, ANCHORS_M + sign * step * np.eye(2)[column])[0] for sign in (1, -1))
        np.testing.assert_allclose(by_mark[:, :, column], (ahead - behind) / (2 * step), atol=1e-8)


def test_derivatives_of_a_placed_anchor_are_those_of_small_steps() -> None:
    model = AnchorModel(MOUNT, (RANGE, AZIMUTH), 0.18)
    offset = np.array([0.4, 0.9])
    _, by_pose, by_measured = model.placed(POSE, offset)
    step = 1e-6
    for column in range(3):
        ahead, behind = (model.placed(POSE + sign * step * np.eye(3)[column], offset)[0] for sign in (1, -1))
        np.testing.assert_allclose(by_pose[:, column], (ahead - behind) / (2 * step), atol=1e-8)
    for column in range(2):
        ahead, behind = (model.placed(POSE, offset + sign * step * np.eye(2)[column])[0] for sign in (1, -1))
        np.testing.assert_allclose(by_measured[:, column], (ahead - behind) / (2 * step), atol=1e-8)


def test_placed_anchor_is_seen_where_it_was_placed_and_its_range_has_no_bias() -> None:
    model = AnchorModel(MOUNT, (RANGE, AZIMUTH), 0.18)
    place, _, _ = model.placed(POSE, np.array([0.4, 0.9]))
    measured, _, _ = model.expected(POSE, place[None])
    np.testing.assert_allclose(model.differences(np.array([0.58, 0.9]), measured), [[0.0, 0.0]], atol=1e-12)


def test_azimuths_straight_behind_differ_little() -> None:
    model = AnchorModel(np.zeros(3), (RANGE, AZIMUTH), 0.0)
    off = model.differences(np.array([2.0, np.pi - 0.01]), np.array([[1.5, -np.pi + 0.01]]))
    np.testing.assert_allclose(off, [[0.5, -0.02]], atol=1e-12)
