"""A bare corridor, out and back, with anchors set down on the way."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest

from uwbbench.api import FloatArray, Map, Mapper, Poses, Step, wrap_angle
from uwbbench.api.registry import load_plugin

SEEDS = range(7001, 7009)


@pytest.fixture(scope="module")
def mapped(radars) -> Callable[..., tuple[Poses, Map, list[str]]]:
    """Poses, map and notes of a mapper."""

    def run(name: str, steps: Iterable[Step], **params: Any) -> tuple[Poses, Map, list[str]]:
        cls: type[Mapper[Any]] = load_plugin("mappers", name)
        mapper = cls(cls.params_type().model_validate(params))
        mapper.open(radars(front=(0.0, 0.125, 0.0)), Poses.of_one(0, np.zeros(3)))
        poses = Poses.join([mapper.step(step) for step in steps])
        _, learnt = mapper.finish()
        return poses, learnt, mapper.notes

    return run


def end_error(poses: FloatArray, truth: FloatArray) -> float:
    return float(np.hypot(*(poses[-1] - truth[-1])[:2]))


def rms_error(poses: FloatArray, truth: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.sum((poses - truth)[:, :2] ** 2, axis=1))))


def distance(poses: Poses, truth: FloatArray) -> float:
    """Squared Mahalanobis distance of the last pose from the true one."""
    assert poses.covariance is not None
    off = poses.pose[-1] - truth[-1]
    off[2] = wrap_angle(off[2])
    return float(off @ np.linalg.solve(poses.covariance[-1], off))


@pytest.fixture(scope="module")
def eight(corridor, mapped) -> list[tuple[Any, Poses]]:
    """Eight runs with three anchors, and their poses."""
    runs = [corridor(anchors=3, seed=seed) for seed in SEEDS]
    return [(run, mapped("slam.anchors", run.steps)[0]) for run in runs]


@pytest.mark.slow
def test_three_anchors_bring_the_end_back_to_a_quarter_of_odometrys_error(eight) -> None:
    of_mapper = np.mean([end_error(poses.pose, run.truth) for run, poses in eight])
    of_odometry = np.mean([end_error(run.odometry, run.truth) for run, _ in eight])
    assert of_mapper <= 0.25 * of_odometry


@pytest.mark.slow
def test_three_anchors_leave_three_fifths_of_odometrys_error_along_the_way(eight) -> None:
    of_mapper = np.mean([rms_error(poses.pose, run.truth) for run, poses in eight])
    of_odometry = np.mean([rms_error(run.odometry, run.truth) for run, _ in eight])
    assert of_mapper <= 0.60 * of_odometry


@pytest.mark.slow
def test_filter_with_anchors_is_right_about_its_errors(eight) -> None:
    # Chi-square with 24 degrees of freedom: the band of probability 0.999.
    assert 8.0 < sum(distance(poses, run.truth) for run, poses in eight) < 54.0


@pytest.mark.slow  # compiles DBSCAN where nobody has
def test_without_anchors_it_is_slam_points_bit_for_bit(corridor, mapped) -> None:
    run = corridor(anchors=0, rods=10, length_m=5.0)
    with_anchors, its_map, notes = mapped("slam.anchors", run.steps)
    points, points_map, points_notes = mapped("slam.points", run.steps)
    assert len(points_map.landmarks) > 0
    for name in ("index", "pose", "covariance"):
        np.testing.assert_array_equal(getattr(with_anchors, name), getattr(points, name))
    for name in ("identity", "kind", "a", "b", "covariance", "support"):
        np.testing.assert_array_equal(getattr(its_map.landmarks, name), getattr(points_map.landmarks, name))
    assert notes == points_notes


def test_map_has_the_anchors_by_their_identity(corridor, mapped) -> None:
    run = corridor(anchors=2, length_m=8.0, distance_error=0.0, rotation_error=0.0, heading_sd_deg=0.0)
    _, learnt, _ = mapped("slam.anchors", run.steps)
    anchors = learnt.landmarks.of("anchor")
    assert anchors.identity.tolist() == [101, 102]
    np.testing.assert_allclose(anchors.position_m, [run.anchors[101], run.anchors[102]], atol=0.3)
    assert (anchors.support > 1).all()


def test_wrong_identities_are_kept_out_and_counted(corridor, mapped) -> None:
    run = corridor(anchors=3, wrong_identity=0.3)
    poses, _, notes = mapped("slam.anchors", run.steps)
    rejected = [int(note.split()[1]) for note in notes if "messages of anchors lay outside the gate" in note]
    assert run.wrong > 20
    assert 0.5 * run.wrong < rejected[0] < 1.2 * run.wrong  # those too near or too far are not even compared
    assert distance(poses, run.truth) < 25.0  # 1.5e-5 of chi-square with three degrees of freedom


def test_distances_of_messages_tell_the_scale_of_odometry(corridor, mapped) -> None:
    run = corridor(anchors=3, distance_error=0.0, rotation_error=0.0, heading_sd_deg=0.3)
    stretched = [Step(s.index, s.time_s, s.moved * [1.04, 1.04, 1.0], s.found, s.messages) for s in run.steps]
    errors = []
    for use_range in (True, False):
        _, learnt, _ = mapped("slam.anchors", stretched, anchors={"use_range": use_range})
        placed = learnt.landmarks.of("anchor").position_m
        errors.append(np.abs(placed[:, 0] - [run.anchors[name][0] for name in (101, 102, 103)]).max())
    assert errors[0] < 0.25
    assert errors[1] > 0.35
