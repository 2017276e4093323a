"""slam-points and its references on simulated responses, short of a loop."""

import numpy as np
import pytest

import uwbbench
from uwbbench.api import Drive
from uwbbench.detect.mapping import load_mapper

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def corner() -> Drive:
    """Two sides of the loop between walls, at 2 % drift."""
    params = {
        "scenes": ["rods-loop-walls"],
        "set": {"trajectory.points_m": [[-1.8, -1.4], [1.0, -1.4], [1.0, 0.6]]},
        "seed": 7001,
        "runs": 1,
    }
    dataset = uwbbench.open_dataset("simulated", params)
    run = "rods-loop-walls/drift-0.02/1"
    return dataset.open_run(run, dataset.runs()[run])


def test_poses_and_map_are_the_same_however_frames_are_cut(corner):
    whole, cut = (load_mapper("slam-points").run(corner, block=block).mapped for block in (4096, 37))
    np.testing.assert_array_equal(whole.poses.pose, cut.poses.pose)
    np.testing.assert_array_equal(whole.poses.covariance, cut.poses.covariance)
    np.testing.assert_array_equal(whole.map.landmarks.position_m, cut.map.landmarks.position_m)


def test_rods_that_were_passed_are_landmarks_and_walls_are_not(corner):
    rods = np.array([one.outline_m.mean(0)[:2] for one in corner.header.truth.objects if not one.structure])
    landmarks = load_mapper("slam-points").run(corner).mapped.map.landmarks
    nearest = np.hypot(*(landmarks.position_m[:, None] - rods).transpose(2, 0, 1)).min(axis=1)
    assert len(landmarks) >= 3
    assert (nearest < 0.3).mean() > 0.7


def test_perfect_detections_map_only_what_is_there(corner):
    rods = np.array([one.outline_m.mean(0)[:2] for one in corner.header.truth.objects if not one.structure])
    landmarks = load_mapper("slam-oracle").run(corner).mapped.map.landmarks
    nearest = np.hypot(*(landmarks.position_m[:, None] - rods).transpose(2, 0, 1)).min(axis=1)
    assert len(landmarks) >= 5
    assert nearest.max() < 0.3
