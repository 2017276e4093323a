"""Scoring of tracks: what is matched with what, and what identity, delay and false tracks are."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.measure.accuracy.scenes import RATE_HZ, capture_of, found_in, post
from uwbbench.api import ScoringError
from uwbbench.measure.accuracy.groups import blocks_of
from uwbbench.measure.accuracy.metrics.detection import F1
from uwbbench.measure.accuracy.metrics.error import Bias
from uwbbench.measure.accuracy.metrics.track import TRACK_METRICS
from uwbbench.measure.accuracy.scoring import ScoringRules, outcomes, score
from uwbbench.measure.accuracy.set_distances import gospa, ospa
from uwbbench.measure.accuracy.stats import evaluate

C = 0.5


def tracked(frames, *rows, **columns):
    """Rows given as (frame, range_m, track)."""
    return found_in(frames, *(row[:2] for row in rows), track=[row[2] for row in rows], **columns)


def scored(found, *objects, frames=4, **facts):
    return score(found, capture_of(*objects, frames=frames, **facts), "track", C)


def test_a_track_that_starts_late_and_changes_its_number_is_counted_as_worked_out_by_hand():
    scores = scored(tracked(4, (1, 2.1, 0), (2, 2.1, 0), (3, 2.1, 1)), post(2))
    assert (scores.tp, scores.fp, scores.fn) == (3, 0, 1)
    assert scores.gospa_m == pytest.approx(math.sqrt((3 * 0.01 + C**2 / 2) / 4))
    assert scores.gospa_localisation_m**2 + scores.gospa_missed_m**2 == pytest.approx(scores.gospa_m**2)
    assert scores.gospa_false_m == 0
    assert scores.ospa_m == pytest.approx((3 * 0.1 + C) / 4)
    assert scores.ospa_2_m == pytest.approx(math.sqrt((3 * 0.01 + C**2) / 4))
    assert scores.track_rmse_m == pytest.approx(0.1)
    assert scores.track_unbiased_rmse_m == pytest.approx(0, abs=1e-12)
    assert scores.bias_m == pytest.approx(0.1)
    assert (scores.identity_switches, scores.fragmentations) == (1, 0)
    assert scores.confirmation_delay == pytest.approx(1 / RATE_HZ)
    assert scores.false_tracks_per_minute == 0


def test_a_perfect_track_is_at_no_distance():
    scores = scored(tracked(3, (0, 2, 5), (1, 2, 5), (2, 2, 5)), post(2), frames=3)
    assert (scores.gospa_m, scores.ospa_m, scores.track_rmse_m) == (0, 0, 0)
    assert (scores.identity_switches, scores.fragmentations, scores.confirmation_delay) == (0, 0, 0)


def test_rows_of_no_confirmed_track_are_not_looked_at():
    scores = scored(tracked(2, (0, 2, -1), (1, 2, 0), (1, 6, -1)), post(2), frames=2)
    assert (scores.tp, scores.fp, scores.fn) == (1, 0, 1)


def test_an_object_that_is_lost_and_followed_again_is_one_fragmentation_and_no_switch():
    scores = scored(tracked(5, (0, 2, 3), (1, 2, 3), (4, 2, 3)), post(2), frames=5)
    assert (scores.fragmentations, scores.identity_switches) == (1, 0)


def test_an_object_that_was_out_of_view_was_not_lost():
    turned = scored(tracked(4, (0, 2, 3), (3, 2, 3)), post(2), yaw_rad=[0, math.pi, math.pi, 0])
    assert (turned.fragmentations, turned.fn) == (0, 0)


def test_another_track_that_noise_brings_nearer_for_a_frame_takes_nothing_over():
    rows = [(frame, 2.1, 1) for frame in range(4)] + [(1, 2.2, 2), (2, 2.0, 2), (3, 2.2, 2)]
    scores = scored(tracked(4, *sorted(rows)), post(2))
    assert scores.identity_switches == 0
    assert (scores.tp, scores.fp) == (4, 3)


def test_two_tracks_that_change_objects_are_two_switches():
    rows = [(0, 2.0, 1), (0, 4.0, 2), (1, 2.0, 2), (1, 4.0, 1)]
    assert scored(tracked(2, *rows), post(2), post(4), frames=2).identity_switches == 2 / 2


def test_a_near_pair_is_not_given_up_so_that_two_bad_ones_are_made():
    found = tracked(1, (0, 2.0, 1), (0, 2.45, 2))
    scores = scored(found, post(2.0), post(1.56), frames=1)  # object scoring would pair 2.45 with 2, and 2.0 with 1.56
    assert score(found, capture_of(post(2.0), post(1.56), frames=1), "object", C).tp == 2
    assert scores.tp == 1
    assert scores.gospa_m == pytest.approx(gospa([2.0, 1.56], [2.0, 2.45], C).value)


def test_a_track_of_a_wall_is_neither_true_nor_false():
    scores = scored(tracked(2, (0, 3, 0), (1, 3, 0)), post(3, structure=True), frames=2)
    assert (scores.tp, scores.fp, scores.structure) == (0, 0, 2)
    assert scores.gospa_m == scores.false_tracks_per_minute == 0


def test_a_track_is_false_that_is_near_nothing_for_more_than_half_of_its_life():
    half = [(0, 2, 0), (1, 2, 0), (2, 5, 0), (3, 5, 0)]
    assert scored(tracked(4, *half), post(2)).false_tracks_per_minute == 0
    more = [(0, 2, 0), (1, 5, 0), (2, 5, 0)]
    assert scored(tracked(4, *more), post(2)).false_tracks_per_minute == 60 * RATE_HZ / 4


def test_objects_that_no_track_ever_follows_have_no_delay():
    scores = scored(tracked(4, (2, 2, 0)), post(2), post(4))
    assert scores.confirmation_delay == pytest.approx(2 / RATE_HZ)
    assert math.isnan(scored(tracked(4), post(2)).confirmation_delay)


def test_open_truth_proves_no_track_false():
    scores = scored(tracked(2, (0, 2, 0), (1, 5, 1)), post(2), frames=2, exhaustive=False)
    assert math.isnan(scores.gospa_m)
    assert math.isnan(scores.ospa_m)
    assert math.isnan(scores.false_tracks_per_minute)
    assert (scores.recall, scores.track_rmse_m, scores.unmatched) == (0.5, 0, 1)


def test_detections_without_tracks_are_refused_with_the_scorings_that_fit():
    with pytest.raises(ScoringError, match=r"no column 'track'.*stage that makes tracks.*'frame', 'peak', 'object'"):
        scored(found_in(1, (0, 2.0)), post(2), frames=1)


def test_tracks_with_positions_are_scored_by_these_too_without_clusters():
    found = tracked(2, (0, 2, 0), (1, 2, 0), x_m=[2.0, 2.0], y_m=[0.3, 0.3])
    scores = scored(found, post(2), frames=2)
    assert scores.mapping.gospa_m == pytest.approx(0.3)
    assert scores.filtering.gospa_m == 0


FRAMES = 60
rows = st.lists(
    st.tuples(st.integers(0, FRAMES - 1), st.floats(1.0, 4.0), st.integers(-1, 4)),
    max_size=40,
    unique_by=lambda r: (r[0], r[2]),
)


@settings(deadline=None, max_examples=50)
@given(rows)
def test_each_frame_is_at_the_distances_of_its_sets(rows):
    objects = (post(2.0), post(2.3), post(3.5))
    found = tracked(FRAMES, *sorted(rows))
    outcome = outcomes(found, capture_of(*objects, frames=FRAMES), ScoringRules("track", C))["filtering"]
    truth = [2.0, 2.3, 3.5]
    confirmed = [[r for f, r, t in rows if f == frame and t >= 0] for frame in range(FRAMES)]
    square = outcome.localisation_m2 + C**2 / 2 * (outcome.fn + outcome.fp)
    np.testing.assert_allclose(square, [gospa(truth, one, C).value ** 2 for one in confirmed], atol=1e-12)
    np.testing.assert_allclose(outcome.ospa_m, [ospa(truth, one, C) for one in confirmed], atol=1e-12)
    np.testing.assert_allclose(outcome.ospa_2_m2, [ospa(truth, one, C, 2.0) ** 2 for one in confirmed], atol=1e-12)


@settings(deadline=None, max_examples=50)
@given(rows)
def test_blocks_of_a_capture_add_up_to_the_whole(rows):
    capture = capture_of(post(2.0), post(2.3), post(3.5), frames=FRAMES)
    outcome = outcomes(tracked(FRAMES, *sorted(rows)), capture, ScoringRules("track", C))["filtering"]
    (blocks,) = blocks_of([outcome])
    for name, metric in {**TRACK_METRICS, "f1": F1, "bias": Bias}.items():
        whole, parts = evaluate(metric, [outcome]), evaluate(metric, blocks)
        assert parts == pytest.approx(whole, nan_ok=True), name
    assert sum(block.duration_s for block in blocks) == pytest.approx(outcome.duration_s)
