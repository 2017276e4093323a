"""Intervals of numbers that are made of several scenes, against scipy, brute force and what they promise."""

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fixtures.chance import plausible
from uwbbench.measure.accuracy.intervals import (
    CORRELATION_S,
    INNER_UNITS,
    Blocks,
    degrees,
    delete_one,
    exact,
    failing_share,
    jackknife,
    mean,
    of_left_out,
    quantile,
    ratio,
    share,
    stratified,
)

SEEDS = st.integers(0, 10_000)


def scenes(seed, units):
    """Hits and frames of scenes of unequal length and difficulty."""
    rng = np.random.default_rng(seed)
    frames = rng.integers(20, 400, units).astype(float)
    return rng.binomial(frames.astype(int), rng.beta(9, 1, units)).astype(float), frames


@settings(max_examples=50, deadline=None)
@given(SEEDS, st.integers(2, 15))
def test_degrees_of_freedom_are_those_of_the_quadratic_form(seed, units):
    weights = np.random.default_rng(seed).uniform(0.1, 9, units)
    part = weights / weights.sum()
    centred = np.eye(units) - part  # takes the weighted mean from each value
    form = centred.T @ np.diag(np.square(part / (1 - part))) @ centred
    expected = np.trace(form) ** 2 / np.trace(form @ form)
    assert degrees(weights) == pytest.approx(max(expected, 1.0))


@pytest.mark.parametrize("units", [2, 7, 40])
def test_units_of_one_size_have_one_degree_of_freedom_less_than_their_number(units):
    assert degrees(np.full(units, 3.0)) == pytest.approx(units - 1)


def test_a_unit_that_makes_nearly_all_of_a_number_leaves_one_degree_of_freedom():
    assert degrees(np.array([1e3, 1.0, 1.0, 1.0])) == pytest.approx(1.0, abs=0.01)


@settings(max_examples=50, deadline=None)
@given(SEEDS, st.integers(2, 15))
def test_values_without_one_unit_are_those_of_the_others(seed, units):
    num, den = scenes(seed, units)
    expected = [np.delete(num, at).sum() / np.delete(den, at).sum() for at in range(units)]
    assert delete_one(num, den) == pytest.approx(expected)


@settings(max_examples=50, deadline=None)
@given(SEEDS, st.integers(INNER_UNITS, 40))
def test_a_plain_mean_of_equal_units_has_the_interval_of_student(seed, units):
    values, ones = np.random.default_rng(seed).normal(size=units), np.ones(units)
    found = of_left_out(values.mean(), delete_one(values, ones), ones, enough=units >= INNER_UNITS)
    expected = scipy.stats.ttest_1samp(values, 0).confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))


def test_a_mean_of_either_sign_is_a_share_of_the_way_between_its_bounds():
    rng = np.random.default_rng(12)
    den = rng.integers(5, 30, 15).astype(float)
    num = den * rng.normal(0.1, 0.2, 15)
    found, as_share = mean(num, den, most=2.0), share((num / 2.0 + den) / 2, den)
    assert np.array(found) == pytest.approx(2.0 * (2 * np.array(as_share) - 1))
    assert np.isnan(mean(num[:11], den[:11], most=2.0).low)


@pytest.mark.parametrize(("hits", "trials"), [(0, 10), (3, 10), (10, 10), (999, 1000)])
def test_clopper_and_pearson_are_scipys(hits, trials):
    expected = scipy.stats.binomtest(hits, trials).proportion_ci(method="exact")
    assert exact(np.array(hits / trials), np.array(trials)) == pytest.approx((expected.low, expected.high))


def test_the_outer_interval_is_that_of_so_many_trials_where_each_unit_ends_all_or_nothing():
    found = share([50.0] * 9 + [0.0], [50.0] * 10)
    expected = scipy.stats.binomtest(9, 10).proportion_ci(method="exact")
    assert (found.outer_low, found.outer_high) == pytest.approx((expected.low, expected.high))


def test_below_twelve_units_there_is_the_outer_interval_only():
    few, enough = share(*scenes(1, INNER_UNITS - 1)), share(*scenes(1, INNER_UNITS))
    assert (few.low, few.high) == (few.outer_low, few.outer_high)
    assert enough.outer_low < enough.low < enough.value < enough.high < enough.outer_high


@settings(max_examples=100, deadline=None)
@given(SEEDS, st.integers(1, 40))
def test_intervals_of_shares_hold_the_value_and_nest(seed, units):
    found = share(*scenes(seed, units))
    assert 0 <= found.outer_low <= found.low <= found.value <= found.high <= found.outer_high <= 1


@settings(max_examples=50, deadline=None)
@given(SEEDS, st.integers(INNER_UNITS, 30), st.floats(0.01, 100))
def test_intervals_of_ratios_follow_the_unit_of_the_numbers(seed, units, factor):
    rng = np.random.default_rng(seed)
    num, den = rng.gamma(2, 1, units), rng.integers(1, 50, units).astype(float)
    most = np.max(num / den)
    plain, scaled = ratio(num, den, most=most), ratio(factor * num, den, most=factor * most)
    assert np.array(scaled) == pytest.approx(factor * np.array(plain))


def test_units_without_denominator_do_not_count():
    num, den = scenes(3, 20)
    padded = share(np.r_[num, 0, 0], np.r_[den, 0, 0])
    assert np.array(padded) == pytest.approx(np.array(share(num, den)))
    few = share(np.r_[num[:11], 0, 0], np.r_[den[:11], 0, 0])
    assert few.low == few.outer_low


def test_nothing_is_undefined():
    for found in (share([], []), share([0.0], [0.0]), ratio([0.0], [0.0]), mean([], [], most=1.0), quantile([], 0.5)):
        assert np.isnan(np.array(found)).all()


def test_a_share_of_one_has_the_interval_of_one_just_below_it():
    all_found, one_missed = share([1000.0] * 20, [1000.0] * 20), share([999.0] + [1000.0] * 19, [1000.0] * 20)
    assert all_found.high == 1.0
    assert all_found.outer_low == pytest.approx(0.025 ** (1 / 20))
    assert one_missed.low == pytest.approx(float(all_found.low), abs=0.01)


def test_the_lower_end_leaves_room_for_half_a_scene_that_fails():
    rng = np.random.default_rng(11)
    num, den = 100 * rng.beta(95, 5, 30), np.full(30, 100.0)
    low = float(share(num, den).low)
    padded_num, padded_den = np.r_[num, 0.0], np.r_[den, 50.0]
    left = delete_one(padded_num, padded_den)
    logits = np.log(left / (1 - left))
    middle = np.log(padded_num.sum() / (padded_den.sum() - padded_num.sum()))
    error = np.sqrt(30 / 31 * np.square(logits - middle).sum())
    expected = middle - error * scipy.stats.t.ppf(0.975, degrees(padded_den))
    assert np.log(low / (1 - low)) == pytest.approx(expected)


def test_many_numbers_at_once_are_those_one_by_one():
    pairs = [scenes(seed, 15) for seed in range(4)]
    together = share(np.stack([num for num, _ in pairs]), np.stack([den for _, den in pairs]))
    for at, (num, den) in enumerate(pairs):
        assert np.array(together)[:, at] == pytest.approx(np.array(share(num, den)))


def test_a_mean_error_is_a_share_of_the_largest_error_that_was_seen():
    rng = np.random.default_rng(13)
    den = rng.integers(5, 30, 15).astype(float)
    num = den * rng.gamma(2, 0.1, 15)
    found, as_share = ratio(num, den, most=2.5), share(num / 2.5, den)
    assert np.array(found) == pytest.approx(2.5 * np.array(as_share))


def test_a_mean_error_of_few_scenes_has_no_upper_end():
    found = ratio([1.0, 2.0, 0.5], [10.0, 10.0, 10.0], most=0.9)
    assert 0 < found.low < found.value
    assert (found.high, found.outer_high) == (np.inf, np.inf)


def test_a_rate_without_a_bound_has_the_interval_of_its_logarithm_from_twelve_scenes_on():
    num, den = np.random.default_rng(14).gamma(2, 1, 12), np.ones(12)
    found = ratio(num, den)
    assert float(found.low * found.high) == pytest.approx(float(found.value) ** 2)
    assert np.isnan(found.outer_low)
    assert np.isnan(ratio(num[:11], den[:11]).high)


@settings(max_examples=30, deadline=None)
@given(SEEDS, st.integers(1, 30))
def test_intervals_of_quantiles_hold_the_value_and_nest(seed, units):
    rng = np.random.default_rng(seed)
    found = quantile([rng.gamma(2, scale, 30) for scale in rng.gamma(4, 0.1, units)], 0.95)
    assert found.outer_low <= found.low <= found.value <= found.high <= found.outer_high


def test_the_quantile_of_independent_samples_has_the_interval_of_order_statistics():
    samples = np.random.default_rng(5).exponential(size=4000)
    found = quantile(list(samples.reshape(400, 10)), 0.9)
    ends = np.array(scipy.stats.binomtest(3600, 4000).proportion_ci(method="exact"))
    low, high = np.quantile(samples, ends)
    assert (found.low, found.high) == pytest.approx((low, high), rel=0.03)


def test_a_quantile_of_few_units_has_no_upper_end():
    rng = np.random.default_rng(6)
    assert quantile([rng.exponential(size=50) for _ in range(8)], 0.95).high == np.inf


def test_blocks_are_compared_with_those_of_their_own_capture_only():
    left = np.array([1.0, 1.1, 0.9, 1.0, 5.0, 5.2, 4.8, 5.0])
    spread = stratified(left, Blocks(2, 1e9))
    parts = [3 / 4 * np.square(row - row.mean()).sum() for row in left.reshape(2, 4)]
    assert spread.error == pytest.approx(np.sqrt(sum(parts)))
    assert spread.degrees == pytest.approx(sum(parts) ** 2 / (parts[0] ** 2 / 3 + parts[1] ** 2 / 3))


def test_short_blocks_are_trusted_less():
    left = np.array([1.0, 1.1, 0.9, 1.0])
    long, short = stratified(left, Blocks(1, 1e9)), stratified(left, Blocks(1, 2.5))
    assert short.error == pytest.approx(long.error * np.sqrt(1 + 2 * CORRELATION_S / 2.5))


def test_a_number_without_a_form_of_its_own_needs_twelve_units_too():
    num, den = np.random.default_rng(7).normal(1, 0.2, 20), np.ones(20)
    assert np.isfinite(of_left_out(num.mean(), delete_one(num, den), den, enough=True).low)
    assert np.isnan(of_left_out(num.mean(), delete_one(num, den), den, enough=False).low)


def test_a_single_unit_that_carries_a_number_leaves_it_without_a_standard_error():
    num, den = np.array([5.0]), np.array([7.0])
    assert np.isnan(jackknife(num.sum() / den.sum(), delete_one(num, den), den).error)
    found = share(num, den)
    assert found.outer_low < 0.1
    assert found.outer_high > 0.9


@pytest.mark.parametrize("units", [12, 40])
def test_scenes_of_unequal_length_and_difficulty_are_covered(units):
    rng = np.random.default_rng(8)
    studies = 2000
    den = rng.integers(50, 400, (studies, units)).astype(float)
    num = den * rng.beta(27, 3, (studies, units))
    found = share(num, den)
    inside = int(np.count_nonzero((found.low <= 0.9) & (found.high >= 0.9)))
    outside = int(np.count_nonzero((found.outer_low > 0.9) | (found.outer_high < 0.9)))
    assert inside >= plausible(0.93, studies).start
    assert outside <= plausible(0.025, studies).stop


@pytest.mark.parametrize("units", [6, 12, 40])
def test_no_scene_failed_bounds_the_share_that_fails(units):
    high = scipy.stats.binomtest(0, units).proportion_ci(method="exact").high
    assert failing_share(units) == pytest.approx(high)
