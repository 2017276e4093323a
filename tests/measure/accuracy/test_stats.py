"""Intervals, comparisons and sample floors."""

import dataclasses
import math

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fixtures.chance import SIGMAS, plausible
from uwbbench.api.metric import Outcome
from uwbbench.measure.accuracy.metrics.detection import FalseAlarmsPerMinute, Precision, Recall
from uwbbench.measure.accuracy.metrics.error import Bias, MeanAbsoluteError, Percentile90
from uwbbench.measure.accuracy.stats import (
    MINIMUM_GROUPS,
    bootstrap,
    clopper_pearson,
    clustered_proportion,
    evaluate,
    holm,
    paired_difference,
    samples_needed,
)


def outcome(rng, frames=40, blocks=4, hit=0.8, offset_m=0.0, noise_m=0.05):
    """One detection a frame, true with probability ``hit``, else a miss."""
    found = rng.random(frames) < hit
    return Outcome(
        group=np.arange(frames) * blocks // frames,
        tp=found.astype(int),
        fp=np.zeros(frames, int),
        fn=(~found).astype(int),
        error_frame=np.flatnonzero(found),
        error_m=rng.normal(offset_m, noise_m, found.sum()),
        matched=np.ones(found.sum(), bool),
        duration_s=frames / 10,
    )


def without_frames():
    nothing = np.empty(0, int)
    return Outcome(nothing, nothing, nothing, nothing, nothing, np.empty(0), np.empty(0, bool), 0.0)


def test_value_is_that_of_all_frames_together_not_the_mean_of_captures():
    rng = np.random.default_rng(1)
    captures = [outcome(rng, 10, hit=0.0), outcome(rng, 90, hit=1.0)]
    assert evaluate(Recall, captures) == 0.9
    assert bootstrap(Recall, captures).value == 0.9


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 12))
def test_blocks_of_a_capture_merge_to_the_whole_capture(seed, blocks):
    one = outcome(np.random.default_rng(seed), frames=60, blocks=blocks)
    estimate = bootstrap(Bias, [one], resamples=1)
    each = bootstrap(Recall, [one], resamples=1).per_group
    assert estimate.groups == blocks
    assert estimate.value == pytest.approx(np.mean(one.error_m), nan_ok=True)
    if each:
        sizes = np.bincount(one.group)
        assert np.dot(each, sizes) / sizes.sum() == pytest.approx(evaluate(Recall, [one]))


def test_group_values_are_those_of_each_block_alone():
    rng = np.random.default_rng(0)
    one = outcome(rng, 40, blocks=4)
    expected = [one.error_m[one.group[one.error_frame] == block].mean() for block in range(4)]
    assert bootstrap(Bias, [one]).per_group == pytest.approx(expected)
    assert bootstrap(FalseAlarmsPerMinute, [one]).per_group == (0.0,) * 4


def test_captures_are_the_groups_from_eight_captures_on():
    rng = np.random.default_rng(2)
    captures = [outcome(rng, blocks=5) for _ in range(8)]
    assert bootstrap(Recall, captures, resamples=10).groups == 8
    assert bootstrap(Recall, captures[:7], resamples=10).groups == 35


def test_captures_without_scored_frames_are_no_groups():
    rng = np.random.default_rng(2)
    captures = [outcome(rng, blocks=1) for _ in range(7)] + [without_frames()]
    assert bootstrap(Recall, captures, resamples=10).groups == 7


def test_below_eight_groups_there_is_no_interval_but_every_value():
    estimate = bootstrap(Recall, [outcome(np.random.default_rng(3), blocks=MINIMUM_GROUPS - 1)])
    assert math.isnan(estimate.low)
    assert math.isnan(estimate.high)
    assert len(estimate.per_group) == estimate.groups == MINIMUM_GROUPS - 1


def test_no_outcome_at_all_is_an_undefined_number_of_no_samples():
    for given_outcomes in ([], [without_frames()]):
        estimate = bootstrap(Recall, given_outcomes)
        assert math.isnan(estimate.value)
        assert (estimate.n, estimate.groups) == (0, 0)


def test_interval_agrees_with_scipys_bootstrap_of_group_means():
    rng = np.random.default_rng(4)
    captures = [outcome(rng, frames=50, hit=rng.uniform(0.5, 1.0)) for _ in range(30)]
    ours = bootstrap(Recall, captures, resamples=4000, seed=1)
    recalls = np.array([one.tp.mean() for one in captures])
    theirs = scipy.stats.bootstrap(
        (recalls,), np.mean, n_resamples=4000, method="percentile", random_state=np.random.default_rng(2)
    ).confidence_interval
    # Standard error of a 2.5 % quantile of 4000 normal draws.
    quantile_se = np.std(recalls) / np.sqrt(30) * np.sqrt(0.025 * 0.975 / 4000) / scipy.stats.norm.pdf(1.96)
    assert ours.low == pytest.approx(theirs.low, abs=SIGMAS * np.sqrt(2) * quantile_se)
    assert ours.high == pytest.approx(theirs.high, abs=SIGMAS * np.sqrt(2) * quantile_se)


def test_interval_covers_the_true_value_about_as_often_as_it_says():
    rng = np.random.default_rng(5)
    hits = 0
    for trial in range(150):
        captures = [outcome(rng, frames=20, hit=0.7, blocks=1) for _ in range(25)]
        estimate = bootstrap(Recall, captures, resamples=200, seed=trial)
        hits += estimate.low <= 0.7 <= estimate.high
    # A percentile interval of 25 groups covers slightly less than it says: 92 to 94 %.
    assert hits >= plausible(0.92, 150)[0]


def test_same_seed_gives_the_same_interval():
    one = outcome(np.random.default_rng(6), blocks=10)
    assert bootstrap(Recall, [one], resamples=50, seed=3) == bootstrap(Recall, [one], resamples=50, seed=3)
    assert bootstrap(Recall, [one], resamples=50, seed=3) != bootstrap(Recall, [one], resamples=50, seed=4)


def test_groups_that_are_all_alike_give_an_interval_without_width():
    captures = [outcome(np.random.default_rng(7), hit=1.0) for _ in range(9)]
    estimate = bootstrap(MeanAbsoluteError, captures, resamples=50)
    assert estimate.low == pytest.approx(estimate.value)
    assert estimate.high == pytest.approx(estimate.value)
    assert estimate.n == 9 * 40


def test_an_interval_that_many_resamples_cannot_define_is_not_given():
    # One capture of nine holds all the output: a third of the draws miss it.
    rng = np.random.default_rng(8)
    captures = [outcome(rng, hit=0.0) for _ in range(8)] + [outcome(rng, hit=1.0)]
    estimate = bootstrap(Precision, captures, resamples=200)
    assert estimate.value == 1.0
    assert math.isnan(estimate.low)


def test_a_percentile_without_enough_samples_has_no_value_and_says_how_many_it_had():
    estimate = bootstrap(Percentile90, [outcome(np.random.default_rng(9), frames=20, hit=1.0)])
    assert math.isnan(estimate.value)
    assert estimate.n == 20


def test_paired_difference_of_a_detector_with_itself_is_nothing():
    captures = [outcome(np.random.default_rng(seed)) for seed in range(10)]
    difference = paired_difference(Recall, captures, captures, resamples=100)
    assert (difference.value, difference.low, difference.high, difference.p_value) == (0.0, 0.0, 0.0, 1.0)


def test_pairing_sees_a_difference_smaller_than_the_spread_of_captures():
    rng = np.random.default_rng(10)
    first = [outcome(rng, hit=1.0, offset_m=offset) for offset in np.linspace(-0.5, 0.5, 12)]
    second = [dataclasses.replace(one, error_m=one.error_m - 0.01) for one in first]
    difference = paired_difference(Bias, first, second, resamples=500)
    assert difference.value == pytest.approx(0.01)
    assert difference.low > 0
    assert difference.p_value == pytest.approx(2 / 501)
    alone = bootstrap(Bias, first, resamples=500)
    assert difference.high - difference.low < 1e-6 < alone.high - alone.low


def test_paired_difference_pairs_blocks_by_their_time_also_where_one_detector_left_some_out():
    full = outcome(np.random.default_rng(11), frames=40, blocks=4, hit=1.0)
    late = full.group >= 2
    half = dataclasses.replace(
        full,
        group=full.group[late],
        tp=full.tp[late],
        fp=full.fp[late],
        fn=full.fn[late],
        error_frame=np.arange(late.sum()),
        error_m=full.error_m[late[full.error_frame]],
        matched=np.ones(late.sum(), bool),
    )
    difference = paired_difference(Bias, [full], [half])
    assert difference.per_group == pytest.approx((math.nan, math.nan, 0.0, 0.0), nan_ok=True)
    assert math.isnan(difference.p_value)


def test_a_comparison_on_different_captures_is_refused():
    one = outcome(np.random.default_rng(12))
    with pytest.raises(ValueError, match="same captures, not 1 and 2"):
        paired_difference(Recall, [one], [one, one])


def test_p_values_of_equal_detectors_are_not_too_small():
    rng = np.random.default_rng(13)
    small = 0
    for trial in range(100):
        first, second = ([outcome(rng, frames=20, hit=0.7) for _ in range(20)] for _ in range(2))
        small += paired_difference(Recall, first, second, resamples=150, seed=trial).p_value < 0.05
    # A bootstrap of 20 groups says 0.05 of up to 0.08 of the draws.
    assert small <= plausible(0.08, 100)[-1]


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0, 1), max_size=8))
def test_holm_agrees_with_its_definition(values):
    order = np.argsort(values, kind="stable")
    expected = np.empty(len(values))
    running = 0.0
    for rank, index in enumerate(order):
        running = max(running, (len(values) - rank) * values[index])
        expected[index] = min(1.0, running)
    np.testing.assert_allclose(holm(values), expected)


def test_holm_leaves_out_comparisons_that_were_not_made():
    np.testing.assert_allclose(holm([0.01, np.nan, 0.04]), [0.02, np.nan, 0.04])


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 200), st.integers(0, 200), st.sampled_from([0.9, 0.95, 0.99]))
def test_clopper_pearson_agrees_with_scipy(successes, failures, confidence):
    trials = successes + failures
    low, high = clopper_pearson(successes, trials, confidence)
    if trials == 0:
        assert (low, high) == (0.0, 1.0)
        return
    oracle = scipy.stats.binomtest(successes, trials).proportion_ci(confidence, method="exact")
    assert low == pytest.approx(oracle.low, abs=1e-9)
    assert high == pytest.approx(oracle.high, abs=1e-9)


def test_more_successes_than_trials_are_refused():
    with pytest.raises(ValueError, match="3 successes of 2 trials"):
        clopper_pearson(3, 2)


CELLS = 20


def apart(rng, frames, rate):
    return rng.binomial(CELLS, rate, frames)


def in_pairs(rng, frames, rate):
    return 2 * rng.binomial(CELLS // 2, rate, frames)


def in_runs(rng, frames, rate):
    """Two to six alarms in one frame of many, four on average."""
    return (rng.random(frames) < rate * CELLS / 4) * rng.integers(2, 7, frames)


def in_noisy_frames(rng, frames, rate):
    """Frames whose rates differ: a tenth of them has ten times the rate."""
    return rng.binomial(CELLS, np.where(rng.random(frames) < 0.1, 10, 1) * rate / 1.9)


def whole_frames(rng, frames, rate):
    return CELLS * (rng.random(frames) < rate)


@pytest.mark.parametrize("expected", [1, 3, 10, 60])
@pytest.mark.parametrize("alarms", [apart, in_pairs, in_runs, in_noisy_frames, whole_frames])
def test_interval_of_clustered_trials_covers_the_true_rate_as_often_as_it_says(alarms, expected):
    rng, frames, draws = np.random.default_rng(14), 600, 1500
    rate = expected / frames / CELLS
    ends = [clustered_proportion(alarms(rng, frames, rate), CELLS) for _ in range(draws)]
    covered = sum(low <= rate <= high for low, high in ends)
    assert covered >= plausible(0.95, draws)[0]


def test_interval_of_independent_trials_does_not_cover_those_of_whole_frames():
    rng, rate = np.random.default_rng(15), 10 / 600 / CELLS
    totals = [int(whole_frames(rng, 600, rate).sum()) for _ in range(300)]
    covered = sum(low <= rate <= high for low, high in (clopper_pearson(total, 600 * CELLS) for total in totals))
    assert covered < plausible(0.5, 300)[0]


def test_without_any_alarm_a_rate_is_bounded_by_the_number_of_frames():
    assert clustered_proportion(np.zeros(200, int), CELLS) == clopper_pearson(0, 200)
    assert clustered_proportion(np.zeros(0, int), CELLS) == (0.0, 1.0)


def test_many_alarms_each_in_a_frame_of_its_own_give_nearly_the_interval_of_independent_trials():
    low, high = clustered_proportion(np.repeat([1, 0], [2000, 8000]), CELLS)
    assert (low, high) == pytest.approx(clopper_pearson(2000, 10_000 * CELLS), rel=1e-3)


@pytest.mark.parametrize(("quantile", "floor"), [(0.90, 36), (0.95, 72), (0.99, 368), (0.10, 36), (0.50, 6)])
def test_sample_floor_is_the_first_count_whose_extremes_bracket_the_quantile(quantile, floor):
    def brackets(n):
        below = scipy.stats.binom.pmf(n, n, quantile)  # all samples below the quantile
        above = scipy.stats.binom.pmf(0, n, quantile)  # all above
        return max(below, above) <= 0.025

    assert samples_needed(quantile) == floor
    assert brackets(floor)
    assert not brackets(floor - 1)
