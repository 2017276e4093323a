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
from uwbbench.measure.accuracy.groups import blocks_of
from uwbbench.measure.accuracy.intervals import degrees, share
from uwbbench.measure.accuracy.metrics.detection import F1, FalseAlarmsPerMinute, Precision, Recall
from uwbbench.measure.accuracy.metrics.error import (
    Bias,
    MeanAbsoluteError,
    Percentile90,
    Percentile95,
    StandardDeviation,
)
from uwbbench.measure.accuracy.stats import (
    clopper_pearson,
    clustered_proportion,
    drawn,
    estimated,
    evaluate,
    paired_board,
    paired_difference,
    samples_needed,
)

SHIPPED = (
    F1,
    Precision,
    Recall,
    FalseAlarmsPerMinute,
    MeanAbsoluteError,
    Percentile90,
    Percentile95,
    StandardDeviation,
)
SHIPPED += (Bias,)


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
    assert estimated(Recall, captures).value == 0.9


def test_captures_of_one_scene_are_one_piece_of_evidence():
    rng = np.random.default_rng(2)
    captures = [outcome(rng) for _ in range(24)]
    scenes = [number // 2 for number in range(24)]
    estimate = estimated(Recall, captures, scenes)
    assert estimate.groups == 12
    merged = [evaluate(Recall, captures[at : at + 2]) for at in range(0, 24, 2)]
    found = share(40 * 2 * np.array(merged), np.full(12, 80.0))
    assert (estimate.low, estimate.high) == pytest.approx((float(found.low), float(found.high)))


def test_captures_without_scored_frames_are_no_scenes():
    rng = np.random.default_rng(2)
    captures = [outcome(rng, blocks=1) for _ in range(7)] + [without_frames()]
    assert estimated(Recall, captures).groups == 7


def test_below_twelve_scenes_there_is_the_outer_interval_and_every_value():
    rng = np.random.default_rng(3)
    captures = [outcome(rng) for _ in range(11)]
    estimate = estimated(Recall, captures)
    assert (estimate.low, estimate.high) == (estimate.outer_low, estimate.outer_high)
    assert estimate.per_group == pytest.approx([one.tp.mean() for one in captures])
    assert estimated(Recall, [*captures, outcome(rng)]).per_group == ()


@pytest.mark.parametrize("count", [1, 2, 3])
def test_up_to_three_scenes_have_an_interval_within_their_recordings(count):
    rng = np.random.default_rng(4)
    captures = [outcome(rng, frames=400, blocks=40) for _ in range(count)]
    estimate = estimated(Recall, captures)
    assert estimate.within
    assert estimate.outer_low < estimate.low < estimate.value < estimate.high < estimate.outer_high
    assert not estimated(Recall, [outcome(rng, frames=400, blocks=40) for _ in range(4)]).within


def test_recordings_of_less_than_half_a_minute_together_have_no_interval_within_them():
    rng = np.random.default_rng(5)
    assert estimated(Recall, [outcome(rng, frames=100, blocks=10) for _ in range(3)]).within
    short = estimated(Recall, [outcome(rng, frames=99, blocks=9) for _ in range(3)])
    assert not short.within
    assert (short.low, short.high) == (short.outer_low, short.outer_high)


def test_no_outcome_at_all_is_an_undefined_number_of_no_samples():
    for given_outcomes in ([], [without_frames()]):
        estimate = estimated(Recall, given_outcomes)
        assert math.isnan(estimate.value)
        assert (estimate.n, estimate.groups) == (0, 0)


@pytest.mark.parametrize("metric", [metric for metric in SHIPPED if metric is not FalseAlarmsPerMinute])
def test_every_shipped_metric_has_an_interval_around_its_value_from_twelve_scenes_on(metric):
    rng = np.random.default_rng(6)
    captures = [outcome(rng, hit=rng.uniform(0.6, 1.0), offset_m=rng.normal(0, 0.05)) for _ in range(40)]
    estimate = estimated(metric, captures)
    assert estimate.low <= estimate.value <= estimate.high
    assert estimate.n > 0


def test_no_false_alarm_at_all_is_a_rate_without_an_interval():
    rng = np.random.default_rng(6)
    estimate = estimated(FalseAlarmsPerMinute, [outcome(rng) for _ in range(20)])
    assert estimate.value == 0
    assert math.isnan(estimate.high), "how many there may be elsewhere, no frame says"


def test_a_metric_that_says_nothing_of_its_kind_has_the_interval_of_its_values_without_one_scene():
    class Spread(StandardDeviation):
        kind = "other"

    rng = np.random.default_rng(7)
    captures = [outcome(rng, noise_m=rng.uniform(0.02, 0.1)) for _ in range(15)]
    left = np.array([Spread.value(np.concatenate([c.error_m for c in captures if c is not one])) for one in captures])
    estimate = estimated(Spread, captures)
    error = np.sqrt(14 / 15 * np.square(left - estimate.value).sum())
    freedom = degrees(np.array([len(one.error_m) for one in captures], float))
    reach = error * scipy.stats.t.ppf(0.975, freedom)
    assert (estimate.low, estimate.high) == pytest.approx((estimate.value - reach, estimate.value + reach))


def test_a_percentile_without_enough_samples_has_no_value_and_says_how_many_it_had():
    estimate = estimated(Percentile90, [outcome(np.random.default_rng(9), frames=20, hit=1.0)])
    assert math.isnan(estimate.value)
    assert estimate.n == 20


def test_paired_difference_of_a_detector_with_itself_is_nothing():
    captures = [outcome(np.random.default_rng(seed)) for seed in range(10)]
    difference = paired_difference(Recall, captures, captures)
    assert (difference.value, difference.low, difference.high, difference.p_value) == (0.0, 0.0, 0.0, 1.0)


def test_pairing_sees_a_difference_smaller_than_the_spread_of_captures():
    rng = np.random.default_rng(10)
    first = [outcome(rng, hit=1.0, offset_m=offset) for offset in np.linspace(-0.5, 0.5, 12)]
    second = [dataclasses.replace(one, error_m=one.error_m - 0.01) for one in first]
    difference = paired_difference(Bias, first, second)
    assert difference.value == pytest.approx(0.01)
    assert difference.low > 0
    assert difference.p_value == 2**-11, "no surer than twelve equal signs"
    alone = estimated(Bias, first)
    assert difference.high - difference.low < 1e-6 < alone.high - alone.low


@pytest.mark.parametrize("metric", SHIPPED)
def test_a_board_holds_the_paired_differences_of_all_its_pairs(metric):
    rng = np.random.default_rng(11)
    series = [[outcome(rng, hit=hit) for _ in range(40)] for hit in (0.9, 0.8, 0.85)]
    scenes = [number // 2 for number in range(40)]
    for (one, other), found in paired_board(metric, series, scenes).items():
        alone = paired_difference(metric, series[one], series[other], scenes)
        assert (found.per_group, alone.per_group) == ((), ())
        numbers = [np.array([value for key, value in vars(d).items() if key != "per_group"]) for d in (found, alone)]
        assert numbers[0] == pytest.approx(numbers[1], nan_ok=True)


def test_paired_difference_pairs_blocks_by_their_time_also_where_one_detector_left_some_out():
    full = outcome(np.random.default_rng(11), frames=400, blocks=40, hit=1.0)
    late = full.group >= 20
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
    first, second = blocks_of([full, half])
    assert [len(block.group) for block in first] == [100, 100, 100, 100]
    assert [len(block.group) for block in second] == [0, 0, 100, 100]
    assert np.array_equal(first[3].error_m, second[3].error_m)
    assert paired_difference(Recall, [full], [half]).within


def test_a_comparison_within_recordings_has_no_p_value():
    rng = np.random.default_rng(12)
    first, second = ([outcome(rng, frames=400, blocks=40, hit=hit) for _ in range(3)] for hit in (0.9, 0.6))
    difference = paired_difference(Recall, first, second)
    assert difference.low > 0
    assert math.isnan(difference.p_value)


def test_a_comparison_on_different_captures_is_refused():
    one = outcome(np.random.default_rng(12))
    with pytest.raises(ValueError, match="same captures, not 1 and 2"):
        paired_difference(Recall, [one], [one, one])


def test_p_values_of_equal_detectors_are_not_too_small():
    rng = np.random.default_rng(13)
    small = 0
    for _ in range(200):
        first, second = ([outcome(rng, frames=20, hit=0.7) for _ in range(12)] for _ in range(2))
        small += paired_difference(Recall, first, second).p_value < 0.05
    assert small <= plausible(0.05, 200)[-1]


def test_drawn_values_spread_as_the_intervals_say():
    rng = np.random.default_rng(14)
    series = [[outcome(rng, hit=rng.uniform(0.6, 0.9)) for _ in range(20)] for _ in range(2)]
    values = drawn(Recall, series, [], draws=4000, seed=1)
    assert values.shape == (4000, 2)
    for column, outcomes in zip(values.T, series, strict=True):
        recalls = np.array([one.tp.mean() for one in outcomes])
        error = recalls.std(ddof=1) / np.sqrt(20)
        assert column.mean() == pytest.approx(recalls.mean(), abs=SIGMAS * error * 1.1 / np.sqrt(4000))
        inside = np.count_nonzero(np.abs(column - recalls.mean()) < error * scipy.stats.t.ppf(0.975, 19))
        assert inside in plausible(0.95, 4000)
    assert len(drawn(Recall, [outcomes[:5] for outcomes in series], [], draws=10, seed=1)) == 0


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


@pytest.mark.slow
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
