"""Two detectors that take turns: who goes when, and what is made of the blocks."""

import contextlib
import itertools
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uwbbench.api import Capture
from uwbbench.detect.pipeline import load_detector
from uwbbench.measure.latency import pairing
from uwbbench.measure.latency.pairing import alternating, ratio_summary


class Recording:
    """A detector that notes whose turn it is and on which frame, in a list that several share."""

    def __init__(self, name: str, log: list[tuple[str, int]]) -> None:
        self.name, self.log = name, log

    def open(self, _: Capture) -> "Recording":
        return self

    def step(self, frames: object) -> None:
        self.log.append((self.name, frames.first))  # type: ignore[attr-defined]


@pytest.fixture
def one_frame_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks of two frames, whatever the detectors take."""
    monkeypatch.setattr(pairing, "_call_s", lambda *_: 1.0)


def test_blocks_are_abba_and_baab_in_turn(approach: Capture, one_frame_parts: None) -> None:
    log: list[tuple[str, int]] = []
    first, second = Recording("A", log), Recording("B", log)
    turns = alternating(first, second, approach, approach.frames(0, 8), blocks=1)  # type: ignore[arg-type]
    assert "".join(name for name, _ in log[:16]) == "ABBABAABABBABAAB"
    assert [frame for _, frame in log[:16]] == [frame for frame in range(8) for _ in "AB"]
    assert len(turns.first_s) == len(turns.second_s) == len(turns.waited_s) == 4


def test_a_short_capture_is_passed_until_there_are_enough_blocks(approach: Capture, one_frame_parts: None) -> None:
    log: list[tuple[str, int]] = []
    first, second = Recording("A", log), Recording("B", log)
    turns = alternating(first, second, approach, approach.frames(0, 3), blocks=20)  # type: ignore[arg-type]
    assert len(turns.first_s) >= 20
    assert len(log) % 6 == 0  # whole passes
    assert sorted(log[:6]) == [(name, frame) for name in "AB" for frame in range(3)]


@pytest.mark.parametrize("frames", [1, 2, 100])
def test_there_are_enough_blocks_however_few_the_frames(approach: Capture, frames: int) -> None:
    pipeline = load_detector("null")
    turns = alternating(pipeline, pipeline, approach, approach.frames(0, frames))
    assert len(turns.first_s) >= pairing.MINIMUM_BLOCKS
    assert np.all(turns.first_s > 0)
    assert np.all(turns.second_s > 0)


def test_time_in_which_others_had_the_core_is_left_out(
    approach: Capture, one_frame_parts: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    waited_ns = 0

    @contextlib.contextmanager
    def waits() -> Iterator[Callable[[], int]]:
        yield lambda: waited_ns

    class Interrupted(Recording):
        """Takes 20 ms of every call, of which the core is said to be lost for 15."""

        def step(self, frames: object) -> None:
            nonlocal waited_ns
            super().step(frames)
            time.sleep(0.02)
            waited_ns += 15_000_000

    monkeypatch.setattr(pairing, "core_waits", waits)
    whole = approach.frames(0, 8)
    turns = alternating(Interrupted("A", []), Recording("B", []), approach, whole, blocks=4)  # type: ignore[arg-type]
    assert turns.waited_s == pytest.approx(0.03)
    assert np.all(turns.first_s >= 0.0099)
    assert np.all(turns.second_s > 0)


def test_a_wait_longer_than_what_was_timed_is_none_of_it(
    approach: Capture, one_frame_parts: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    seconds = itertools.count()

    @contextlib.contextmanager
    def waits() -> Iterator[Callable[[], int]]:
        yield lambda: next(seconds) * 10**9

    monkeypatch.setattr(pairing, "core_waits", waits)
    log: list[tuple[str, int]] = []
    whole = approach.frames(0, 8)
    turns = alternating(Recording("A", log), Recording("B", log), approach, whole, blocks=4)  # type: ignore[arg-type]
    assert np.all(turns.first_s > 0)
    assert np.all(turns.second_s > 0)


def test_a_drift_of_the_machine_cancels_in_the_ratio() -> None:
    drift = np.linspace(1.0, 5.0, 40)
    found = ratio_summary(3.0 * drift, 2.0 * drift)
    assert (found["ratio"], found["low"], found["high"]) == pytest.approx((1.5, 1.5, 1.5))
    assert (found["total_ratio"], found["total_low"], found["total_high"]) == pytest.approx((1.5, 1.5, 1.5))
    assert found["blocks"] == 40


def test_a_ratio_of_few_blocks_has_no_interval() -> None:
    found = ratio_summary(np.full(7, 2.0), np.ones(7))
    assert {found[key] for key in ("low", "high", "total_low", "total_high")} == {None}
    assert found["ratio"] == found["total_ratio"] == pytest.approx(2.0)


def test_rare_expensive_blocks_count_in_the_ratio_of_all_time_alone() -> None:
    ours_s = np.ones(40)
    ours_s[::10] = 11.0
    found = ratio_summary(ours_s, np.ones(40))
    assert (found["ratio"], found["low"], found["high"]) == (1.0, 1.0, 1.0)
    assert found["total_ratio"] == pytest.approx(2.0)
    assert found["total_low"] < 2.0 < found["total_high"]


times = st.lists(st.floats(1e-6, 10.0), min_size=8, max_size=60)


@given(times, st.floats(0.1, 10.0))
def test_the_interval_holds_the_ratio_and_scales_with_it(reference: list[float], factor: float) -> None:
    ours_s, reference_s = np.array(reference[::-1]), np.array(reference)
    found, scaled = ratio_summary(ours_s, reference_s), ratio_summary(factor * ours_s, reference_s)
    for name, low, high in (("ratio", "low", "high"), ("total_ratio", "total_low", "total_high")):
        assert found[low] <= found[high]
        for key in (name, low, high):
            assert scaled[key] == pytest.approx(factor * found[key])


@pytest.mark.parametrize("call_s", [1e-6, 1e-5, 1e-3, 0.1])
def test_a_block_lasts_a_millisecond_or_as_long_as_the_capture_allows(
    approach: Capture, monkeypatch: pytest.MonkeyPatch, call_s: float
) -> None:
    monkeypatch.setattr(pairing, "_call_s", lambda *_: call_s)
    cuts: list[int] = []
    cut: Callable[..., object] = pairing.cut
    monkeypatch.setattr(pairing, "cut", lambda whole, size: (cuts.append(len(whole)), cut(whole, size))[1])
    log: list[tuple[str, int]] = []
    whole = approach.frames(0, 40)
    alternating(Recording("A", log), Recording("B", log), approach, whole, blocks=1)  # type: ignore[arg-type]
    assert set(cuts) == {min(40, max(1, round(0.5e-3 / call_s)))}
