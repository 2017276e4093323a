"""One-to-one matching of detections and objects."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from uwbbench.measure.accuracy.matching import match, match_frames

GATE = 1.0
# A coarse grid makes ties and costs exactly at the gate common.
COSTS = hnp.arrays(
    float,
    st.tuples(st.integers(0, 5), st.integers(0, 5)),
    elements=st.one_of(
        st.sampled_from([0.0, 0.25, 0.5, 1.0, np.nextafter(1.0, 2), np.nan, np.inf]),
        st.floats(0, 2, allow_subnormal=True),
    ),
)


def best_by_trying_all(cost, gate):
    """Most pairs, and the smallest total cost among the matchings that have so many."""
    if cost.shape[0] > cost.shape[1]:
        cost = cost.T
    rows, columns = cost.shape
    best = (0, 0.0)
    for order in permutations(range(columns), rows):
        values = [cost[row, column] for row, column in enumerate(order) if cost[row, column] <= gate]
        best = min(best, (-len(values), sum(values)))
    return -best[0], best[1]


@settings(max_examples=150, deadline=None)
@given(COSTS)
def test_matching_has_the_most_pairs_and_among_those_the_least_cost(cost):
    rows, columns = match(cost, GATE)
    pairs, total = best_by_trying_all(cost, GATE)
    assert len(rows) == pairs
    assert cost[rows, columns].sum() == pytest.approx(total, abs=1e-12)


@settings(max_examples=100, deadline=None)
@given(COSTS)
def test_matching_is_one_to_one_and_within_the_gate(cost):
    rows, columns = match(cost, GATE)
    assert len(set(rows.tolist())) == len(rows) == len(set(columns.tolist()))
    assert np.all(cost[rows, columns] <= GATE)
    assert np.all(np.diff(rows) > 0)


@settings(max_examples=100, deadline=None)
@given(COSTS)
def test_matching_is_symmetric_in_detections_and_objects(cost):
    rows, columns = match(cost, GATE)
    turned_rows, turned_columns = match(cost.T, GATE)
    assert len(rows) == len(turned_rows)
    assert cost[rows, columns].sum() == pytest.approx(cost.T[turned_rows, turned_columns].sum(), abs=1e-12)


@settings(max_examples=100, deadline=None)
@given(COSTS, st.integers(0, 2**32 - 1))
def test_frames_are_matched_each_for_itself_in_any_order_of_rows(cost, seed):
    rng = np.random.default_rng(seed)
    frame = rng.integers(0, 3, len(cost))
    partner = match_frames(frame, cost, GATE)
    for number in range(3):
        rows = np.flatnonzero(frame == number)
        taken = partner[rows][partner[rows] >= 0]
        assert len(set(taken.tolist())) == len(taken)
        pairs, total = best_by_trying_all(cost[rows], GATE)
        assert len(taken) == pairs
        kept = rows[partner[rows] >= 0]
        assert cost[kept, partner[kept]].sum() == pytest.approx(total, abs=1e-12)


def test_cost_exactly_at_the_gate_matches_and_the_next_number_does_not():
    gate = 0.2
    assert len(match(np.array([[gate]]), gate)[0]) == 1
    assert len(match(np.array([[np.nextafter(gate, 1)]]), gate)[0]) == 0
    at_the_gate = np.array([[gate], [np.nextafter(gate, 1)]])
    assert match_frames(np.array([0, 1]), at_the_gate, gate).tolist() == [0, -1]


def test_nan_never_matches_even_with_an_infinite_gate():
    assert match_frames(np.array([0, 1]), np.array([[np.nan], [1.0]]), np.inf).tolist() == [-1, 0]


def test_a_cheap_pair_gives_way_to_one_more_pair():
    cost = np.array([[0.0, 0.9], [0.9, np.nan]])
    rows, columns = match(cost, GATE)
    assert sorted(zip(rows.tolist(), columns.tolist(), strict=True)) == [(0, 1), (1, 0)]


@pytest.mark.parametrize("scale", [1e-300, 1e-12, 1.0, 1e12, 1e300])
@pytest.mark.parametrize("offset", [0.0, 1.0])
def test_digits_of_the_costs_survive_the_priority_of_the_number_of_pairs(scale, offset):
    # The two full matchings cost 2 * offset + 3 and + 4 units; a forbidden third row makes the penalty matter.
    unit = 1e-9 if offset else 1.0
    cost = (offset + unit * np.array([[1.0, 2.0], [2.0, 2.0], [np.nan, np.nan]])) * scale
    rows, columns = match(cost, gate=10 * scale)
    assert columns[np.argsort(rows)].tolist() == [0, 1]


def test_a_gate_far_above_the_costs_loses_no_digit():
    cost = np.array([[1e-9, 2e-9, 5.0], [2e-9, 2e-9, 5.0]])
    rows, columns = match(cost, gate=1e12)
    assert cost[rows, columns].sum() == pytest.approx(3e-9, rel=1e-6)


@pytest.mark.parametrize("shape", [(0, 0), (0, 3), (3, 0)])
def test_nothing_to_match_gives_no_pairs(shape):
    rows, columns = match(np.zeros(shape), GATE)
    assert len(rows) == len(columns) == 0
    assert match_frames(np.zeros(shape[0], int), np.zeros(shape), GATE).tolist() == [-1] * shape[0]
