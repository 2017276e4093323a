"""Whole distributions, thinned to what a chart can show."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uwbbench.results.curves import MOST_POINTS, ErrorCurve, error_axis, tail_curve

times = st.lists(st.floats(0.1, 1e6), min_size=1, max_size=500).map(np.array)


@given(times)
def test_each_point_tells_how_many_calls_are_as_slow(times_us) -> None:
    slow_us, share = tail_curve(times_us)
    assert 0 < len(slow_us) <= MOST_POINTS
    assert slow_us[-1] == times_us.max()
    assert share[-1] == pytest.approx(1 / len(times_us))
    assert slow_us[0] == times_us.min()
    assert share[0] == 1.0
    assert (np.diff(slow_us) >= 0).all()
    for time, part in zip(slow_us, share, strict=True):
        assert np.mean(times_us > time) < part <= np.mean(times_us >= time) + 1e-12


def test_nothing_timed_is_an_empty_curve() -> None:
    slow_us, share = tail_curve(np.empty(0))
    assert len(slow_us) == len(share) == 0


def curve(*error_m: float) -> ErrorCurve:
    return ErrorCurve(np.array(error_m), np.arange(1, len(error_m) + 1) / len(error_m), len(error_m), 0.0, 0.0, 0.0)


def test_an_axis_of_errors_is_logarithmic_where_the_curves_are_far_apart() -> None:
    assert error_axis([curve(0.0, 0.1), curve(0.2)]) == (0.0, pytest.approx(0.3), False)
    assert error_axis([curve(0.0, 0.01), curve(1.0)]) == (0.001, pytest.approx(1.5), True)
    assert error_axis([curve(0.0)]) == (0.0, 0.001, False)
