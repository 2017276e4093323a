"""Trajectories against the true one: alignment, relative errors, consistency."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api import wrap_angle
from uwbbench.measure.accuracy.trajectories import (
    Motion,
    aligned,
    nearest_errors,
    pairs,
    relative_errors,
    squared_error_band,
    squared_errors,
    start_fixed,
)

SHARE = np.linspace(0, 1, 400)


def columns(*values):
    return np.column_stack(values)


def loop():
    """A closed way, and an estimate that drifts, in another frame."""
    t = SHARE
    x, y = 1.8 * np.cos(2 * np.pi * t) + 0.3 * np.sin(6 * np.pi * t), 1.4 * np.sin(2 * np.pi * t)
    truth = columns(x, y, 2 * np.pi * t + 0.2 * np.sin(5 * t))
    drift = truth + columns(0.12 * t + 0.02 * np.sin(40 * t), 0.2 * t**2, 0.15 * t)
    return truth, Motion(0.3, np.array([1.0, -2.0])).of_poses(drift)


def path():
    """A winding way whose estimate is 5 % too long."""
    t = SHARE
    truth = columns(8 * t, 0.8 * np.sin(7 * t), 0.6 * np.cos(7 * t))
    noise = columns(0 * t, 0.05 * np.sin(30 * t), 0.02 * np.cos(30 * t))
    return truth, truth * np.array([1.05, 1.0, 1.0]) + noise


def spiral():
    """A way out whose estimate loses its heading."""
    t = SHARE
    truth = columns((0.5 + 2 * t) * np.cos(9 * t), (0.5 + 2 * t) * np.sin(9 * t), 9 * t + 1.2)
    return truth, truth + columns(0.3 * np.sin(3 * t), 0.25 * t, -0.4 * t)


# Of evo 1.38.1, which is GPL-3 and never imported, on these poses as matrices of SE(3):
# APE(translation_part) and APE(rotation_angle_rad), RMSE, after traj.align(truth), and after traj.align_origin(truth);
# RPE of both with delta=1.0, delta_unit=Unit.meters, rel_delta_tol=0.1, all_pairs=True, pairs_from_reference=True.
# evo aligns in space; the estimates are near enough to the truth that it does not turn the plane over.
GOLDEN = {
    loop: {
        "aligned": (0.06554788573364262, 0.07321081009133226),
        "start": (0.11456358186590128, 0.08665678563298192),
        "relative": (366, 0.07683830673785214, 0.01527725886575125),
    },
    path: {
        "aligned": (0.12053854061278468, 0.01502942085184065),
        "start": (0.25034369870736584, 0.024982300119013565),
        "relative": (362, 0.08646342817300653, 0.027719399262757224),
    },
    spiral: {
        "aligned": (0.10440521641316139, 0.2551506237277846),
        "start": (0.26046020520068036, 0.2310847616879521),
        "relative": (383, 0.2342969290824776, 0.034689807736682524),
    },
}


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def errors(poses, truth):
    return rms(np.hypot(*(poses - truth)[:, :2].T)), rms(wrap_angle(poses[:, 2] - truth[:, 2]))


@pytest.mark.parametrize("way", GOLDEN, ids=lambda way: way.__name__)
def test_absolute_errors_are_those_of_evo(way):
    truth, estimate = way()
    assert errors(aligned(estimate, truth).of_poses(estimate), truth) == pytest.approx(
        GOLDEN[way]["aligned"], abs=1e-12
    )
    assert errors(start_fixed(estimate, truth).of_poses(estimate), truth) == pytest.approx(
        GOLDEN[way]["start"], abs=1e-12
    )


@pytest.mark.parametrize("way", GOLDEN, ids=lambda way: way.__name__)
def test_relative_errors_are_those_of_evo(way):
    truth, estimate = way()
    first, second = pairs(truth)
    found = relative_errors(estimate, truth, first, second)
    assert (len(first), *map(rms, found)) == pytest.approx(GOLDEN[way]["relative"], abs=1e-12)


SEEDS = st.integers(0, 2**32 - 1)


def random_ways(seed, rows=60):
    rng = np.random.default_rng(seed)
    truth = np.cumsum(rng.normal(0, 0.1, (rows, 3)), axis=0)
    return truth, truth + np.cumsum(rng.normal(0, 0.02, (rows, 3)), axis=0), rng


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_no_other_motion_leaves_less_than_the_alignment(seed):
    truth, estimate, rng = random_ways(seed)
    best = aligned(estimate, truth)
    least = errors(best.of_poses(estimate), truth)[0]
    for _ in range(20):
        other = Motion(best.turn_rad + rng.normal(0, 0.1), best.shift_m + rng.normal(0, 0.1, 2))
        assert errors(other.of_poses(estimate), truth)[0] >= least - 1e-12


@given(SEEDS, st.floats(-math.pi, math.pi), st.floats(-50, 50), st.floats(-50, 50))
@settings(max_examples=25, deadline=None)
def test_moving_the_estimate_as_a_whole_changes_no_error(seed, turn_rad, x_m, y_m):
    truth, estimate, _ = random_ways(seed)
    moved = Motion(turn_rad, np.array([x_m, y_m])).of_poses(estimate)
    for motion in (aligned, start_fixed):
        before = errors(motion(estimate, truth).of_poses(estimate), truth)
        assert errors(motion(moved, truth).of_poses(moved), truth) == pytest.approx(before, abs=1e-9)
    first, second = pairs(truth)
    for before, after in zip(
        relative_errors(estimate, truth, first, second), relative_errors(moved, truth, first, second), strict=True
    ):
        np.testing.assert_allclose(after, before, atol=1e-9)


def test_a_straight_line_is_aligned():
    truth = columns(np.linspace(0, 10, 50), np.zeros(50), np.zeros(50))
    estimate = Motion(0.7, np.array([3.0, -1.0])).of_poses(truth)
    assert errors(aligned(estimate, truth).of_poses(estimate), truth) == pytest.approx((0, 0), abs=1e-12)


def test_a_robot_that_stands_is_aligned_by_its_heading():
    truth = np.tile([2.0, 1.0, 0.5], (20, 1))
    estimate = np.tile([0.0, 0.0, 0.0], (20, 1))
    assert errors(aligned(estimate, truth).of_poses(estimate), truth) == pytest.approx((0, 0), abs=1e-12)
    assert not len(pairs(truth)[0])


def brute_pairs(truth, travel_m, tolerance):
    """Every later pose is tried, the first of equal ones."""
    travelled = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(truth[:, :2], axis=0).T))])
    found = []
    for first in range(len(truth) - 1):
        off = np.abs(travelled[first + 1 :] - travelled[first] - travel_m)
        if off.min() <= tolerance * travel_m:
            found.append((first, first + 1 + int(np.argmin(off))))
    return found


@given(SEEDS, st.sampled_from([0.05, 0.3, 1.0]), st.integers(1, 40))
@settings(max_examples=40, deadline=None)
def test_pairs_are_those_of_trying_all(seed, tolerance, rows):
    rng = np.random.default_rng(seed)
    steps = rng.choice([0.0, 0.25, 0.5], (rows, 3))  # it stands at times, and many pairs are as far apart
    steps[:, 1:] = 0
    truth = np.cumsum(steps, axis=0)
    assert list(zip(*pairs(truth, 1.0, tolerance), strict=True)) == brute_pairs(truth, 1.0, tolerance)


def test_squared_errors_are_those_of_the_formula_and_undefined_where_nothing_is_uncertain():
    rng = np.random.default_rng(3)
    truth, estimate = rng.normal(0, 1, (2, 6, 3))
    estimate[1, 2] = truth[1, 2] + 2 * np.pi - 0.1  # nearly the same heading
    root = rng.normal(0, 1, (6, 3, 3))
    covariance = root @ root.transpose(0, 2, 1) + 0.1 * np.eye(3)
    covariance[0] = 0.0  # the start is known
    found = squared_errors(estimate, truth, covariance)
    assert math.isnan(found[0])
    for row in range(1, 6):
        error = estimate[row] - truth[row]
        error[2] = math.remainder(error[2], 2 * np.pi)
        assert found[row] == pytest.approx(error @ np.linalg.inv(covariance[row]) @ error)


def test_squared_errors_of_a_filter_that_knows_its_errors_lie_in_the_band():
    rng = np.random.default_rng(4)
    covariance = np.array([[0.04, 0.01, 0.0], [0.01, 0.02, 0.002], [0.0, 0.002, 0.01]])
    error = rng.multivariate_normal(np.zeros(3), covariance, 4000)
    found = squared_errors(error, np.zeros((4000, 3)), np.tile(covariance, (4000, 1, 1)))
    assert found.mean() == pytest.approx(3, abs=0.2)
    low, high = squared_error_band()
    assert np.mean((found >= low) & (found <= high)) == pytest.approx(0.95, abs=0.02)
    low, high = squared_error_band(runs=10)
    means = found.reshape(-1, 10).mean(axis=1)
    assert np.mean((means >= low) & (means <= high)) == pytest.approx(0.95, abs=0.06)


def test_nearest_errors_do_not_see_errors_along_the_path():
    truth = columns(np.linspace(0, 10, 2001), np.zeros(2001))
    late = truth[:-200]  # 1 m behind, all along
    assert rms(nearest_errors(late, truth)) < 1e-12
    aside = truth[500:1500] + np.array([0.0, 0.2])
    assert rms(nearest_errors(aside, truth)) < 1e-3  # laid over it by the nearest points, as the script does


def test_nearest_errors_are_measured_to_the_points_that_were_nearest_before():
    truth = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [2.0, 2.0]])
    estimate = truth + np.array([0.7, 0.0])  # the nearest of the first is the second
    found = nearest_errors(estimate, truth)
    moved = found + truth[[1, 2, 2, 3, 4]]
    turn = np.array(aligned(columns(estimate, np.zeros(5)), columns(moved, np.zeros(5))).matrix)
    np.testing.assert_allclose(moved - moved.mean(axis=0), (estimate - estimate.mean(axis=0)) @ turn.T, atol=1e-12)
