"""The numbers made of calls, against direct computation."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uwbbench.stats import samples_needed
from uwbbench.timing.latency import (
    SAMPLES_NEEDED,
    call_summary,
    clustering_summary,
    longest_run,
    percentile,
    ratio_summary,
)


def test_percentiles_need_the_samples_of_a_two_sided_interval() -> None:
    assert {q: samples_needed(q / 100) for q in SAMPLES_NEEDED} == SAMPLES_NEEDED


@pytest.mark.parametrize("q", SAMPLES_NEEDED)
def test_a_percentile_without_enough_calls_is_none(q: int) -> None:
    times_us = np.arange(1000.0)
    assert percentile(times_us[: SAMPLES_NEEDED[q] - 1], q) is None
    assert percentile(times_us, q) == pytest.approx(9.99 * q)


@given(st.lists(st.booleans(), max_size=30))
def test_the_longest_run_is_that_of_a_plain_count(marked: list[bool]) -> None:
    runs = [len(list(group)) for value, group in itertools.groupby(marked) if value]
    assert longest_run(np.array(marked, bool)) == max(runs, default=0)


def test_calls_longer_than_the_frame_period_are_missed() -> None:
    found = call_summary(np.array([1.0, 11.0, 12.0, 10.0, 11.0]), deadline_us=10.0)
    assert (found["missed"], found["missed_share"], found["longest_burst"]) == (3, 0.6, 2)
    assert (found["n"], found["max_us"], found["mean_us"], found["p50_us"]) == (5, 12.0, 9.0, 11.0)
    assert found["p90_us"] is None


def test_clustering_calls_are_told_apart_only_where_the_detector_tells() -> None:
    times_us = np.array([1.0, 9.0, 1.0, 7.0])
    assert clustering_summary(times_us, None) is None
    found = clustering_summary(times_us, np.array([False, True, False, True]))
    assert found == {"n": 2, "share": 0.5, "p50_us": 8.0, "mean_us": 8.0}
    never = clustering_summary(times_us, np.zeros(4, bool))
    assert never == {"n": 0, "share": 0.0, "p50_us": None, "mean_us": None}


def test_a_drift_of_the_machine_cancels_in_the_ratio() -> None:
    drift = np.linspace(1.0, 5.0, 40)
    found = ratio_summary(3.0 * drift, 2.0 * drift)
    assert (found["ratio"], found["low"], found["high"]) == pytest.approx((1.5, 1.5, 1.5))
    assert found["blocks"] == 40


def test_a_ratio_of_few_blocks_has_no_interval() -> None:
    found = ratio_summary(np.full(7, 2.0), np.ones(7))
    assert (found["low"], found["high"]) == (None, None)
    assert found["ratio"] == pytest.approx(2.0)
