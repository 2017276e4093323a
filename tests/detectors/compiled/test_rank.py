"""Values in order: as numpy has them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from uwbbench_detectors.compiled.rank import median, smallest, sort

values = arrays(np.float64, st.integers(1, 40), elements=st.floats(-5, 5, width=16) | st.just(np.inf))


@given(values, st.data())
def test_the_value_of_a_rank_is_the_one_at_its_place_in_order(given_values, data):
    place = data.draw(st.integers(0, len(given_values) - 1))
    assert smallest(given_values.copy(), place) == np.sort(given_values)[place]


@given(values)
def test_the_median_is_that_of_numpy(given_values):
    assert median(given_values.copy()) == np.median(given_values)


def test_no_values_have_no_median():
    assert np.isnan(median(np.empty(0)))


@given(values)
def test_sorting_is_that_of_numpy(given_values):
    ordered = given_values.copy()
    sort(ordered)
    np.testing.assert_array_equal(ordered, np.sort(given_values))
