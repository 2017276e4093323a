"""Metrics of many resamples at once are those of each resample alone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api import Metric
from uwbbench.measure.accuracy.metrics.detection import F1, FalseAlarmsPerMinute, Precision, Recall
from uwbbench.measure.accuracy.metrics.error import (
    Bias,
    MeanAbsoluteError,
    Percentile90,
    Percentile95,
    StandardDeviation,
)

ERRORS = (MeanAbsoluteError, Percentile90, Percentile95, StandardDeviation, Bias)
COUNTS = {Precision: 2, Recall: 2, F1: 3, FalseAlarmsPerMinute: 2}


def one_by_one(metric: type[Metric], partials, counts):
    return Metric.resampled.__func__(metric, partials, counts)


def drawn(rng: np.random.Generator, groups: int):
    return rng.multinomial(groups, np.full(groups, 1 / groups), size=20).astype(float)


@pytest.mark.parametrize("metric", ERRORS)
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32), groups=st.integers(8, 30), longest=st.sampled_from([1, 5, 40]))
def test_errors(metric, seed: int, groups: int, longest: int) -> None:
    rng = np.random.default_rng(seed)
    partials = [rng.normal(size=rng.integers(0, longest + 1)).round(1) for _ in range(groups)]
    counts = drawn(rng, groups)
    expected = one_by_one(metric, partials, counts)
    np.testing.assert_allclose(
        metric.resampled(partials, counts), expected, rtol=1e-9, atol=1e-8
    )  # the root of what cancels


@pytest.mark.parametrize("metric", COUNTS)
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32), groups=st.integers(8, 30))
def test_counts(metric, seed: int, groups: int) -> None:
    rng = np.random.default_rng(seed)
    partials = [rng.integers(0, 3, size=COUNTS[metric]).astype(float) for _ in range(groups)]
    counts = drawn(rng, groups)
    np.testing.assert_allclose(metric.resampled(partials, counts), one_by_one(metric, partials, counts))
