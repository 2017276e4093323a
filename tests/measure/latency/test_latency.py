"""The numbers made of calls, against direct computation."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from uwbbench.measure.accuracy.stats import samples_needed
from uwbbench.measure.latency.latency import (
    SAMPLES_NEEDED,
    Latency,
    call_summary,
    distribution,
    kinds_summary,
    longest_run,
    percentile,
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


@given(st.integers(0, 40), st.integers(1, 400))
def test_the_bounds_of_missed_deadlines_are_those_of_the_binomial_distribution(missed: int, met: int) -> None:
    found = call_summary(np.array([2.0] * missed + [1.0] * met), deadline_us=1.0)
    exact = binomtest(missed, missed + met).proportion_ci(0.95, "exact")
    assert found["missed_share_low"] == pytest.approx(exact.low, abs=1e-9)
    assert found["missed_share_high"] == pytest.approx(exact.high, abs=1e-9)


def test_no_missed_deadline_of_few_calls_proves_little() -> None:
    assert call_summary(np.ones(10), 2.0)["missed_share_high"] == pytest.approx(1 - 0.025 ** (1 / 10))


def test_clustering_calls_are_told_apart_only_where_the_detector_tells() -> None:
    assert kinds_summary(np.ones(4), None) == {"clustering": None, "plain": None}


def test_both_kinds_of_calls_have_numbers_of_their_own() -> None:
    times_us = np.concatenate([np.arange(100.0), [900.0, 700.0]])
    found = kinds_summary(times_us, times_us > 500)
    assert found["clustering"] == {"n": 2, "share": 2 / 102, **distribution(np.array([900.0, 700.0]))}
    assert found["plain"] == {"n": 100, "share": 100 / 102, **distribution(np.arange(100.0))}
    assert found["clustering"]["p90_us"] is None
    assert found["plain"]["p95_us"] is not None


def test_a_kind_without_calls_has_no_numbers() -> None:
    never = kinds_summary(np.ones(4), np.zeros(4, bool))["clustering"]
    assert never is not None
    assert (never["n"], never["share"]) == (0, 0.0)
    assert {never[key] for key in ("p50_us", "p90_us", "mean_us", "max_us")} == {None}


STORED_BEFORE = {
    "p50_us": 1.0,
    "p90_us": None,
    "p95_us": None,
    "p99_us": None,
    "mean_us": 1.0,
    "max_us": 2.0,
    "n": 3,
    "throughput_us": 1.0,
    "throughput_best_us": 1.0,
    "amortised_us": 1.0,
    "overhead_us": 0.1,
    "startup_s": 0.5,
    "peak_memory_bytes": 1,
    "deadline_us": 10.0,
    "missed": 0,
    "missed_share": 0.0,
    "longest_burst": 0,
    "clustering": {"n": 0, "share": 0.0, "p50_us": None, "mean_us": None},
    "ratio_to_reference": {"reference": "null", "ratio": 1.0, "low": None, "high": None, "blocks": 3},
    "warmed": True,
    "threads": 1,
    "pinned": True,
    "cpu": "some",
    "notes": [],
}
"""What the first run folders hold."""


def test_latencies_stored_before_there_were_more_numbers_still_load() -> None:
    found = Latency.from_dict(STORED_BEFORE)
    assert {key: getattr(found, key) for key in STORED_BEFORE} == STORED_BEFORE
    assert (found.paced, found.missed_share_high, found.quality, found.machine) == (None, None, {}, {})
    assert len(found.times_us) == len(found.paced_times_us) == 0


def test_plain_values_do_not_hold_the_single_calls_and_load_again() -> None:
    found = Latency.from_dict({**STORED_BEFORE, "times_us": [1.0, 2.0], "paced_times_us": [3.0]})
    assert found.times_us.tolist() == [1.0, 2.0]
    assert found.paced_times_us.tolist() == [3.0]
    values = found.to_dict()
    assert not {"times_us", "paced_times_us"} & set(values)
    assert Latency.from_dict(values).to_dict() == values
