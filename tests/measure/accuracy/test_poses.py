"""Poses of a mapper against the true ones: the scoring ``pose``."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.measure.accuracy.scenes import OF_DETECTIONS, capture_of, post
from uwbbench.api import Detections, Map, Mapped, Metric, Poses, ScoringError
from uwbbench.measure.accuracy.boards import verdict
from uwbbench.measure.accuracy.metrics.choice import MetricChoice
from uwbbench.measure.accuracy.metrics.pose import AbsoluteTrajectoryError, EndError, MedianTrajectoryError
from uwbbench.measure.accuracy.rules import ScoringRules, applies
from uwbbench.measure.accuracy.scoring import outcomes, score
from uwbbench.measure.accuracy.stats import estimated, evaluate, paired_difference
from uwbbench.measure.accuracy.trajectories import Motion

STEPS = 200


def circle(radius_m=2.0):
    """A run on a circle."""
    angle = np.linspace(0, 2 * np.pi, STEPS)
    position_m = np.column_stack([radius_m * np.cos(angle), radius_m * np.sin(angle), np.full(STEPS, 0.3)])
    return capture_of(post(0), frames=STEPS, position_m=position_m, yaw_rad=angle + np.pi / 2)


def true_poses(capture):
    return np.column_stack([capture.trajectory.position_m[:, :2], capture.trajectory.yaw_rad])


def mapped(pose, index=None, covariance=None, smoothed=None):
    """What a mapper made of a run, with rows of two receivers."""
    index = np.arange(len(pose)) if index is None else np.asarray(index)
    later = None if smoothed is None else Poses(np.arange(len(smoothed)), smoothed)
    made = Mapped(Poses(index, pose, covariance), Map(), later)
    found = Detections([0, 0], range_m=[1.0, 2.0], processed=np.arange(STEPS), receiver=[0, 1])
    return found.annotated(mapped=made)


def test_the_truth_itself_has_no_error():
    capture = circle()
    block = score(mapped(true_poses(capture)), capture, "pose").filtering
    for name in ("ate_m", "ate_start_m", "end_error_m", "heading_error_rad", "rpe_m", "rpe_turn_rad", "nearest_rmse_m"):
        assert getattr(block, name) == pytest.approx(0, abs=1e-9)
    assert math.isnan(block.nees)


def test_scale_is_no_part_of_the_alignment():
    capture = circle()
    pose = true_poses(capture) * [1.1, 1.1, 1.0]
    block = score(mapped(pose), capture, "pose").filtering
    middle = true_poses(capture)[:, :2].mean(axis=0)
    spread = np.sqrt(np.mean(np.sum((true_poses(capture)[:, :2] - middle) ** 2, axis=1)))
    assert block.ate_m == pytest.approx(0.1 * spread)
    assert block.rpe_m == pytest.approx(0.1, rel=0.05)
    assert block.rpe_turn_rad == pytest.approx(0, abs=1e-9)


def test_with_the_start_fixed_a_wrong_heading_at_first_costs_what_it_costs_a_robot():
    capture = circle()
    pose = true_poses(capture)
    pose[1:] = Motion(0.1, np.zeros(2)).of_poses(pose)[1:]  # the map was turned after the first step
    block = score(mapped(pose), capture, "pose").filtering
    assert block.ate_m < 0.02
    assert block.ate_start_m == pytest.approx(2 * 2 * math.sin(0.05), rel=0.01)
    assert block.end_error_m == pytest.approx(2 * 2 * math.sin(0.05), rel=1e-6)


def test_poses_on_the_way_and_the_smoothed_ones_are_a_table_each():
    capture = circle()
    truth = true_poses(capture)
    found = mapped(truth + [0, 0, 0.2] * np.linspace(0, 1, STEPS)[:, None], smoothed=truth)
    scores = score(found, capture, "pose")
    assert scores.mapping.heading_error_rad == pytest.approx(0, abs=1e-9)
    assert scores.filtering.heading_error_rad > 0.05
    assert score(mapped(truth), capture, "pose").mapping is None


def test_steps_without_a_pose_are_counted_and_cost_nothing_else():
    capture = circle()
    kept = np.arange(0, STEPS, 2)
    block = score(mapped(true_poses(capture)[kept], kept), capture, "pose").filtering
    assert (block.frames, block.unprocessed) == (100, 100)
    assert block.ate_m == pytest.approx(0, abs=1e-9)


def test_consistency_does_not_hang_on_the_frame_that_the_mapper_works_in():
    capture = circle()
    rng = np.random.default_rng(2)
    root = rng.normal(0, 0.1, (3, 3))
    covariance = np.tile(root @ root.T + 1e-4 * np.eye(3), (STEPS, 1, 1))
    pose = true_poses(capture) + rng.multivariate_normal(np.zeros(3), covariance[0], STEPS)
    pose[0] = true_poses(capture)[0]
    here = score(mapped(pose, covariance=covariance), capture, "pose").filtering
    motion = Motion(1.2, np.array([4.0, -3.0]))
    turn = np.eye(3)
    turn[:2, :2] = motion.matrix
    moved = mapped(motion.of_poses(pose), covariance=turn @ covariance @ turn.T)
    assert score(moved, capture, "pose").nees == pytest.approx(here.nees)
    assert here.nees == pytest.approx(3, abs=0.8)
    assert here.nees_inside == pytest.approx(0.95, abs=0.06)


@given(st.floats(-math.pi, math.pi), st.floats(-20, 20), st.floats(-20, 20))
@settings(max_examples=8, deadline=None)
def test_every_number_stays_where_the_estimate_is_moved_as_a_whole(turn_rad, x_m, y_m):
    capture = circle()
    pose = true_poses(capture) + np.cumsum(np.random.default_rng(1).normal(0, 0.01, (STEPS, 3)), axis=0)
    moved = Motion(turn_rad, np.array([x_m, y_m])).of_poses(pose)
    before, after = (score(mapped(one), capture, "pose").filtering.own for one in (pose, moved))
    for name, value in before.items():
        assert after[name] == pytest.approx(value, abs=1e-8, nan_ok=True)


def test_a_capture_without_labelled_objects_has_true_poses_all_the_same():
    capture = dataclasses.replace(circle(), truth=None)
    found = mapped(true_poses(capture))
    assert score(found, capture, "pose").ate_m == pytest.approx(0, abs=1e-9)
    with pytest.raises(ScoringError, match="no ground truth but its poses; score it by 'pose'"):
        score(found, capture, "map")


@pytest.mark.parametrize("scoring", ["pose", "map"])
def test_detections_without_a_mapper_are_refused_with_what_would_do(scoring):
    with pytest.raises(ScoringError, match=r"hands out no poses and no map.*score it by 'frame'"):
        score(Detections([0], range_m=[2.0], processed=np.arange(STEPS)), circle(), scoring)


@pytest.mark.parametrize("scoring", [*OF_DETECTIONS, "track", "segment", "presence"])
def test_rows_of_several_receivers_are_counted_by_no_scoring_of_detections(scoring):
    capture = circle()
    with pytest.raises(ScoringError, match="of several receivers together; score it by 'pose' or 'map'"):
        score(mapped(true_poses(capture)), capture, scoring)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda pose: (pose[:0], []), "handed out no pose"),
        (lambda pose: (pose, np.arange(STEPS) + 1), "name step 200, but run 'scene' has 200 steps"),
        (lambda pose: (pose[:2], [5, 5]), "do not rise"),
        (lambda pose: (np.where(np.arange(STEPS)[:, None] == 7, np.nan, pose), None), "step 7 is not finite"),
    ],
)
def test_poses_that_are_no_trajectory_of_the_run_are_refused(change, reason):
    capture = circle()
    pose, index = change(true_poses(capture))
    with pytest.raises(ScoringError, match=reason):
        score(mapped(pose, index), capture, "pose")


def test_scores_of_a_run_hold_no_counts_of_detections():
    capture = circle()
    stored = score(mapped(true_poses(capture)), capture, "pose").filtering.to_dict()
    assert not {"tp", "precision", "f1", "mae_m", "retained"} & set(stored)
    assert {"frames", "unprocessed", "exhaustive", "ate_m", "rpe_turn_rad"} <= set(stored)


@pytest.mark.parametrize("scoring", ["pose", "map"])
def test_tables_of_runs_have_no_column_of_metrics_that_count_detections(scoring):
    names = set(MetricChoice(["bias", "p95"], [scoring]))
    assert names
    assert not names & {"precision", "recall", "f1", "mae", "p90", "p95", "sd", "bias", "false_alarms_per_minute"}
    assert not applies(Metric, scoring)


# Evidence: the run ------------------------------------------------------------------------------------------------


def runs(errors_m):
    """Outcome of a run for each scale error, whose ATE follows it."""
    capture, made = circle(), []
    for error in errors_m:
        pose = true_poses(capture) * [1 + error, 1 + error, 1.0]
        made.append(outcomes(mapped(pose), capture, ScoringRules("pose"))["filtering"])
    return made


ERRORS = np.linspace(0.02, 0.06, 10)


def test_several_runs_have_the_mean_of_theirs_and_each_counts_once():
    made = runs(ERRORS)
    each = [evaluate(AbsoluteTrajectoryError, [one]) for one in made]
    found = estimated(AbsoluteTrajectoryError, made, ["the same scene"] * 10)
    assert found.value == pytest.approx(np.mean(each))
    assert (found.n, found.groups, found.within) == (10, 10, False)
    assert found.low < found.value < found.high
    assert evaluate(MedianTrajectoryError, made) == pytest.approx(np.median(each))


def test_the_interval_is_that_of_student_on_the_scale_of_logarithms():
    each = np.array([evaluate(AbsoluteTrajectoryError, [one]) for one in runs(ERRORS)])
    found = estimated(AbsoluteTrajectoryError, runs(ERRORS))
    error = each.std(ddof=1) / math.sqrt(10) / each.mean()  # of the logarithm of the mean
    assert math.log(found.high / found.value) == pytest.approx(2.262 * error, rel=0.02)
    assert found.value / found.low == pytest.approx(found.high / found.value)


def test_fewer_than_ten_runs_have_no_interval_and_decide_nothing():
    made = runs(ERRORS[:9])
    found = estimated(AbsoluteTrajectoryError, made)
    assert (math.isnan(found.low), math.isnan(found.high), len(found.per_group)) == (True, True, 9)
    difference = paired_difference(AbsoluteTrajectoryError, made, runs(ERRORS[:9] + 0.01))
    assert difference.value < 0
    assert math.isnan(difference.low)
    assert math.isnan(difference.p_value)
    assert verdict(difference.contrast, difference.p_value, 9, 0.01, least=10) == "too few"


def test_ten_runs_are_compared_in_pairs():
    difference = paired_difference(AbsoluteTrajectoryError, runs(ERRORS), runs(ERRORS * 1.3))
    assert difference.low < difference.value < difference.high < 0
    assert difference.p_value < 0.01


def test_runs_that_all_say_the_same_have_no_interval():
    found = estimated(EndError, runs([0.0] * 10))
    assert math.isnan(found.low)


def test_runs_without_a_number_are_no_evidence():
    capture = circle()
    short = outcomes(mapped(true_poses(capture)[:3], [0, 1, 2]), capture, ScoringRules("pose"))["filtering"]
    names = MetricChoice((), ["pose"])
    found = estimated(names["rpe"], [*runs(ERRORS[:9]), short])  # less than a metre
    assert found.n == 9
    assert math.isnan(found.low)
