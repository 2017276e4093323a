"""Curves of several captures together."""

import math

import numpy as np
import pytest

from uwbbench.measure.accuracy import intervals
from uwbbench.measure.accuracy.ranked import RankedCounts, pooled
from uwbbench.results.ranked_curves import MOST_POINTS, ranked_curve


def counts_of(rng, steps=40, there=60, order="score_db", **changes):
    score = np.sort(rng.choice(400, steps, replace=False) / 8)[::-1]
    tp = (rng.random(steps) < 0.5).astype(np.int64)
    values = {"there": there, "duration_s": 30.0, "order": order, "set_tp": 15, "set_fp": 4}
    return RankedCounts(score, tp, 1 - tp, **{**values, **changes})


def apart(counts):
    """Counts of captures, each of a scene of its own."""
    return [(one, number) for number, one in enumerate(counts)]


@pytest.fixture
def parts():
    rng = np.random.default_rng(3)
    return [counts_of(rng) for _ in range(14)]


def test_points_are_the_pooled_counts_at_their_thresholds(parts):
    curve, whole = ranked_curve(apart(parts), 0.95), pooled(parts)
    assert len(curve.score) <= MOST_POINTS + 2
    rows = np.searchsorted(-whole.score, -curve.score)
    np.testing.assert_allclose(curve.recall.value, whole.recall[rows])
    np.testing.assert_allclose(curve.precision.value, whole.precision[rows])
    np.testing.assert_allclose(curve.false_alarms_per_minute.value, whole.false_alarms_per_minute[rows])
    assert (curve.score[0], curve.score[-1]) == (whole.score[0], whole.score[-1])
    assert float(curve.average_precision.value) == whole.average_precision


def test_recall_at_few_false_alarms_is_that_of_all_thresholds(parts):
    whole = pooled(parts)
    allowed = np.cumsum(whole.fp) <= 10 * whole.duration_s / 60
    assert ranked_curve(apart(parts), 0.95).few_alarms_recall == np.cumsum(whole.tp)[allowed].max() / whole.there


def test_intervals_are_those_of_shares_over_captures(parts):
    curve = ranked_curve(apart(parts), 0.95)
    tp = [int(part.tp[part.score >= curve.score[-1]].sum()) for part in parts]
    expected = intervals.share(tp, [part.there for part in parts])
    assert (curve.recall.low[-1], curve.recall.high[-1]) == (expected.low, expected.high)
    assert float(curve.setting["recall"].value) == 15 / 60
    assert curve.average_precision.low < curve.average_precision.value < curve.average_precision.high


def test_captures_of_one_scene_are_one_piece_of_evidence(parts):
    repeated = ranked_curve([(one, number // 2) for number, one in enumerate([*parts, *parts])], 0.95)
    scenes = [pooled(parts[at : at + 2]) for at in range(0, len(parts), 2)] * 2
    expected = ranked_curve(apart(scenes), 0.95)
    assert (repeated.captures, repeated.scenes) == (2 * len(parts), len(parts))
    np.testing.assert_array_equal(repeated.recall.low, expected.recall.low)


def test_average_precision_has_no_interval_from_few_captures(parts):
    assert math.isnan(ranked_curve(apart(parts[:3]), 0.95).average_precision.low)
    assert math.isnan(ranked_curve(apart(parts[:1]), 0.95).average_precision.low)


def test_candidates_that_were_ordered_by_different_columns_are_not_put_together(parts):
    other = counts_of(np.random.default_rng(1), order="prominence")
    assert ranked_curve(apart([*parts, other]), 0.95) is None
    assert ranked_curve([], 0.95) is None


def test_without_exhaustive_truth_recall_alone_is_defined():
    curve = ranked_curve(apart([counts_of(np.random.default_rng(1), exhaustive=False)]), 0.95)
    assert np.isfinite(curve.recall.value).all()
    assert np.isnan(curve.precision.value).all()
    assert np.isnan(curve.false_alarms_per_minute.value).all()
    assert math.isnan(curve.average_precision.value)


def test_a_detector_without_candidates_has_an_empty_curve():
    nothing = RankedCounts(np.empty(0), np.empty(0, np.int64), np.empty(0, np.int64), 60, 30.0, "", 0, 0)
    curve = ranked_curve(apart([nothing, nothing]), 0.95)
    assert len(curve.score) == 0
    assert float(curve.average_precision.value) == 0.0
    assert float(curve.setting["recall"].value) == 0.0
