"""Precision, recall, F1 and false alarms."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.metrics import f1_score, precision_score, recall_score

from uwbbench.api.metric import Outcome
from uwbbench.measure.accuracy.metrics.detection import F1, FalseAlarmsPerMinute, Precision, Recall
from uwbbench.measure.accuracy.stats import evaluate, merge


def counted(tp, fp, fn, duration_s=60.0, exhaustive=True):
    """Outcome of frames with these counts."""
    return Outcome(
        group=np.zeros(len(tp), int),
        tp=np.array(tp, int),
        fp=np.array(fp, int),
        fn=np.array(fn, int),
        error_frame=np.empty(0, int),
        error_m=np.empty(0),
        matched=np.empty(0, bool),
        duration_s=duration_s,
        exhaustive=exhaustive,
    )


def values(outcome):
    return tuple(evaluate(metric, [outcome]) for metric in (Precision, Recall, F1))


@pytest.mark.parametrize(
    ("tp", "fp", "fn", "expected"),
    [
        (0, 0, 0, (math.nan, math.nan, math.nan)),  # no truth, no output
        (0, 2, 0, (0.0, math.nan, 0.0)),  # no truth, some output
        (0, 0, 3, (math.nan, 0.0, 0.0)),  # some truth, no output
        (0, 2, 3, (0.0, 0.0, 0.0)),
        (3, 1, 2, (0.75, 0.6, 6 / 9)),
        (4, 0, 0, (1.0, 1.0, 1.0)),
    ],
)
def test_nothing_over_nothing_has_one_meaning(tp, fp, fn, expected):
    assert values(counted([tp], [fp], [fn])) == pytest.approx(expected, nan_ok=True)


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 30), st.integers(0, 30), st.integers(0, 30))
def test_ratios_agree_with_scikit_learn(tp, fp, fn):
    truth = [1] * tp + [0] * fp + [1] * fn
    found = [1] * tp + [1] * fp + [0] * fn
    oracle = precision_score(truth, found), recall_score(truth, found), f1_score(truth, found)
    assert values(counted([tp], [fp], [fn])) == pytest.approx(oracle)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(*[st.integers(0, 3)] * 3), min_size=2, max_size=20), st.data())
def test_partials_of_parts_merge_to_the_partial_of_the_whole(frames, data):
    cut = data.draw(st.integers(1, len(frames) - 1))
    whole, head, tail = (
        counted(*np.transpose(part), duration_s=float(len(part))) for part in (frames, frames[:cut], frames[cut:])
    )
    for metric in (Precision, Recall, F1, FalseAlarmsPerMinute):
        merged = merge(metric, [metric.partial(head), metric.partial(tail)])
        np.testing.assert_array_equal(merged, metric.partial(whole))


def test_f1_is_the_harmonic_mean_where_both_parts_are_defined():
    precision, recall, f1 = values(counted([3, 0], [1, 0], [0, 2]))
    assert f1 == pytest.approx(2 * precision * recall / (precision + recall))


def test_false_alarms_count_in_a_minute_of_scored_time():
    outcome = counted([0, 0], [3, 2], [0, 0], duration_s=150.0)
    assert evaluate(FalseAlarmsPerMinute, [outcome]) == 2.0
    assert math.isnan(evaluate(FalseAlarmsPerMinute, [dataclasses.replace(outcome, duration_s=0.0)]))


def test_captures_that_are_not_exhaustive_add_to_recall_only():
    sure = counted([3], [1], [0])
    unsure = counted([1], [0], [3], exhaustive=False)
    for metric in (Precision, F1, FalseAlarmsPerMinute):
        assert evaluate(metric, [sure, unsure]) == evaluate(metric, [sure])
        assert math.isnan(evaluate(metric, [unsure]))
    assert evaluate(Recall, [sure, unsure]) == 4 / 7
