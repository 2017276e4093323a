"""Scoring of detections against the truth of a capture: a scene worked out by hand, and what holds in every scene."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.measure.accuracy.scenes import GATE_M, OF_DETECTIONS, WINDOW_M, at_once, capture_of, post
from uwbbench.api import Detections, Obstacle
from uwbbench.measure.accuracy.matching import match
from uwbbench.measure.accuracy.metrics.detection import Precision, Recall
from uwbbench.measure.accuracy.metrics.error import MeanAbsoluteError, StandardDeviation
from uwbbench.measure.accuracy.scoring import Region, ScoringRules, outcomes, score
from uwbbench.measure.accuracy.stats import evaluate

GOLDEN = json.loads((Path(__file__).parent / "golden" / "plate_post_wall.json").read_text())


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


@pytest.mark.parametrize("scoring", OF_DETECTIONS)
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
@given(scenes(), st.sampled_from(OF_DETECTIONS), st.sampled_from([None, 1, 2]))
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
@given(scenes(), st.sampled_from(OF_DETECTIONS), st.data())
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


@pytest.mark.parametrize("scoring", OF_DETECTIONS)
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
