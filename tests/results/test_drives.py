"""What a mapper made of a run, laid over the truth."""

import dataclasses

import numpy as np
import pytest

from uwbbench.api import Detections, Grid, Landmarks, Map, Mapped, Poses, StoreError, wrap_angle
from uwbbench.results.drives import MappedDrive, cells, ellipses, poses_of, thinned, true_poses
from uwbbench.tools.check.drives import usual_drive

TURN, SHIFT_M = 0.7, np.array([2.0, -1.0])
POINTS_M = np.array([[0.5, 0.2], [1.5, -0.3]])
LINE = (1.2, 0.4)
"""Distance and direction of the normal of a line, in the frame of the truth."""


def moved(points_m):
    """Points of the truth's frame as a mapper has them that began elsewhere."""
    cosine, sine = np.cos(TURN), np.sin(TURN)
    return points_m @ np.array([[cosine, sine], [-sine, cosine]]) + SHIFT_M


@pytest.fixture(scope="module")
def header():
    return usual_drive().header


@pytest.fixture
def drive(header):
    """True poses and a true map, in a frame of its own."""
    truth = true_poses(header)
    pose = np.column_stack([moved(truth[:, :2]), wrap_angle(truth[:, 2] + TURN)])
    covariance = np.broadcast_to(np.diag([4e-4, 1e-4, 1e-4]), (len(pose), 3, 3))
    normal = np.array([np.cos(LINE[1] + TURN), np.sin(LINE[1] + TURN)])
    landmarks = Landmarks(
        identity=np.arange(3),
        kind=np.array([0, 0, 1]),
        a=np.append(moved(POINTS_M)[:, 0], LINE[0] + normal @ SHIFT_M),
        b=np.append(moved(POINTS_M)[:, 1], LINE[1] + TURN),
        covariance=np.broadcast_to(np.diag([9e-4, 1e-4]), (3, 2, 2)),
        support=np.ones(3, np.int64),
    )
    poses = Poses(np.arange(len(pose)), pose, covariance)
    mapped = Mapped(poses, Map(landmarks, points_m=moved(POINTS_M)))
    return MappedDrive(header, Detections.empty(np.arange(len(pose))), mapped, poses)


@pytest.mark.parametrize("frame", ["start", "aligned"])
def test_a_true_map_in_another_frame_lies_on_the_truth(drive, frame):
    laid = MappedDrive(drive.header, drive.detections, drive.mapped, drive.poses, frame)
    np.testing.assert_allclose(laid.pose[:, :2], laid.truth[:, :2], atol=1e-9)
    np.testing.assert_allclose(laid.error_m, 0, atol=1e-9)
    np.testing.assert_allclose(laid.marks("point")[0], POINTS_M, atol=1e-9)
    np.testing.assert_allclose(laid.points_m, POINTS_M, atol=1e-9)
    for end_m in laid.lines_m.reshape(-1, 2):
        assert end_m @ [np.cos(LINE[1]), np.sin(LINE[1])] == pytest.approx(LINE[0])


def test_covariances_turn_with_the_map(drive):
    _, covariance = drive.marks("point")
    turned = np.array([np.cos(TURN), -np.sin(TURN)])
    assert turned @ covariance[0] @ turned == pytest.approx(9e-4)


def test_the_band_is_the_long_half_axis_of_the_ellipse_and_known_with_the_start_fixed_alone(drive):
    np.testing.assert_allclose(drive.band_m, 0.02 * np.sqrt(5.991), rtol=1e-9)
    assert MappedDrive(drive.header, drive.detections, drive.mapped, drive.poses, "aligned").band_m is None
    bare = dataclasses.replace(drive.mapped, poses=dataclasses.replace(drive.mapped.poses, covariance=None))
    assert MappedDrive(drive.header, drive.detections, bare, bare.poses).band_m is None


def test_echoes_are_where_the_estimated_pose_sees_them(drive):
    """Seen 1 m ahead of the second receiver, which looks to the left, and by a frame without a pose not at all."""
    rows = Detections([3, 3], range_m=[1.0, np.nan], azimuth_rad=[0.0, 0.0], receiver=[1.0, 1.0])
    at, place_m = MappedDrive(drive.header, rows, drive.mapped, drive.poses).found
    x, y, yaw = drive.truth[3]
    mount_x, mount_y = drive.header.radars[1].mount_position_m[:2]
    ahead, left = mount_x, mount_y + 1.0
    expected = [x + np.cos(yaw) * ahead - np.sin(yaw) * left, y + np.sin(yaw) * ahead + np.cos(yaw) * left]
    assert at.tolist() == [3]
    np.testing.assert_allclose(place_m[0], expected, atol=1e-9)


def test_an_ellipse_holds_95_percent(drive):
    covariance = np.array([[[0.5, 0.2], [0.2, 0.3]]])
    corners_m = ellipses(np.array([[1.0, 2.0]]), covariance)[0] - (1.0, 2.0)
    distance = np.einsum("ni,ij,nj->n", corners_m, np.linalg.inv(covariance[0]), corners_m)
    np.testing.assert_allclose(distance, 5.991)
    np.testing.assert_allclose(corners_m[0], corners_m[-1])


def test_poses_that_are_not_there_are_refused(drive):
    with pytest.raises(StoreError, match="'mine' does not look back"):
        poses_of(drive.mapped, "mapping", "mine")
    with pytest.raises(StoreError, match="'mine' has handed out no pose"):
        poses_of(Mapped(Poses.none(), Map()), "filtering", "mine")


def test_an_estimate_that_is_far_off_does_not_make_the_picture_larger_than_twice_the_truth(drive):
    low, high = drive.box_m
    pose = drive.poses.pose.copy()
    pose[-1, :2] += 1e4
    far = Poses(drive.poses.index, pose)
    far_low, far_high = MappedDrive(drive.header, drive.detections, Mapped(far, Map()), far).box_m
    assert ((far_high - far_low) <= (high - low).max() * 2).all()


def test_the_cells_of_a_grid_have_their_middles():
    grid = Grid(np.array([1.0, 2.0]), 0.5, np.array([[0.0, 1.0], [-1.0, 0.0]]))
    middles_m, log_odds = cells(grid)
    assert middles_m.tolist() == [[1.75, 2.25], [1.25, 2.75]]
    assert log_odds.tolist() == [1.0, -1.0]
    assert cells(grid, occupied=True)[0].tolist() == [[1.75, 2.25]]


@pytest.mark.parametrize(("count", "most"), [(0, 5), (1, 5), (5, 5), (1000, 7)])
def test_what_is_thinned_keeps_its_ends(count, most):
    kept = thinned(count, most)
    assert len(kept) == min(count, most)
    assert set(kept.tolist()) >= ({0, count - 1} if count else set())
