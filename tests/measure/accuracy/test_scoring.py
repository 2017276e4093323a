"""Scoring of detections against the truth of a capture."""

import json
import math
import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api import SPEED_OF_LIGHT_M_S, Detections, Obstacle, Radar, ScoringError, Trajectory, Truth
from uwbbench.api.capture import CaptureHeader
from uwbbench.measure.accuracy.matching import match
from uwbbench.measure.accuracy.metrics.detection import Precision, Recall
from uwbbench.measure.accuracy.metrics.error import MeanAbsoluteError, StandardDeviation
from uwbbench.measure.accuracy.scoring import SCORINGS, Region, ScoringRules, outcomes, score
from uwbbench.measure.accuracy.stats import bootstrap, evaluate

GOLDEN = json.loads((Path(__file__).parent / "golden" / "plate_post_wall.json").read_text())
WINDOW_M, RATE_HZ, GATE_M = 10.0, 10.0, 0.2


def capture_of(*objects, frames=4, exhaustive=True, has_sts=False, position_m=None, yaw_rad=None):
    """Capture of a receiver at the origin that looks along +x, unless it is told to move."""
    radar = Radar(
        model="test",
        center_frequency_hz=8e9,
        bandwidth_hz=5e8,
        sample_interval_s=2 * WINDOW_M / 100 / SPEED_OF_LIGHT_M_S,
        frame_rate_hz=RATE_HZ,
        taps=100,
        has_sts=has_sts,
    )
    position_m = np.zeros((frames, 3)) if position_m is None else np.asarray(position_m, float)
    yaw_rad = np.zeros(frames) if yaw_rad is None else np.asarray(yaw_rad, float)
    trajectory = Trajectory(np.arange(frames) / RATE_HZ, position_m, yaw_rad)
    return CaptureHeader(name="scene", radar=radar, trajectory=trajectory, truth=Truth(objects, exhaustive))


def post(x, y=0.0, *, structure=False):
    return Obstacle(f"post {x} {y}", "metal", np.array([[x, y]], float), structure)


def found_in(frames, *rows, amplitude=None, **columns):
    """Detections given as (frame, range_m) in a capture of so many processed frames."""
    frame, range_m = np.array(rows, float).reshape(-1, 2).T
    if amplitude is not None:
        columns["amplitude"] = amplitude
    return Detections(frame, range_m=range_m, processed=np.arange(frames), **columns)


def at_once(found):
    """The same detections, each frame answered after its own step."""
    return found.with_hand_outs(found.frame, found.processed)


def counts(scores):
    block = scores.filtering
    return block.tp, block.fp, block.fn


# ---- golden scene


def golden_detections():
    frame, range_m, azimuth_deg, amplitude, cluster = np.transpose(GOLDEN["scene"]["detections"])
    more = np.transpose([*GOLDEN["scene"]["detections"], *GOLDEN["scene"]["further_candidates"]])

    def placed(frame, range_m, azimuth_deg, amplitude, cluster, **facts):
        azimuth_rad = np.radians(azimuth_deg)
        return Detections(
            frame,
            range_m=range_m,
            azimuth_rad=azimuth_rad,
            amplitude=amplitude,
            x_m=range_m * np.cos(azimuth_rad),
            y_m=range_m * np.sin(azimuth_rad),
            cluster=cluster,
            processed=np.arange(6),
            **facts,
        )

    return at_once(placed(frame, range_m, azimuth_deg, amplitude, cluster, candidates=placed(*more)))


@pytest.mark.parametrize("scoring", SCORINGS)
def test_scores_of_the_golden_scene_are_those_found_by_hand(scoring):
    scene = GOLDEN["scene"]
    capture = capture_of(
        Obstacle("plate", "metal", np.array(scene["plate"])),
        Obstacle("post", "metal", np.array(scene["post"])),
        Obstacle("wall", "concrete", np.array(scene["wall"]), structure=True),
        frames=6,
    )
    scores = score(golden_detections(), capture, scoring, gate_m=GATE_M).to_dict()
    for table, expected in GOLDEN["expected"]["frame" if scoring == "latest" else scoring].items():
        assert list(scores[table]) == list(expected)
        assert scores[table] == pytest.approx(expected, abs=1e-7), table


# ---- identities on random scenes


@st.composite
def scenes(draw, exhaustive=None):
    """A moving receiver, posts, perhaps a wall, and detections of which some were retained."""
    frames = draw(st.integers(0, 6))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    objects = [
        Obstacle(str(number), "metal", rng.uniform([0.3, -1], [4, 1], (1, 2)), structure=bool(rng.random() < 0.2))
        for number in range(draw(st.integers(0, 3)))
    ]
    if draw(st.booleans()):
        outline = rng.uniform(-1, 4, (frames, 3, 2))
        outline[rng.random(frames) < 0.2] = np.nan
        objects.append(Obstacle("moving", "metal", outline))
    position_m = np.c_[np.linspace(0, 0.5, frames), np.zeros((frames, 2))]
    complete = draw(st.booleans()) if exhaustive is None else exhaustive
    capture = capture_of(*objects, frames=frames, exhaustive=complete, position_m=position_m)
    count = int(rng.integers(0, 5 * frames + 1))
    frame = rng.integers(0, frames, count) if frames else np.empty(0, int)
    truth_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m
    range_m = rng.uniform(0, 6, count)
    if truth_m.shape[1]:
        near = rng.random(count) < 0.6
        chosen = truth_m[frame, rng.integers(0, truth_m.shape[1], count)] + rng.normal(0, 0.15, count)
        range_m = np.where(near, chosen, range_m)
    azimuth_rad = rng.normal(0, 0.2, count)
    candidates = Detections(
        frame,
        range_m=range_m,
        amplitude=rng.integers(0, 3, count),
        x_m=position_m[frame, 0] + range_m * np.cos(azimuth_rad),
        y_m=range_m * np.sin(azimuth_rad),
        cluster=rng.integers(-1, 2, count),
        processed=np.flatnonzero(rng.random(frames) < 0.9),
    )
    kept = candidates.take(np.isin(frame, candidates.processed) & (rng.random(count) < 0.5))
    return at_once(kept).annotated(candidates=candidates), capture


@settings(max_examples=120, deadline=None)
@given(scenes(), st.sampled_from(SCORINGS), st.sampled_from([None, 1, 2]))
def test_every_retained_detection_is_counted_once(scene, scoring, strongest):
    found, capture = scene
    scores = score(found, capture, scoring, strongest=strongest)
    for block in (scores.filtering, scores.mapping):
        assert block.tp + block.fp + block.structure + block.unmatched == block.retained
        if scoring != "object":
            assert block.structure == block.duplicates == 0
        if block.exhaustive:
            assert block.unmatched == 0
        else:
            assert block.fp == 0
            assert math.isnan(block.precision)
        for number in (block.precision, block.recall, block.f1, block.chance_recall):
            assert math.isnan(number) or 0 <= number <= 1


@settings(max_examples=120, deadline=None)
@given(scenes(), st.sampled_from([None, 1, 2]))
def test_recall_of_peaks_is_never_below_that_of_frames(scene, strongest):
    found, capture = scene
    by_frame = score(found, capture, "frame", strongest=strongest)
    by_peak = score(found, capture, "peak", strongest=strongest)
    for table in ("filtering", "mapping"):
        if not math.isnan(by_frame[table].recall) and not math.isnan(by_peak[table].recall):
            assert by_peak[table].recall >= by_frame[table].recall


@settings(max_examples=60, deadline=None)
@given(scenes(), st.sampled_from(SCORINGS), st.data())
def test_two_halves_of_a_capture_merge_to_the_whole(scene, scoring, data):
    found, capture = scene
    frames = len(capture)
    cut = data.draw(st.integers(0, frames))

    def half(start, stop):
        track = capture.trajectory
        moved = [
            Obstacle(one.name, one.material, one.outline_m[start:stop] if one.moves else one.outline_m, one.structure)
            for one in capture.truth.objects
        ]
        part = capture_of(
            *moved,
            frames=stop - start,
            exhaustive=capture.truth.exhaustive,
            position_m=track.position_m[start:stop],
        )

        def shifted(table):
            rows = table.take((table.frame >= start) & (table.frame < stop))
            seen = table.processed[(table.processed >= start) & (table.processed < stop)] - start
            columns = {name: values for name, values in rows.columns.items() if name != "frame"}
            return Detections(rows.frame - start, processed=seen, **columns)

        return at_once(shifted(found)).annotated(candidates=shifted(found.candidates)), part

    rules = ScoringRules(scoring)
    whole = outcomes(found, capture, rules)
    parts = [outcomes(*half(0, cut), rules), outcomes(*half(cut, frames), rules)]
    for table, outcome in whole.items():
        for name in ("tp", "fp", "fn", "error_m", "matched"):
            joined = np.concatenate([getattr(part[table], name) for part in parts])
            np.testing.assert_array_equal(joined, getattr(outcome, name), err_msg=name)
        assert sum(part[table].duration_s for part in parts) == pytest.approx(outcome.duration_s)
        for metric in (Precision, Recall, MeanAbsoluteError, StandardDeviation):
            merged = evaluate(metric, [part[table] for part in parts])
            assert merged == pytest.approx(evaluate(metric, [outcome]), nan_ok=True)


@settings(max_examples=60, deadline=None)
@given(scenes(exhaustive=True))
def test_object_scoring_finds_as_many_pairs_as_matching_each_frame_alone(scene):
    found, capture = scene
    sight = capture.truth.seen_from(capture.radar, capture.trajectory)
    region = Region()
    obstacle = np.array([not one.structure for one in capture.truth.objects], bool)
    pairs = visible_count = 0
    for frame in range(len(capture)):
        range_m, azimuth_rad = sight.range_m[frame], sight.azimuth_rad[frame]
        if frame not in found.processed or np.isnan(range_m).any():
            continue
        visible = (range_m >= region.min_range_m) & (range_m <= WINDOW_M) & ~sight.occluded[frame] & obstacle
        visible &= np.abs(azimuth_rad) <= np.pi / 2
        visible_count += visible.sum()
        rows = found.range_m[found.frame == frame]
        pairs += len(match(np.abs(rows[:, None] - range_m[visible]), GATE_M)[0])
    block = score(found, capture, "object").filtering
    assert (block.tp, block.fn) == (pairs, visible_count - pairs)


@pytest.mark.parametrize("scoring", SCORINGS)
def test_a_detector_that_knows_the_truth_scores_one_with_no_error(scoring):
    objects = (post(2), post(4, 1), post(5, -2, structure=True))
    capture = capture_of(*objects, frames=100)
    sight = capture.truth.seen_from(capture.radar, capture.trajectory)
    frame = np.repeat(np.arange(100), 2)
    oracle = Detections(
        frame,
        range_m=sight.range_m[:, :2].ravel(),
        x_m=np.tile([2.0, 4.0], 100),
        y_m=np.tile([0.0, 1.0], 100),
        cluster=np.zeros(200, int),
    )
    scores = score(at_once(oracle).annotated(candidates=oracle), capture, scoring)
    for block in (scores.filtering, scores.mapping):
        assert (block.precision, block.recall, block.f1) == (1, 1, 1)
        errors_m = (block.mae_m, block.p90_m, block.p95_m, block.sd_m, block.bias_m, block.matched_p90_m)
        assert errors_m == pytest.approx((0,) * 6, abs=1e-12)
        assert block.false_alarms_per_minute == 0


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


@pytest.mark.parametrize("scoring", SCORINGS)
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
    assert bootstrap(Recall, [everything]).groups == 3


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
