"""Scoring of detections against the truth of a capture: which frames and objects count, and by what rules."""

import json
import math
import pickle

import numpy as np
import pytest

from tests.measure.accuracy.scenes import GATE_M, RATE_HZ, WINDOW_M, at_once, capture_of, counts, found_in, post
from uwbbench.api import Detections, Obstacle, ScoringError
from uwbbench.api.capture import CaptureHeader
from uwbbench.measure.accuracy.rules import outcome_of
from uwbbench.measure.accuracy.scoring import SCORINGS, Region, ScoringRules, outcomes, score

# ---- which frames and objects count


def test_empty_scene_without_output_is_true_empty_and_undefined():
    scores = score(found_in(4), capture_of())
    assert scores.true_empty == scores.frames == 4
    assert counts(scores) == (0, 0, 0)
    assert math.isnan(scores.precision)
    assert math.isnan(scores.recall)
    assert math.isnan(scores.f1)
    assert scores.false_alarms_per_minute == 0


def test_empty_scene_with_output_has_precision_zero_and_no_error():
    scores = score(found_in(4, (1, 3.0)), capture_of())
    assert counts(scores) == (0, 1, 0)
    assert (scores.precision, scores.true_empty) == (0, 3)
    assert math.isnan(scores.recall)
    assert math.isnan(scores.mae_m)
    assert scores.false_alarms_per_minute == pytest.approx(60 / (4 / RATE_HZ))


@pytest.mark.parametrize("scoring", [name for name in SCORINGS if not outcome_of(name).of_run])
def test_capture_without_frames_scores_nothing(scoring):
    found = at_once(found_in(0)).annotated(candidates=found_in(0))
    scores = score(found, capture_of(post(2), frames=0), scoring)
    assert (scores.frames, scores.retained) == (0, 0)
    assert math.isnan(scores.recall)
    assert math.isnan(scores.false_alarms_per_minute)


def test_frames_nobody_processed_are_neither_missed_nor_empty_but_counted():
    found = Detections([0], range_m=[2.0], processed=[0, 1])
    scores = score(found, capture_of(post(2), frames=5))
    assert counts(scores) == (1, 0, 1)
    assert (scores.frames, scores.unprocessed) == (2, 3)


def test_frames_without_a_label_or_a_pose_are_not_scored():
    outline = np.full((4, 1, 2), [2.0, 0.0])
    outline[1] = np.nan
    position_m = np.zeros((4, 3))
    position_m[2] = np.nan
    capture = capture_of(Obstacle("walker", "person", outline), position_m=position_m)
    scores = score(found_in(4, (0, 2.0), (1, 3.0), (2, 3.0)), capture)
    assert counts(scores) == (1, 0, 1)
    assert (scores.frames, scores.unprocessed) == (2, 0)


def test_moving_object_is_looked_for_where_it_is_in_each_frame():
    outline = np.array([[[2.0, 0.0]], [[3.0, 0.0]], [[4.0, 0.0]]])
    capture = capture_of(Obstacle("walker", "person", outline), frames=3)
    columns = {"x_m": [2.0, 2.0, 4.1], "y_m": np.zeros(3), "cluster": np.zeros(3, int)}
    scores = score(found_in(3, (0, 2.0), (1, 2.0), (2, 4.1), **columns), capture)
    assert counts(scores) == (2, 1, 0)
    assert (scores.mapping.tp, scores.mapping.fp) == (2, 1)
    assert scores.mae_m == scores.mapping.mae_m == pytest.approx(1.1 / 3)


def test_moving_receiver_sees_a_fixed_object_at_its_own_distance():
    capture = capture_of(post(3), frames=3, position_m=[[0, 0, 0], [0.5, 0, 0], [1, 0, 0]])
    assert counts(score(found_in(3, (0, 3.0), (1, 2.5), (2, 2.0)), capture)) == (3, 0, 0)


def test_object_occluded_by_another_is_not_asked_for():
    plate = Obstacle("plate", "metal", np.array([[1.5, -1], [1.5, 1], [1.6, 1], [1.6, -1]]))
    scores = score(found_in(1, (0, 1.5)), capture_of(plate, post(3), frames=1), "object")
    assert counts(scores) == (1, 0, 0)


@pytest.mark.parametrize(("has_sts", "missed"), [(False, 1), (True, 0)])
def test_field_of_view_is_narrower_for_a_radar_that_measures_angles(has_sts, missed):
    at_60_degrees = post(1, math.sqrt(3))
    scores = score(found_in(1), capture_of(at_60_degrees, frames=1, has_sts=has_sts))
    assert (scores.fn, scores.true_empty) == (missed, 1 - missed)
    wide = score(
        found_in(1), capture_of(at_60_degrees, frames=1, has_sts=has_sts), region=Region(half_angle_rad=math.pi / 2)
    )
    assert wide.fn == 1


def test_error_without_a_visible_object_refers_to_the_nearest_labelled_obstacle():
    capture = capture_of(post(0, 3), post(2.9, structure=True), frames=1, has_sts=True)
    scores = score(found_in(1, (0, 2.5)), capture)
    assert counts(scores) == (0, 1, 0)
    assert scores.bias_m == pytest.approx(-0.5)


# ---- the region's borders


def test_blind_zone_is_left_out_and_reported_apart():
    found = found_in(2, (0, 2.0))
    capture = capture_of(Obstacle("near", "metal", np.array([[[2.0, 0.0]], [[0.4, 0.0]]])), frames=2)
    scores = score(found, capture)
    assert (scores.recall, scores.recall_with_blind_zone) == (1.0, 0.5)
    assert scores.true_empty == 1


@pytest.mark.parametrize("scoring", ["frame", "object"])
def test_small_error_at_the_border_is_neither_punished_nor_rewarded(scoring):
    inside, outside = capture_of(post(0.65), frames=1), capture_of(post(0.55), frames=1)
    assert counts(score(found_in(1, (0, 0.55)), inside, scoring)) == (1, 0, 0)
    assert counts(score(found_in(1, (0, 0.65)), outside, scoring)) == (0, 0, 0)
    assert score(found_in(1, (0, 0.65)), outside, scoring).retained == 0


def test_far_border_is_the_radars_window_unless_given():
    capture = capture_of(post(9), frames=1)
    assert score(found_in(1), capture).fn == 1
    assert score(found_in(1), capture, region=Region(max_range_m=8)).fn == 0
    assert score(found_in(1, (0, WINDOW_M + 1)), capture).retained == 0


def test_detections_without_a_range_are_ignored():
    assert score(found_in(1, (0, np.nan), (0, 2.0)), capture_of(post(2), frames=1), "object").retained == 1


# ---- the scorings


def test_detection_exactly_at_the_gate_is_true_and_the_next_number_is_not():
    capture = capture_of(post(2), frames=1)
    assert score(found_in(1, (0, 2.25)), capture, gate_m=0.25).tp == 1
    assert score(found_in(1, (0, np.nextafter(2.25, 3))), capture, gate_m=0.25).tp == 0


def test_frame_scoring_takes_the_strongest_and_without_amplitudes_the_first():
    capture = capture_of(post(2), frames=1)
    assert score(found_in(1, (0, 2.0), (0, 3.0), amplitude=[1, 2]), capture).fp == 1
    assert score(found_in(1, (0, 2.0), (0, 3.0), amplitude=[np.nan, 2]), capture).fp == 1
    assert score(found_in(1, (0, 2.0), (0, 3.0), amplitude=[2, 2]), capture).tp == 1
    assert score(found_in(1, (0, 2.0), (0, 3.0)), capture).tp == 1


def test_strongest_limits_the_detections_in_the_region_only():
    capture = capture_of(post(2), frames=1)
    found = found_in(1, (0, 0.1), (0, 2.0), (0, 3.0), amplitude=[9, 5, 1])
    assert counts(score(found, capture, "object", strongest=1)) == (1, 0, 0)
    assert counts(score(found, capture, "object")) == (1, 1, 0)


def test_peak_scoring_misses_only_what_the_filters_removed():
    capture = capture_of(post(2), frames=3)
    candidates = found_in(3, (0, 2.0), (1, 2.1), (2, 5.0))
    found = candidates.take([0]).annotated(candidates=candidates)
    assert counts(score(found, capture, "peak")) == (1, 0, 1)
    assert counts(score(found, capture, "frame")) == (1, 0, 2)


def test_peak_scoring_does_not_ask_for_candidates_where_another_scoring_is_wanted():
    def never():
        raise AssertionError("asked for")

    found = found_in(1, (0, 2.0)).annotated(candidates=never)
    assert score(found, capture_of(post(2), frames=1)).tp == 1


def test_walls_are_false_in_frame_scoring_and_apart_in_object_scoring():
    capture = capture_of(post(2), post(5, structure=True), frames=1)
    found = found_in(1, (0, 5.1))
    assert counts(score(found, capture)) == (0, 1, 0)
    scores = score(found, capture, "object")
    assert counts(scores) == (0, 0, 1)
    assert (scores.structure, scores.retained) == (1, 1)
    assert math.isnan(scores.mae_m)


def test_object_scoring_gives_up_the_nearest_pair_for_one_more_pair():
    # 2.15 is nearest to the post at 2.2, but 2.38 can only be that one's.
    scores = score(found_in(1, (0, 2.15), (0, 2.38)), capture_of(post(2), post(2.2), frames=1), "object")
    assert counts(scores) == (2, 0, 0)
    assert scores.mae_m == pytest.approx((0.15 + 0.18) / 2)


def test_second_detection_of_a_found_object_is_a_duplicate_and_false():
    scores = score(found_in(1, (0, 2.0), (0, 2.1), (0, 4.0)), capture_of(post(2), frames=1), "object")
    assert counts(scores) == (1, 2, 0)
    assert scores.duplicates == 1


def test_second_detection_beside_both_a_found_object_and_a_wall_is_the_walls():
    scores = score(found_in(1, (0, 2.0), (0, 2.15)), capture_of(post(2), post(2.3, structure=True), frames=1), "object")
    assert counts(scores) == (1, 0, 0)
    assert (scores.structure, scores.duplicates) == (1, 0)


# ---- truth that is not exhaustive


def test_unmatched_detections_prove_nothing_where_truth_is_not_exhaustive():
    capture = capture_of(post(2), post(4), frames=2, exhaustive=False)
    found = found_in(2, (0, 2.1), (0, 3.0), (1, 3.0))
    scores = score(found, capture, "object")
    assert counts(scores) == (1, 0, 3)
    assert (scores.unmatched, scores.retained) == (2, 3)
    assert math.isnan(scores.precision)
    assert math.isnan(scores.f1)
    assert math.isnan(scores.false_alarms_per_minute)
    assert scores.recall == 0.25
    assert scores.mae_m == scores.matched_mae_m == pytest.approx(0.1)


def test_frame_whose_peak_matches_nothing_is_missed_where_truth_is_not_exhaustive():
    scores = score(found_in(2, (0, 2.1), (1, 3.0)), capture_of(post(2), frames=2, exhaustive=False))
    assert counts(scores) == (1, 0, 1)
    assert scores.unmatched == 1


def test_one_labelled_object_is_enough_where_truth_is_not_exhaustive():
    outline = np.array([[[2.0, 0.0]], [[np.nan, np.nan]]])
    objects = (Obstacle("walker", "person", outline), post(4))
    assert score(found_in(2), capture_of(*objects, frames=2, exhaustive=False), "object").fn == 3
    assert score(found_in(2), capture_of(*objects, frames=2), "object").fn == 2
    assert score(found_in(2), capture_of(objects[0], frames=2, exhaustive=False)).frames == 1


@pytest.mark.parametrize("scoring", ["frame", "object"])
def test_chance_recall_is_what_random_ranges_reach(scoring):
    # Overlapping gates, one cut by the far border; three random ranges a frame, or their strongest alone.
    frames, region = 20_000, Region(1.0, 5.0)
    capture = capture_of(post(2), post(2.2), post(4.9), frames=frames, exhaustive=False)
    rng = np.random.default_rng(0)
    range_m = rng.uniform(1, 5, 3 * frames)
    amplitude = rng.random(3 * frames)
    found = Detections(np.repeat(np.arange(frames), 3), range_m=range_m, amplitude=amplitude)
    scores = score(found, capture, scoring, region=region)
    if scoring == "frame":
        assert scores.recall == pytest.approx(scores.chance_recall, abs=0.01)
        assert scores.chance_recall == pytest.approx((0.6 + 0.3) / 4)
    else:
        near = np.abs(range_m.reshape(-1, 3, 1) - [2, 2.2, 4.9]) <= GATE_M
        assert scores.chance_recall == pytest.approx(near.any(axis=1).mean(), abs=0.01)
        assert scores.recall <= scores.chance_recall


# ---- results


def test_tables_are_reached_by_name_and_numbers_of_filtering_directly():
    scores = score(found_in(1, (0, 2.0)), capture_of(post(2), frames=1))
    assert scores["filtering"] is scores.filtering
    assert scores["mapping"] is scores.mapping is None
    assert scores.f1 == scores.filtering.f1 == 1
    with pytest.raises(KeyError, match="Did you mean 'mapping'"):
        scores["maping"]
    with pytest.raises(AttributeError, match="no 'f2'"):
        scores.f2  # noqa: B018


def test_scores_travel_between_processes():
    scores = score(found_in(1, (0, 2.0)), capture_of(post(2), frames=1))
    assert pickle.loads(pickle.dumps(scores)).f1 == 1  # noqa: S301


def test_undefined_numbers_are_null_in_json():
    block = json.loads(json.dumps(score(found_in(1), capture_of(frames=1)).to_dict(), allow_nan=False))["filtering"]
    assert block["precision"] is None
    first = ["precision", "recall", "f1", "mae_m", "p90_m", "p95_m", "sd_m", "tp", "fp", "fn", "retained"]
    assert list(block)[: len(first)] == first


def test_mapping_exists_only_for_clustered_positions_and_counts_clusters_only():
    capture = capture_of(post(2), frames=2)
    columns = {"x_m": [2.1, 2.0], "y_m": [0.0, 0.0]}
    found = found_in(2, (0, 2.1), (1, 2.0), **columns)
    assert score(found, capture).mapping is None
    mapped = score(found.with_columns(cluster=[0, -1]), capture).mapping
    assert (mapped.tp, mapped.fn, mapped.retained) == (1, 1, 1)
    assert set(outcomes(found, capture, ScoringRules())) == {"filtering"}
    assert set(outcomes(found.with_columns(cluster=[0, -1]), capture, ScoringRules())) == {"filtering", "mapping"}


def test_resampling_groups_last_a_second_or_more_and_are_the_same_for_all_detectors():
    capture = capture_of(post(2), frames=37)  # 3.6 s: three blocks
    everything = outcomes(found_in(37), capture, ScoringRules())["filtering"]
    times_s = capture.trajectory.timestamp_s
    assert everything.group[-1] == 2
    for block in range(3):
        inside = times_s[everything.group == block]
        assert inside[-1] - inside[0] + 1 / RATE_HZ >= 1.0
    late = outcomes(Detections.empty(np.arange(20, 37)), capture, ScoringRules())["filtering"]
    np.testing.assert_array_equal(late.group, everything.group[20:])
    assert len(np.unique(everything.group)) == 3


# ---- what bad input gets


def test_capture_without_truth_cannot_be_scored():
    capture = capture_of(post(2))
    bare = CaptureHeader(name="bare", radar=capture.radar, trajectory=capture.trajectory)
    with pytest.raises(ScoringError, match="'bare' has no ground truth"):
        score(found_in(4), bare)


@pytest.mark.parametrize("frame", [-1, 4])
def test_detections_of_another_capture_are_refused(frame):
    with pytest.raises(ScoringError, match=rf"name frame {frame}, but capture 'scene' has 4 frames"):
        score(Detections([frame], range_m=[2.0]), capture_of(post(2)))


def test_detections_without_a_range_column_are_refused():
    with pytest.raises(ScoringError, match="no range_m; add the stage 'range'"):
        score(Detections([0], delay_s=[1e-9]), capture_of(post(2)))


def test_peak_scoring_without_candidates_says_how_to_get_them():
    with pytest.raises(ScoringError, match="candidates=True"):
        score(found_in(4), capture_of(post(2)), "peak")


def test_peak_scoring_needs_the_ranges_of_the_candidates():
    found = found_in(4).annotated(candidates=Detections([0], tap=[3.0]))
    with pytest.raises(ScoringError, match="before the filters have no range_m"):
        score(found, capture_of(post(2)), "peak")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scoring": "frames"}, "no scoring 'frames'. Did you mean 'frame'"),
        ({"gate_m": 0.0}, "gate_m must be positive"),
        ({"gate_m": math.nan}, "gate_m must be positive"),
        ({"strongest": 0}, "strongest must be at least 1"),
    ],
)
def test_rules_that_make_no_sense_are_refused(arguments, message):
    with pytest.raises(ScoringError, match=message):
        ScoringRules(**arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"min_range_m": -0.1}, "min_range_m must be at least 0"),
        ({"min_range_m": math.nan}, "min_range_m must be at least 0"),
        ({"max_range_m": 0.5}, "max_range_m 0.5 must exceed"),
        ({"half_angle_rad": 0.0}, "half_angle_rad must lie in"),
    ],
)
def test_regions_that_hold_nothing_are_refused(arguments, message):
    with pytest.raises(ScoringError, match=message):
        Region(**arguments)


def test_region_beyond_the_radars_window_is_refused():
    with pytest.raises(ScoringError, match="window ends at 10 m"):
        score(found_in(4), capture_of(post(2)), region=Region(min_range_m=11))
