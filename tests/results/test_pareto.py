"""Speed against error: the front, and how sure it is."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from uwbbench.results.pareto import front, speed_of
from uwbbench.run.folder.journal import Entry

few = arrays(np.float64, (1, 6), elements=st.sampled_from([0.0, 1.0, 2.0, 3.0]))


@given(few, few)
def test_a_detector_is_on_the_front_if_and_only_if_no_other_beats_it(cost, error) -> None:
    expected = [
        not any(
            cost[0, j] <= cost[0, i]
            and error[0, j] <= error[0, i]
            and (cost[0, j] < cost[0, i] or error[0, j] < error[0, i])
            for j in range(6)
        )
        for i in range(6)
    ]
    assert front(cost, error)[0].tolist() == expected
    assert any(expected)


def test_an_undefined_error_is_never_on_the_front_and_beats_nobody() -> None:
    assert front(np.array([[1.0, 2.0]]), np.array([[math.nan, 5.0]])).tolist() == [[False, True]]


def latency(ratio: float, low: float | None, high: float | None, **facts: object) -> Entry:
    compared = {"reference": "r", "ratio": ratio, "low": low, "high": high, "blocks": 32}
    values = {"p50_us": 100.0, "deadline_us": 1000.0, "ratio_to_reference": compared, **facts}
    return Entry("u", "latency", "d", "s", "c", "done", facts=values)


def test_the_deadline_is_counted_in_times_of_the_reference() -> None:
    speed = speed_of([latency(2.0, 1.9, 2.1)])
    assert speed is not None
    assert speed.deadline == pytest.approx(20.0)  # the detector takes 100 us and twice the reference, so that takes 50
    assert (speed.low, speed.high) == pytest.approx((2 / math.sqrt(2.1 / 1.9), 2 * math.sqrt(2.1 / 1.9)))


def test_several_captures_narrow_the_interval_around_their_geometric_mean() -> None:
    one = speed_of([latency(2.0, 1.6, 2.5)])
    four = speed_of([latency(ratio, ratio * 0.8, ratio * 1.25) for ratio in (1.0, 2.0, 2.0, 4.0)])
    assert one is not None
    assert four is not None
    assert four.ratio == pytest.approx(2.0)
    assert four.spread == pytest.approx(one.spread / 2)


def test_a_comparison_too_short_for_an_interval_has_none() -> None:
    speed = speed_of([latency(2.0, None, None)])
    assert speed is not None
    assert math.isnan(speed.low)
    assert speed.spread == 0.0


def test_a_detector_that_was_never_compared_has_no_speed() -> None:
    assert speed_of([latency(2.0, 1.9, 2.1, ratio_to_reference=None)]) is None
    assert speed_of([]) is None
