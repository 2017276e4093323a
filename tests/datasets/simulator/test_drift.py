"""Wheels that slip: what odometry counts and the robot does not do."""

import numpy as np
import pytest

EXACT = {"distance_error": 0.0, "rotation_error": 0.0, "heading_noise_deg": 0.0}
STRAIGHT = {"kind": "straight", "start_m": [0, 0], "end_m": [12, 0], "speed_m_s": 0.2}


@pytest.fixture
def believed(run_scene):
    """True and believed poses of a run, and the times."""

    def run(trajectory=STRAIGHT, **params):
        odometry = {"use": "odometry", "params": {**EXACT, **params}}
        capture = run_scene([{"use": "direct"}, odometry], trajectory=trajectory)
        return capture.trajectory, capture.odometry_position_m, capture.odometry_yaw_rad

    return run


def test_without_slips_and_errors_the_robot_knows_where_it_is(believed) -> None:
    track, position, yaw = believed()
    assert position == pytest.approx(track.position_m, abs=1e-9)
    assert yaw == pytest.approx(track.yaw_rad, abs=1e-12)


def test_a_slip_counts_a_way_ahead_within_its_time(believed) -> None:
    track, position, _ = believed(slips_per_min=20, slip_m=0.1, slip_deg=0.0, slip_s=0.3)
    too_far = position[:, 0] - track.position_m[:, 0]
    steps = np.diff(too_far)
    assert np.all(steps > -1e-12)
    slipping = steps > 1e-12
    starts = np.sum(np.diff(np.concatenate([[0], slipping.astype(int)])) == 1)
    assert 8 <= starts <= 32  # 20 in a minute, by Poisson, and some overlap
    assert slipping.sum() <= starts * (2 * 0.3 * 48 + 2)
    assert 0.05 < too_far[-1] / starts < 0.25
    assert np.allclose(position[:, 1], track.position_m[:, 1])


def test_a_slip_turns_and_all_that_follows_is_askew(believed) -> None:
    track, position, yaw = believed(slips_per_min=3, slip_m=0.0, slip_deg=5.0)
    turned = np.abs(np.diff(yaw)) > 1e-12
    assert 0 < turned.sum() < len(turned) / 4
    assert np.linalg.norm(np.diff(position, axis=0), axis=1) == pytest.approx(
        np.linalg.norm(np.diff(track.position_m, axis=0), axis=1)
    )
    assert abs(position[-1, 1]) > 0.01


def test_a_robot_that_stands_does_not_slip(believed) -> None:
    track, position, yaw = believed({"kind": "static", "duration_s": 30.0}, slips_per_min=60)
    assert np.array_equal(position, track.position_m)
    assert np.array_equal(yaw, track.yaw_rad)


def test_the_level_of_drift_leaves_slips_to_the_scene(make_term) -> None:
    assert make_term("odometry", drift=0.02, slips_per_min=3.0).params.errors == (0.02, 0.02, np.radians(1.0))
