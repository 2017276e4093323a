"""Comparisons of several detectors on the same scenes, against scipy, brute force and what they promise."""

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fixtures.chance import plausible
from uwbbench.measure.accuracy.boards import Contrast, adjusted, board, contrast, holm, rank_sets, verdict
from uwbbench.measure.accuracy.intervals import delete_one

SEEDS = st.integers(0, 10_000)


def study(rng, detectors, units, spread=0.05):
    """Hits and chances of detectors that are equally good: scenes differ, and so does how each fares in them."""
    den = rng.integers(50, 400, units) * np.ones((detectors, 1))
    level = 0.85 + rng.normal(0, spread, units) + rng.normal(0, spread, (detectors, units))
    return den * np.clip(level, 0, 1), den


def compared(num, den):
    return board(num.sum(1) / den.sum(1), delete_one(num, den), den)


@settings(max_examples=30, deadline=None)
@given(SEEDS, st.integers(3, 30))
def test_a_pair_on_scenes_of_one_length_is_the_paired_t_test(seed, units):
    first, second = np.random.default_rng(seed).normal(size=(2, units))
    den = np.ones(units)
    left = delete_one(first, den) - delete_one(second, den)
    found = contrast(first.mean() - second.mean(), left, (den, den))
    expected = scipy.stats.ttest_rel(first, second)
    ends = expected.confidence_interval(0.95)
    assert found.p_value == pytest.approx(expected.pvalue)
    assert tuple(map(float, found.ends(0.95))) == pytest.approx((ends.low, ends.high))


@settings(max_examples=30, deadline=None)
@given(SEEDS, st.integers(2, 6), st.integers(4, 20))
def test_a_board_holds_the_pairs_one_by_one(seed, detectors, units):
    num, den = study(np.random.default_rng(seed), detectors, units)
    together, left = compared(num, den), delete_one(num, den)
    values = num.sum(1) / den.sum(1)
    for one in range(detectors):
        for other in range(one):
            alone = contrast(values[one] - values[other], left[one] - left[other], (den[one], den[other]))
            assert [float(part[one, other]) for part in together] == pytest.approx([float(part) for part in alone])


def test_equal_boards_hold_a_difference_in_one_of_twenty_at_most():
    rng = np.random.default_rng(1)
    boards = 600
    false = sum(bool(np.nanmin(adjusted(compared(*study(rng, 8, 8)).p_value)) < 0.05) for _ in range(boards))
    assert false < plausible(0.05, boards).stop


def test_a_real_difference_is_found():
    rng = np.random.default_rng(2)
    num, den = study(rng, 3, 30)
    num[0] *= 0.7
    p_values = adjusted(compared(num, den).p_value)
    assert p_values[0, 1] < 0.05
    assert p_values[0, 2] < 0.05


def test_adjusted_p_values_are_those_of_all_pairs_together():
    p_values = np.array([[1.0, 0.01, 0.04], [0.01, 1.0, 0.03], [0.04, 0.03, 1.0]])
    expected = holm([0.01, 0.04, 0.03])
    found = adjusted(p_values)
    assert [found[0, 1], found[0, 2], found[1, 2]] == pytest.approx(expected)
    assert np.array_equal(found, found.T, equal_nan=True)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0, 1), min_size=1, max_size=12))
def test_holm_rejects_what_its_steps_reject(p_values):
    order = np.argsort(p_values, kind="stable")
    rejected = set()
    for step, at in enumerate(order):
        if p_values[at] * (len(p_values) - step) >= 0.05:
            break
        rejected.add(int(at))
    assert set(np.flatnonzero(holm(p_values) < 0.05).tolist()) == rejected


def test_a_detector_and_its_twin_do_not_differ():
    num, den = study(np.random.default_rng(3), 1, 20)
    found = compared(np.repeat(num, 2, 0), np.repeat(den, 2, 0))
    assert (found.value[0, 1], found.error[0, 1], found.p_value[0, 1]) == (0, 0, 1)


@pytest.mark.parametrize(("units", "p_value"), [(6, 2**-5), (12, 2**-11)])
def test_the_same_difference_in_every_scene_is_as_sure_as_so_many_equal_signs(units, p_value):
    den = np.full((2, units), 10.0)
    assert compared(den * [[1.0], [0.0]], den).p_value[0, 1] == p_value


def test_what_is_undefined_is_no_comparison():
    num, den = study(np.random.default_rng(4), 3, 12)
    found = board(np.array([0.8, np.nan, 0.9]), np.where([[1], [0], [1]], delete_one(num, den), np.nan), den)
    p_values = adjusted(found.p_value)
    assert np.isnan(p_values[0, 1])
    assert np.isfinite(p_values[0, 2])


@settings(max_examples=50, deadline=None)
@given(SEEDS, st.integers(1, 12))
def test_rank_sets_hold_the_order_that_they_were_made_of(seed, detectors):
    rng = np.random.default_rng(seed)
    true = rng.permutation(detectors)
    ahead = (true[:, None] < true) & (rng.random((detectors, detectors)) < 0.5)
    sets = rank_sets(ahead)
    assert np.all((sets[:, 0] <= true + 1) & (true + 1 <= sets[:, 1]))


@pytest.mark.parametrize(
    ("value", "error", "p_value", "units", "expected"),
    [
        (0.2, 0.01, 1e-6, 5, "too few"),
        (0.2, 0.01, 1e-6, 6, "differs"),
        (0.2, 0.2, 0.4, 20, "not told apart"),
        (0.001, 0.001, 0.4, 12, "equal"),
        (0.001, 0.001, 0.4, 11, "not told apart"),
        (0.005, 0.001, 1e-3, 20, "equal"),
        (np.nan, np.nan, np.nan, 20, "undefined"),
    ],
)
def test_verdicts(value, error, p_value, units, expected):

    found = Contrast(*(np.asarray(part) for part in (value, error, units - 1.0, p_value)))
    assert verdict(found, p_value, units, margin=0.01) == expected


def test_equal_takes_the_99_percent_interval():

    reach = 0.01 / scipy.stats.t.ppf(0.995, 19)
    for error, expected in ((reach * 0.999, "equal"), (reach * 1.001, "not told apart")):
        found = Contrast(*(np.asarray(part) for part in (0.0, error, 19.0, 1.0)))
        assert verdict(found, 1.0, 20, margin=0.01) == expected
