"""Errors of retained detections."""

import math

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api.metric import Outcome
from uwbbench.measure.accuracy.metrics.error import (
    Bias,
    MeanAbsoluteError,
    Percentile90,
    Percentile95,
    StandardDeviation,
    matched_only,
)
from uwbbench.measure.accuracy.stats import evaluate, merge

ALL = (MeanAbsoluteError, Percentile90, Percentile95, StandardDeviation, Bias)


def erring(errors_m, matched=None):
    """Outcome of one frame for each error."""
    errors_m = np.asarray(errors_m, float)
    count = len(errors_m)
    matched = np.ones(count, bool) if matched is None else np.asarray(matched, bool)
    return Outcome(
        group=np.zeros(count, int),
        tp=matched.astype(int),
        fp=(~matched).astype(int),
        fn=np.zeros(count, int),
        error_frame=np.arange(count),
        error_m=errors_m,
        matched=matched,
        duration_s=1.0,
    )


def value(metric, errors_m):
    return evaluate(metric, [erring(errors_m)])


ERRORS = st.lists(st.floats(-5, 5), min_size=72, max_size=120)


@settings(max_examples=30, deadline=None)
@given(ERRORS)
def test_numbers_agree_with_scipy(errors_m):
    size = np.abs(errors_m)
    assert value(MeanAbsoluteError, errors_m) == pytest.approx(scipy.stats.tmean(size), abs=1e-12)
    assert value(StandardDeviation, errors_m) == pytest.approx(scipy.stats.tstd(size, ddof=0), abs=1e-12)
    assert value(Bias, errors_m) == pytest.approx(scipy.stats.tmean(errors_m), abs=1e-12)
    assert value(Percentile90, errors_m) == pytest.approx(
        scipy.stats.mstats.mquantiles(size, 0.9, alphap=1, betap=1)[0], abs=1e-12
    )
    assert value(Percentile95, errors_m) == pytest.approx(
        scipy.stats.mstats.mquantiles(size, 0.95, alphap=1, betap=1)[0], abs=1e-12
    )


@settings(max_examples=30, deadline=None)
@given(ERRORS, st.integers(1, 71))
def test_partials_of_parts_merge_to_the_whole(errors_m, cut):
    for metric in ALL:
        merged = merge(metric, [metric.partial(erring(errors_m[:cut])), metric.partial(erring(errors_m[cut:]))])
        assert metric.value(merged) == value(metric, errors_m)


@settings(max_examples=30, deadline=None)
@given(ERRORS)
def test_all_but_the_bias_are_blind_to_the_sign(errors_m):
    turned = [-error for error in errors_m]
    for metric in ALL[:-1]:
        assert value(metric, turned) == value(metric, errors_m)
    assert value(Bias, turned) == -value(Bias, errors_m)


@pytest.mark.parametrize(("metric", "floor"), [(Percentile90, 36), (Percentile95, 72)])
def test_percentile_is_undefined_below_its_sample_floor(metric, floor):
    assert metric.minimum_samples == floor
    assert math.isnan(value(metric, np.ones(floor - 1)))
    assert value(metric, np.ones(floor)) == 1.0


def test_spread_is_that_of_absolute_errors_and_divides_by_n():
    # |errors| 0.1, 0.3: mean 0.2, both 0.1 away. The signed errors' spread would be 0.2, the sample's 0.1414.
    assert value(StandardDeviation, [0.1, -0.3]) == pytest.approx(0.1)


def test_spread_of_large_nearly_equal_errors_keeps_its_digits():
    assert value(StandardDeviation, [1e8, 1e8 + 1, 1e8 + 2]) == pytest.approx(math.sqrt(2 / 3), rel=1e-9)


def test_detections_that_belong_to_no_object_are_left_out():
    assert value(MeanAbsoluteError, [0.1, math.nan, 0.3]) == pytest.approx(0.2)


def test_without_errors_every_number_is_undefined():
    for metric in ALL:
        assert math.isnan(value(metric, []))
        assert math.isnan(value(metric, [math.nan]))


def test_matched_only_keeps_the_errors_of_true_positives_and_all_counts():
    part = matched_only(erring([0.1, 2.0, -0.1], [True, False, True]))
    assert evaluate(MeanAbsoluteError, [part]) == pytest.approx(0.1)
    assert part.error_frame.tolist() == [0, 2]
    assert (part.tp.sum(), part.fp.sum()) == (2, 1)
