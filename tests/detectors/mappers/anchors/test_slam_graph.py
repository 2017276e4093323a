"""Smoothing of what ``slam.points`` has seen, in a corridor with rods that is driven out and back."""

import sys
from typing import Any

import numpy as np
import pytest

from uwbbench.api import ConfigError, FloatArray, Map, Mapper, Poses
from uwbbench.api.registry import load_plugin


def run(name: str, radars: Any, corridor: Any, **params: Any) -> tuple[Poses, Poses | None, Map]:
    """Poses on the way, the smoothed trajectory and the map of a mapper."""
    cls: type[Mapper[Any]] = load_plugin("mappers", name)
    mapper = cls(cls.params_type().model_validate(params))
    mapper.open(radars(front=(0.0, 0.125, 0.0)), Poses.of_one(0, np.zeros(3)))
    poses = Poses.join([mapper.step(step) for step in corridor.steps])
    return poses, *mapper.finish()


def rms_error(poses: FloatArray, truth: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.sum((poses - truth)[:, :2] ** 2, axis=1))))


@pytest.fixture
def gtsam() -> None:
    pytest.importorskip("gtsam", reason="gtsam is not installed: pip install 'uwbbench[slam]'")


@pytest.mark.slow
@pytest.mark.usefixtures("gtsam")
def test_smoothed_trajectory_is_better_than_the_poses_on_the_way_and_these_are_those_of_slam_points(
    corridor, radars
) -> None:
    made = corridor(anchors=0, rods=14, length_m=6.0, distance_error=0.05, heading_sd_deg=2.0, seed=7003)
    poses, smoothed, learnt = run("slam.graph", radars, made)
    points, nothing, points_map = run("slam.points", radars, made)
    assert nothing is None
    for name in ("index", "pose", "covariance"):
        np.testing.assert_array_equal(getattr(poses, name), getattr(points, name))
    np.testing.assert_array_equal(smoothed.index, poses.index)
    assert rms_error(smoothed.pose, made.truth) < 0.8 * rms_error(poses.pose, made.truth)
    assert set(learnt.landmarks.identity) <= set(points_map.landmarks.identity)
    assert np.linalg.eigvalsh(smoothed.covariance).min() > 0


@pytest.mark.usefixtures("gtsam")
def test_run_without_anything_to_see_is_odometry(corridor, radars) -> None:
    made = corridor(anchors=0, length_m=2.0)
    poses, smoothed, learnt = run("slam.graph", radars, made)
    np.testing.assert_allclose(smoothed.pose, made.odometry, atol=1e-6)
    np.testing.assert_allclose(smoothed.covariance, poses.covariance, atol=0.03 * poses.covariance.max())
    assert len(learnt.landmarks) == 0


@pytest.mark.usefixtures("gtsam")
def test_run_without_a_step_has_no_trajectory(corridor, radars) -> None:
    made = corridor(anchors=0, length_m=2.0)
    made.steps.clear()
    _, smoothed, learnt = run("slam.graph", radars, made)
    assert smoothed is None
    assert len(learnt.landmarks) == 0


def test_missing_gtsam_is_said_before_the_run(corridor, radars, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gtsam", None)
    with pytest.raises(ConfigError, match=r"pip install 'uwbbench\[slam\]'"):
        run("slam.graph", radars, corridor(anchors=0, length_m=2.0))
