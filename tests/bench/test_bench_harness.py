"""The figures and the table of the benchmark."""

import itertools
import math

import harness
import numpy as np
import pytest


def test_a_ratio_is_taken_within_rounds():
    fast = np.array([1.0, 2.0, 4.0, 8.0])  # a machine that slows down
    found = harness.ratio(3 * fast, fast)
    assert (found.value, found.low, found.high) == pytest.approx((3.0, 3.0, 3.0))


def test_the_interval_of_a_median_holds_it_and_narrows_with_rounds():
    values = np.random.default_rng(1).normal(10, 1, 400)
    few, many = harness.median(values[:12]), harness.median(values)
    assert few.low < few.value < few.high
    assert many.low < 10 < many.high
    assert many.high - many.low < few.high - few.low


@pytest.mark.parametrize("power", [1.0, 1.5, 2.0])
def test_the_exponent_of_a_power_law_is_its_power(power):
    sizes = (10, 100, 1000)
    noise = np.random.default_rng(1).uniform(0.99, 1.01, (9, 3))
    found = harness.exponent(sizes, 5e-9 * np.array(sizes) ** power * noise)
    assert found.value == pytest.approx(power, abs=0.01)
    assert found.low <= found.value <= found.high


def test_contenders_take_turns_forwards_and_backwards():
    order = []

    def contender(name):
        def prepare():
            order.append(f"prepare {name}")
            return lambda: order.append(name)

        return prepare

    spent = harness.interleaved({name: contender(name) for name in "abc"}, rounds=2)
    assert order[::2] == [f"prepare {name}" for name in order[1::2]]  # every run is prepared anew
    turns = "".join(name for name, _ in itertools.groupby(order[1::2]))
    assert turns == "abc" + "abcba" + "cbabc"  # the warm-up, then two rounds; neighbouring turns of one run together
    assert {name: times.shape for name, times in spent.items()} == {"a": (2,), "b": (2,), "c": (2,)}


@pytest.mark.parametrize(
    ("value", "least", "most"), [(1.9, False, True), (2.0, True, True), (2.1, True, False), (math.nan, False, False)]
)
def test_a_limit_is_met_where_it_is_reached_and_never_by_nothing(value, least, most):
    found = harness.Interval(value, value, value)
    assert harness.at_least("target", 2, found).met is least
    assert harness.at_most("target", 2, found).met is most


def test_a_row_tells_the_measured_value_its_interval_and_the_verdict():
    row = harness.at_least("naive / ours", 100, harness.Interval(123.4, 120.0, 125.0), note="0.43 us a frame")
    text = harness.line(row)
    for part in ("naive / ours", ">= 100", "123 times", "[120, 125]", "met", "0.43 us a frame"):
        assert part in text
    assert "MISSED" in harness.line(harness.at_most("ours / exact C", 2, harness.Interval(3, 2.9, 3.1)))


def test_a_target_that_cannot_be_measured_says_why():
    row = harness.missing("ours / exact C", "<= 2", "no C compiler")
    assert harness.line(row).endswith("no C compiler")
    assert harness.plain(row)["met"] is None
    assert harness.plain(row)["value"] is None
