"""Sums and ranks of training windows against exact sums, sorting and numpy, over any span of amplitudes."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.lib.stride_tricks import sliding_window_view

from uwbbench.api.arrays import locked
from uwbbench_detectors.cfar.factors import order_rank
from uwbbench_detectors.cfar.windows import CA, GO, OS, SO, detect, window_sums

EPSILON = np.finfo(float).eps
MAGNITUDE = st.one_of(st.just(0.0), st.floats(1e-12, 1e12), st.sampled_from([1.0, 2.0, 3.0]))


def sums_of(values, length):
    sums = np.empty(len(values))
    window_sums(np.asarray(values, float), length, np.empty((2, len(values))), sums)
    return sums[: len(values) - length + 1]


@settings(max_examples=200, deadline=None)
@given(values=st.lists(MAGNITUDE, min_size=1, max_size=80), data=st.data())
def test_window_sums_lose_no_digit_over_24_decades(values, data):
    length = data.draw(st.integers(1, len(values)))
    exact = [math.fsum(values[start : start + length]) for start in range(len(values) - length + 1)]
    bound = (2 * math.log2(length) + 1) * EPSILON / 2
    np.testing.assert_allclose(sums_of(values, length), exact, rtol=bound, atol=0)


@pytest.mark.parametrize("length", [1, 6, 7, 64, 255, 256, 600])
def test_window_sums_of_long_windows_are_exact_behind_a_value_1e12_times_as_large(length):
    values = np.random.default_rng(length).exponential(size=600)
    values[::97] = 1e12
    exact = [math.fsum(values[start : start + length]) for start in range(601 - length)]
    np.testing.assert_allclose(sums_of(values, length), exact, rtol=10 * EPSILON, atol=0)


@pytest.mark.parametrize("odd", [np.nan, np.inf])
@pytest.mark.parametrize("length", [1, 5, 8, 13])
def test_values_that_are_not_finite_reach_only_the_windows_that_hold_them(length, odd):
    values = np.random.default_rng(1).exponential(size=40)
    spoiled = values.copy()
    spoiled[17] = odd
    sums, clean = sums_of(spoiled, length), sums_of(values, length)
    start = np.arange(len(sums))
    holds = (start <= 17) & (start + length > 17)
    assert not np.isfinite(sums[holds]).any()
    np.testing.assert_array_equal(sums[~holds], clean[~holds])


def estimated(power, half, guard, statistic, places):
    """Noise estimate of every cell (frames, cells): direct sums and partial sorting in numpy."""
    edge, beyond = half + guard, guard + 1
    side = sliding_window_view(power, half, axis=1)
    inner = power.shape[1] - 2 * edge
    left, right = side[:, :inner], side[:, edge + beyond : edge + beyond + inner]
    if statistic == OS:
        both = np.sort(np.concatenate([left, right], axis=2), axis=2)[:, :, places[1] - 1]
        one = np.sort(side, axis=2)[:, :, places[0] - 1]
    else:
        one = side.sum(axis=2) / half
        means = one[:, :inner], one[:, edge + beyond : edge + beyond + inner]
        both = {CA: sum(means) / 2, GO: np.maximum(*means), SO: np.minimum(*means)}[statistic]
    return np.concatenate([one[:, beyond : beyond + edge], both, one[:, inner : inner + edge]], axis=1)


def crests(amplitude, reach):
    """Mask of the taps that no tap within ``reach`` exceeds; the first of equal ones."""
    crest = np.ones(amplitude.shape, bool)
    for step in range(1, min(reach, amplitude.shape[1] - 1) + 1):
        earlier, later = amplitude[:, :-step], amplitude[:, step:]
        crest[:, step:] &= later > earlier
        crest[:, :-step] &= earlier >= later
    return crest


def frames_of(kind, rng, shape):
    """Magnitudes (frames, taps) of one of several sorts, each of which breaks some way of computing."""
    noise = np.abs(rng.normal(size=shape) + 1j * rng.normal(size=shape))
    if kind == "wide":
        return noise * 10.0 ** rng.integers(-6, 7, shape)
    if kind == "whole":  # many ties
        return np.round(2 * noise)
    if kind == "sparse":
        return np.where(rng.random(shape) < 0.7, 0, noise)
    if kind == "infinite":
        return np.where(rng.random(shape) < 0.05, np.inf, noise)
    if kind == "undefined":
        return np.where(rng.random(shape) < 0.05, np.nan, noise)
    if kind == "spikes":
        level = np.ones(shape)
        level[:, rng.integers(shape[1], size=3)] = 100.0
        return level
    return noise


@pytest.mark.parametrize("kind", ["noise", "wide", "whole", "sparse", "infinite", "undefined", "spikes"])
@pytest.mark.parametrize("statistic", [CA, GO, SO, OS])
@settings(max_examples=12, deadline=None)
@given(
    half=st.integers(1, 20),
    guard=st.integers(0, 4),
    extra=st.integers(0, 40),
    start=st.integers(0, 4),
    reach=st.integers(0, 9),
    rank=st.floats(0.05, 1),
    factor=st.floats(1.01, 20),
    seed=st.integers(0, 2**16),
)
def test_detected_cells_are_those_of_numpy(kind, statistic, half, guard, extra, start, reach, rank, factor, seed):
    cells = 2 * (half + guard) + extra
    if not cells:
        return
    amplitude = locked(frames_of(kind, np.random.default_rng(seed), (12, cells + start)))  # as those of a capture
    places = (order_rank(rank, half), order_rank(rank, 2 * half))
    factors = np.full(cells, 1.1 * factor)
    factors[half + guard : cells - half - guard] = factor
    row, tap, height, score_db, silent = detect(amplitude, start, half, guard, factors, statistic, places, reach)
    power = amplitude[:, start:] ** 2
    noise = estimated(power, half, guard, statistic, places)
    with np.errstate(invalid="ignore"):  # a threshold of zero times infinity
        over = power > factors * noise
    expected = over & (noise > 0)
    if reach:
        expected &= crests(amplitude, reach)[:, start:]
    at = np.nonzero(expected)
    np.testing.assert_array_equal(np.stack([row, tap - start]), np.stack(at))
    np.testing.assert_array_equal(height, amplitude[row, tap])
    np.testing.assert_allclose(score_db, 10 * (np.log10(power[at]) - np.log10(noise[at])), atol=1e-12)
    without_noise = (power > 0) & (noise == 0)
    if reach and statistic == OS:  # ranked at crests alone
        without_noise &= crests(amplitude, reach)[:, start:]
    assert silent == without_noise.any()


def test_one_frame_may_hold_far_more_detections_than_there_are_frames():
    amplitude = np.ones((1, 3000))
    amplitude[0, ::3] = 2.0
    row, tap, *_ = detect(amplitude, 0, 1, 0, np.full(3000, 1.5), SO, (1, 1), 0)
    assert not row.any()
    np.testing.assert_array_equal(tap, np.arange(0, 3000, 3))
