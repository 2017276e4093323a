import numpy as np
import pytest

from uwbbench_detectors.mappers.line import LineModel, along, normal, piece

POSES = np.array([[1.0, -2.0, 0.7], [-3.0, 0.5, -3.1], [6.0, 5.0, 1.5]])  # the last one beyond the first two lines
LINES = np.array([[3.6, 0.1], [3.2, np.pi / 2], [2.0, -3.1], [-1.5, 1.0]])


def in_world(pose, points):
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    return pose[:2] + points @ np.array([[cosine, sine], [-sine, cosine]])


@pytest.mark.parametrize("pose", POSES)
def test_a_line_seen_by_a_robot_holds_the_same_points(pose):
    seen, _, _ = LineModel().expected(pose, LINES)
    assert (seen[:, 0] >= 0).all()
    for line, own in zip(LINES, seen, strict=True):
        ends = in_world(pose, piece(own, -2.0, 5.0))
        np.testing.assert_allclose(ends @ normal(line[1]), line[0], atol=1e-12)


@pytest.mark.parametrize("pose", POSES)
def test_derivatives_of_a_seen_line_are_those_of_finite_differences(pose):
    model, step = LineModel(), 1e-6
    for line in LINES:
        _, by_pose, by_line = model.expected(pose, line[None])
        for k in range(5):
            h = step * np.eye(5)[k]
            ahead, behind = (model.expected(pose + s * h[:3], (line + s * h[3:])[None])[0] for s in (1, -1))
            numeric = model.differences(ahead[0], behind)[0] / (2 * step)
            np.testing.assert_allclose(np.concatenate([by_pose[0], by_line[0]], axis=1)[:, k], numeric, atol=1e-8)


@pytest.mark.parametrize("pose", POSES)
def test_derivatives_of_a_placed_line_are_those_of_finite_differences(pose):
    model, step, seen = LineModel(), 1e-6, np.array([2.5, -3.0])
    _, by_pose, by_seen = model.placed(pose, seen)
    for k in range(5):
        h = step * np.eye(5)[k]
        ahead, behind = (model.placed(pose + s * h[:3], seen + s * h[3:])[0] for s in (1, -1))
        numeric = model.differences(ahead, behind[None])[0] / (2 * step)
        np.testing.assert_allclose(np.concatenate([by_pose, by_seen], axis=1)[:, k], numeric, atol=1e-8)


@pytest.mark.parametrize("pose", POSES)
def test_a_placed_line_is_seen_as_it_was_measured(pose):
    model, measured = LineModel(), np.array([1.7, 3.0])
    line, _, _ = model.placed(pose, measured)
    seen, _, _ = model.expected(pose, line[None])
    np.testing.assert_allclose(model.differences(measured, seen), 0.0, atol=1e-12)


def test_directions_either_side_of_half_a_turn_differ_by_little():
    off = LineModel().differences(np.array([1.0, np.pi - 0.01]), np.array([[1.0, -np.pi + 0.02]]))
    np.testing.assert_allclose(off, [[0.0, -0.03]], atol=1e-12)


def test_places_along_a_line_are_those_of_its_pieces():
    line = np.array([2.0, 0.8])
    np.testing.assert_allclose(along(line, piece(line, -1.0, 3.0)), [-1.0, 3.0], atol=1e-12)
