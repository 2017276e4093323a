"""Programs that take turns, and the ratio of their times."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import binom

from uwbbench.measure.latency.ratio import Ratio, alternate, log_ratios, median_interval, ratio_summary

samples = arrays(np.float64, st.integers(1, 80), elements=st.floats(-0.5, 0.5))


def constant(blocks: int, seconds: float = 1.0) -> np.ndarray:
    return np.full((blocks, 2), seconds)


@pytest.mark.parametrize(
    ("names", "order"), [("AB", "ABBA" + "BAAB" + "ABBA"), ("abc", "abccba" + "cbaabc" + "abccba")]
)
def test_programs_take_turns_from_either_end(names: str, order: str) -> None:
    log: list[str] = []
    clock = itertools.count()

    def turn(name: str) -> float:
        log.append(name)
        return float(next(clock))

    times_s = alternate([lambda name=name: turn(name) for name in names], 3)
    assert "".join(log) == order
    for number, name in enumerate(names):
        assert times_s[:, number].ravel().tolist() == [at for at, who in enumerate(order) if who == name]


def test_one_interrupted_turn_of_each_is_forgiven_in_a_block() -> None:
    slower, faster = np.array([[2.0, 30.0]] * 3), np.array([[9.0, 1.0]] * 3)
    assert log_ratios(slower, faster) == pytest.approx([math.log(2.0)] * 3)


@given(samples)
def test_the_interval_holds_the_ratio_and_turns_over_with_it(logs) -> None:
    ratio, inverse = Ratio.of(logs), Ratio.of(-logs)
    assert ratio.low <= ratio.value * (1 + 1e-12)
    assert ratio.value <= ratio.high * (1 + 1e-12)
    assert math.isclose(ratio.value, math.exp(np.median(logs)))
    assert ratio.n == len(logs)
    assert (inverse.low, inverse.high) == (pytest.approx(1 / ratio.high), pytest.approx(1 / ratio.low))


@pytest.mark.parametrize("n", [*range(5, 130), 200, 244, 5000])
def test_the_interval_covers_the_median_as_often_as_it_says_and_is_the_narrowest_that_does(n: int) -> None:
    _, low, _ = median_interval(np.arange(n))
    beyond = int(low)
    # Both ends miss if at most so many of the samples lie below the median, each with probability 1/2; or above it.
    assert 1 - 2 * binom.cdf(beyond, n, 0.5) >= (0.95 if n > 5 else 0.93)
    assert 1 - 2 * binom.cdf(beyond + 1, n, 0.5) < 0.95


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
def test_few_samples_have_their_extremes_for_an_interval(n: int) -> None:
    assert median_interval(np.arange(n)) == (0.5 * (n - 1), 0, n - 1)


def drifting(trials: int, blocks: int, ratio: float, seed: int) -> np.ndarray:
    """Times (trials, blocks, 2, 2) on a machine that drifts by a third and interrupts three turns in ten."""
    rng = np.random.default_rng(seed)
    shape = (trials, 4 * blocks)
    pace = np.linspace(0, 0.3, shape[1]) * rng.choice([-1, 1], (trials, 1)) + rng.normal(0, 0.01, shape)
    interrupted = (rng.random(shape) < 0.3) * rng.exponential(0.5, shape)
    turns = (np.exp(pace) * (1 + interrupted)).reshape(trials, blocks, 4)
    outer, inner = turns[:, :, [0, 3]], turns[:, :, [1, 2]]
    swapped = (np.arange(blocks) % 2 == 1)[:, None]
    return np.stack([np.where(swapped, outer, inner) * ratio, np.where(swapped, inner, outer)], axis=2)


@pytest.mark.parametrize("blocks", [7, 9, 15, 25, 32, 61, 100])
def test_the_interval_covers_the_ratio_on_a_machine_that_drifts_and_interrupts(blocks: int) -> None:
    trials = 1000
    found = [Ratio.of(log_ratios(times[:, 0], times[:, 1])) for times in drifting(trials, blocks, 1.1, seed=blocks)]
    covered = sum(ratio.low <= 1.1 <= ratio.high for ratio in found)
    # An interval that covers 95 % in truth falls below this in one case of ten million.
    assert covered >= binom.ppf(1e-7, trials, 0.95)


def test_a_drift_of_the_machine_cancels_in_the_ratio() -> None:
    drift = np.linspace(1.0, 5.0, 80).reshape(40, 2)
    found = ratio_summary(3.0 * drift, 2.0 * drift)
    assert (found["ratio"], found["low"], found["high"]) == pytest.approx((1.5, 1.5, 1.5))
    assert (found["total_ratio"], found["total_low"], found["total_high"]) == pytest.approx((1.5, 1.5, 1.5))
    assert found["blocks"] == 40


def test_a_stored_ratio_of_few_blocks_has_no_interval() -> None:
    found = ratio_summary(constant(7, 2.0), constant(7))
    assert {found[key] for key in ("low", "high", "total_low", "total_high")} == {None}
    assert found["ratio"] == found["total_ratio"] == pytest.approx(2.0)


def test_rare_expensive_blocks_count_in_the_ratio_of_all_time_alone() -> None:
    ours_s = constant(40)
    ours_s[::10] = 11.0
    found = ratio_summary(ours_s, constant(40))
    assert (found["ratio"], found["low"], found["high"]) == (1.0, 1.0, 1.0)
    assert found["total_ratio"] == pytest.approx(2.0)
    assert found["total_low"] < 2.0 < found["total_high"]


times = st.lists(st.tuples(st.floats(1e-6, 10.0), st.floats(1e-6, 10.0)), min_size=8, max_size=60)


@given(times, st.floats(0.1, 10.0))
def test_a_stored_interval_holds_the_ratio_and_scales_with_it(reference, factor: float) -> None:
    ours_s, reference_s = np.array(reference[::-1]), np.array(reference)
    found, scaled = ratio_summary(ours_s, reference_s), ratio_summary(factor * ours_s, reference_s)
    for name, low, high in (("ratio", "low", "high"), ("total_ratio", "total_low", "total_high")):
        assert found[low] <= found[high]
        for key in (name, low, high):
            assert scaled[key] == pytest.approx(factor * found[key])
