"""The rule that tells two detectors apart in speed."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import binom

from uwbbench.tools.gate.check import Verdict
from uwbbench.tools.gate.ratio import Ratio, canary, compared, log_ratios

LIMIT = 1.05
samples = arrays(np.float64, st.integers(31, 80), elements=st.floats(-0.5, 0.5))


def noisy(ratio: float, seed: int, spread: float = 0.02, interrupted: float = 0.1):
    """Samples of a ratio on a machine that is interrupted now and then."""
    rng = np.random.default_rng(seed)

    def sample() -> float:
        disturbance = rng.choice([-1.0, 1.0]) * rng.exponential(0.5) if rng.random() < interrupted else 0.0
        return math.log(ratio) + rng.normal(0, spread) + disturbance

    return lambda count: [sample() for _ in range(count)]


def rule(sampler, minimum: int = 31, patience: int = 4) -> Verdict:
    return compared(sampler, minimum=minimum, patience=patience, limit=LIMIT)[1]


def test_equal_detectors_raise_no_alarm_and_ten_per_cent_are_caught() -> None:
    # Another verdict needs 16 of 31 samples beyond a limit that one in 20 passes: 6e-13.
    assert all(rule(noisy(1.0, seed)) is Verdict.PASS for seed in range(100))
    assert sum(rule(noisy(1.10, seed)) is Verdict.REGRESSION for seed in range(100)) >= 99


def test_few_pairs_of_processes_with_an_outlier_decide_as_well() -> None:
    # An alarm needs five samples of five to be interrupted upwards: 1e-7 each, and 1e-15 for three of 200.
    assert sum(rule(noisy(1.0, s, 0.01, 0.08), 5) is Verdict.REGRESSION for s in range(200)) <= 2
    assert sum(rule(noisy(1.10, s, 0.01, 0.08), 5) is Verdict.REGRESSION for s in range(200)) >= 190


def test_a_faster_head_passes() -> None:
    assert rule(noisy(0.5, 0)) is Verdict.PASS


def alternating(ratio: float, spread: float):
    """Samples of a ratio that lie above and below it in turn."""
    samples = itertools.cycle([math.log(ratio) - spread, math.log(ratio) + spread])
    return lambda count: [next(samples) for _ in range(count)]


def test_scatter_that_hides_the_limit_is_inconclusive_after_all_patience() -> None:
    ratio, verdict = compared(alternating(1.05, spread=1.0), minimum=31, patience=4, limit=LIMIT)
    assert verdict is Verdict.INCONCLUSIVE
    assert ratio.n == 4 * 31


def test_a_narrow_interval_around_the_limit_is_decided_by_the_median() -> None:
    over, under = Ratio(1.051, 1.04, 1.06, 99), Ratio(1.049, 1.04, 1.06, 99)
    assert over.against(LIMIT) is under.against(LIMIT) is Verdict.INCONCLUSIVE
    assert over.finally_against(LIMIT) is Verdict.REGRESSION
    assert under.finally_against(LIMIT) is Verdict.PASS


def test_clear_samples_are_not_added_to() -> None:
    ratio, verdict = compared(noisy(1.5, 1), minimum=31, patience=4, limit=LIMIT)
    assert (ratio.n, verdict) == (31, Verdict.REGRESSION)


@pytest.mark.parametrize(
    ("ratio", "verdict"),
    [(1.0, Verdict.PASS), (1.2, Verdict.INVALID), (1 / 1.2, Verdict.INVALID)],
)
def test_a_base_that_differs_from_itself_in_either_direction_is_invalid(ratio: float, verdict: Verdict) -> None:
    assert canary(noisy(ratio, 5), minimum=31, patience=2, limit=LIMIT)[1] is verdict


def test_a_base_that_scatters_around_itself_is_inconclusive() -> None:
    assert canary(alternating(1.0, spread=2.0), minimum=31, patience=2, limit=LIMIT)[1] is Verdict.INCONCLUSIVE


@given(samples)
def test_the_interval_holds_the_ratio_and_is_the_same_for_the_same_samples(logs) -> None:
    found = Ratio.of(logs)
    assert found == Ratio.of(logs)
    assert found.low <= found.value * (1 + 1e-12)
    assert found.value <= found.high * (1 + 1e-12)
    assert math.isclose(found.value, math.exp(np.median(logs)))


def test_the_interval_is_that_of_the_exact_distribution_of_resampled_medians() -> None:
    logs = np.sort(np.random.default_rng(2).normal(0.02, 0.05, 61))
    # The median of a resample is at most the k-th smallest sample if 31 or more of its 61 draws are among the k.
    at_most = binom.sf(30, 61, np.arange(1, 62) / 61)
    found = Ratio.of(logs)
    for end, tail in ((found.low, 0.025), (found.high, 0.975)):
        exact = int(np.argmax(at_most >= tail))
        assert logs[exact - 1] <= math.log(end) <= logs[exact + 1]


def test_blocks_are_abba_and_baab_and_forgive_one_interrupted_turn_of_each() -> None:
    order: list[str] = []
    base, head = itertools.cycle([9.0, 1.0]), itertools.cycle([2.0, 30.0])

    def turn(name: str, times) -> float:
        order.append(name)
        return next(times)

    found = log_ratios(lambda: turn("A", base), lambda: turn("B", head), 3)
    assert "".join(order) == "ABBA" + "BAAB" + "ABBA"
    assert found == pytest.approx([math.log(2.0)] * 3)
