"""Frames handed out at a fixed rate."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uwbbench.api import Capture, Detections
from uwbbench.measure.latency import paced
from uwbbench.measure.latency.paced import paced_pass, paced_summary, responses_us
from uwbbench.measure.latency.received import received


class Clock:
    """Time that nothing but the loop and its detector takes: a reading 1 us, and sleeps end 50 us late."""

    def __init__(self) -> None:
        self.now_ns = 0

    def reading_ns(self) -> int:
        self.now_ns += 1000
        return self.now_ns

    def sleep(self, seconds: float) -> None:
        self.now_ns += int(seconds * 1e9) + 50_000


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """The clock that the loop looks at: on a busy machine, any two lines may lie milliseconds apart."""
    made = Clock()
    monkeypatch.setattr(paced, "perf_counter_ns", made.reading_ns)
    monkeypatch.setattr(paced, "time", made)
    return made


class Noting:
    """A detector that notes when it was called, and takes its time."""

    needs: frozenset[str] = frozenset()

    def __init__(self, clock: Clock, takes_s: float = 0.0) -> None:
        self.clock, self.takes_s = clock, takes_s
        self.called_s: list[float] = []
        self.frames: list[int] = []

    def open(self, _: Capture) -> "Noting":
        return self

    def step(self, frames: object) -> Detections:
        self.called_s.append(self.clock.now_ns * 1e-9)
        self.frames.append(frames.first)  # type: ignore[attr-defined]
        self.clock.now_ns += int(self.takes_s * 1e9)
        return Detections.empty()


def test_every_frame_is_handed_out_once_and_never_before_it_is_due(approach: Capture, clock: Clock) -> None:
    detector = Noting(clock)
    times_us, lateness_us = paced_pass(detector, approach, received(approach, 20), 500.0, 0.1)  # type: ignore[arg-type]
    assert len(times_us) == len(lateness_us) == 50
    assert detector.frames == list(range(50))
    assert np.all(times_us > 0)
    assert np.all(lateness_us >= 0)
    # The first call may be late, and with it what follows seem early, by no more than the lateness that was noted.
    since_s = np.array(detector.called_s) - detector.called_s[0] + lateness_us[0] * 1e-6
    assert np.all(since_s >= np.arange(50) / 500.0 - 1e-9)
    assert np.all(since_s <= np.arange(50) / 500.0 + 1e-5)


def test_a_detector_too_slow_for_the_rate_misses_deadlines_and_the_harness_is_not_blamed(
    approach: Capture, clock: Clock
) -> None:
    found = paced_pass(Noting(clock, 0.004), approach, received(approach, 20), 500.0, 0.04)  # type: ignore[arg-type]
    summary = paced_summary(*found, 500.0)
    assert (summary["n"], summary["missed"], summary["longest_burst"]) == (20, 20, 20)
    assert summary["p50_period_share"] >= 2.0
    # Every start waits for the call before it: the detector's doing.
    assert summary["lateness_p50_us"] < summary["p50_us"]


def test_a_late_start_of_the_harness_is_no_missed_deadline() -> None:
    lateness_us = np.zeros(400)
    lateness_us[7] = 5000.0
    summary = paced_summary(np.ones(400), lateness_us, 1000.0)
    assert (summary["missed"], summary["late_starts"], summary["lateness_max_us"]) == (0, 1, 5000.0)
    assert summary["p99_period_share"] == pytest.approx(1e-3)
    assert 0 < summary["missed_share_high"] < 0.01


def test_frames_that_wait_behind_a_slow_one_miss_their_deadlines_too() -> None:
    times_us = np.array([1.0, 25.0, 1.0, 1.0, 1.0])
    assert responses_us(times_us, 10.0).tolist() == [1.0, 25.0, 16.0, 7.0, 1.0]
    summary = paced_summary(times_us, np.zeros(5), 1e5)
    assert (summary["missed"], summary["longest_burst"]) == (2, 2)
    assert summary["max_us"] == 25.0


@given(st.lists(st.floats(0.0, 50.0), min_size=1, max_size=40))
def test_responses_are_those_of_a_queue_played_through(calls: list[float]) -> None:
    free = 0.0
    expected = []
    for number, call in enumerate(calls):
        free = max(free, 10.0 * number) + call
        expected.append(free - 10.0 * number)
    assert responses_us(np.array(calls), 10.0) == pytest.approx(expected)
