"""Segments against what is there: the scoring ``segment``."""

import numpy as np
import pytest

from tests.measure.accuracy.scenes import capture_of, post
from uwbbench.api import Detections, ScoringError
from uwbbench.measure.accuracy.causes import causes
from uwbbench.measure.accuracy.judge import judge
from uwbbench.measure.accuracy.rules import ScoringRules
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.scoring import score

GATE_M = 0.2


def segments(*rows, frames=1):
    """Detections of rows (frame, start, crest, stop), in metres."""
    frame, start_m, range_m, stop_m = np.array(rows, float).reshape(-1, 4).T
    columns = {"range_start_m": start_m, "range_m": range_m, "range_stop_m": stop_m, "amplitude": np.ones(len(frame))}
    return Detections(frame.astype(int), processed=np.arange(frames), **columns)


def scored(found, *objects, frames=1, **rules):
    return score(found, capture_of(*objects, frames=frames), "segment", GATE_M, **rules).filtering


def counts(block):
    return block.tp, block.fp, block.fn


def test_a_segment_around_its_obstacle_is_true_however_far_its_crest_is():
    block = scored(segments((0, 1.5, 1.6, 3.0)), post(2.8))
    assert counts(block) == (1, 0, 0)
    assert block.bias_m == pytest.approx(1.6 - 2.8)


@pytest.mark.parametrize(("start_m", "true"), [(3.0, True), (3.2, True), (3.25, False)])
def test_a_segment_is_widened_by_the_gate(start_m, true):
    found = segments((0, start_m, start_m + 0.1, start_m + 0.3))
    assert counts(scored(found, post(3.0))) == ((1, 0, 0) if true else (0, 1, 1))


def test_one_segment_over_two_obstacles_finds_one_of_them():
    assert counts(scored(segments((0, 1.5, 2.0, 4.5)), post(2), post(4))) == (1, 0, 1)


def test_two_segments_on_one_obstacle_are_a_match_and_a_duplicate():
    block = scored(segments((0, 1.8, 2.0, 2.2), (0, 1.9, 2.1, 2.3)), post(2))
    assert (counts(block), block.duplicates) == ((1, 1, 0), 1)


def test_as_many_pairs_as_possible_come_first():
    # The long one could have either, the short one the nearer obstacle alone.
    block = scored(segments((0, 1.5, 2.0, 4.5), (0, 1.9, 2.05, 2.1)), post(2), post(4))
    assert counts(block) == (2, 0, 0)


def test_a_segment_on_a_wall_is_set_aside():
    block = scored(segments((0, 1.8, 2.0, 2.2), (0, 4.9, 5.0, 5.1)), post(2), post(5, structure=True))
    assert (counts(block), block.structure) == ((1, 0, 0), 1)


def test_segments_beyond_the_region_are_ignored():
    assert counts(scored(segments((0, 0.1, 0.2, 0.3)), post(2))) == (0, 0, 1)


def test_the_crest_of_a_segment_that_names_none_is_its_middle():
    block = scored(segments((0, 1.9, np.nan, 2.1)), post(2))
    assert counts(block) == (1, 0, 0)
    assert np.isfinite(block.mae_m)


def test_overlap_is_what_is_shared_over_what_is_covered():
    capture = capture_of(post(2), frames=2)
    [range_m] = np.unique(capture.truth.seen_from(capture.radar, capture.trajectory).range_m)
    exact = segments((0, range_m - GATE_M, range_m, range_m + GATE_M), frames=1)
    assert score(exact, capture, "segment", GATE_M).segment_overlap == pytest.approx(1.0)
    half = segments((0, range_m, range_m, range_m + GATE_M), (1, range_m, range_m, range_m + 3 * GATE_M), frames=2)
    assert score(half, capture, "segment", GATE_M).segment_overlap == pytest.approx((0.2 + 0.2) / (0.4 + 0.8))


def test_segments_on_each_other_cover_their_length_once():
    capture = capture_of(post(2), frames=1)
    one = segments((0, 1.5, 2.0, 2.5))
    two = segments((0, 1.5, 2.0, 2.3), (0, 1.8, 2.0, 2.5))
    overlaps = [score(found, capture, "segment", GATE_M).segment_overlap for found in (one, two)]
    assert overlaps[0] == pytest.approx(overlaps[1])


def test_detections_that_are_no_segments_are_refused():
    with pytest.raises(ScoringError, match="no range_start_m and range_stop_m"):
        scored(Detections([0], range_m=[2.0]), post(2))


def test_a_detector_that_finds_nothing_misses_all():
    assert counts(scored(Detections.empty([0]), post(2))) == (0, 0, 1)


def test_causes_of_segments_add_up():
    rng = np.random.default_rng(3)
    frames = 60
    start_m = rng.uniform(0.5, 6, frames)
    rows = np.stack([np.arange(frames), start_m, start_m + 0.1, start_m + rng.uniform(0.2, 1, frames)], axis=1)
    found = segments(*rows[::2], *rows[::3], frames=frames)
    capture = capture_of(post(2), post(4, 1), post(5, -2, structure=True), frames=frames)
    scene, rules = Scene.of(found, capture), ScoringRules("segment")
    made, outcome = causes(found, scene, rules, "filtering"), judge(found, scene, rules, "filtering").outcome
    assert sum(made.misses.values()) == outcome.fn.sum() > 0
    assert sum(made.false.values()) == outcome.fp.sum() > 0
