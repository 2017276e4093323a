"""What the timed loops hand to a detector."""

import gc
import itertools

import numpy as np
import pytest

from uwbbench.api import Capture
from uwbbench.detect.pipeline import detector_from_yaml, load_detector
from uwbbench.measure.latency import loops


class Counting:
    """A stream that notes what it is given."""

    def __init__(self) -> None:
        self.given: list[tuple[int, int]] = []
        self.fresh = True

    def flush(self) -> None:
        pass

    def step(self, frames: object) -> None:
        self.given.append((frames.first, len(frames)))  # type: ignore[attr-defined]
        self.fresh &= "amplitude" not in vars(frames)
        frames.amplitude  # type: ignore[attr-defined]  # noqa: B018 - remembered by the frames from now on


def test_every_frame_is_one_call_in_order(approach: Capture) -> None:
    stream = Counting()
    times_us = loops.call_times_us(stream, loops.cut(approach.frames(0, 30), 1))  # type: ignore[arg-type]
    assert stream.given == [(index, 1) for index in range(30)]
    assert len(times_us) == 30
    assert np.all(times_us > 0)


def test_a_second_pass_profits_nothing_from_the_first(approach: Capture) -> None:
    whole = approach.frames(0, 10)
    for _ in range(2):
        stream = Counting()
        loops.call_times_us(stream, loops.cut(whole, 3))  # type: ignore[arg-type]
        assert stream.fresh


def test_a_detector_that_looks_up_the_truth_gets_the_old_numbers_again(approach: Capture) -> None:
    whole = approach.frames(5, 12)
    frames = list(itertools.islice(loops.endless(whole, 0.5, renumbered=False), 30))
    assert [one.first for one in frames] == [5 + index % 7 for index in range(30)]
    oracle = load_detector("oracle").open(approach)
    assert sum(len(oracle.step(one)) for one in frames) == 30


def test_endless_frames_go_on_as_one_recording(approach: Capture) -> None:
    whole = approach.frames(5, 12)
    frames = list(itertools.islice(loops.endless(whole, 0.5), 30))
    assert [one.first for one in frames] == list(range(5, 35))
    assert {len(one) for one in frames} == {1}
    times_s = np.array([one.timestamp_s[0] for one in frames])
    assert np.all(np.diff(times_s) > 0)
    assert times_s[7] - times_s[6] == pytest.approx(0.5)
    assert np.array_equal(frames[17].preamble, whole.preamble[3:4])


@pytest.mark.parametrize("count", [1, 6])
def test_a_warm_up_of_few_frames_comes_to_an_end(approach: Capture, count: int) -> None:
    assert loops.warm_up(load_detector("null"), approach, approach.frames(0, count), 2) in (True, False)


def test_a_batch_covers_all_frames_and_its_warm_up_is_not_among_the_times(approach: Capture) -> None:
    opened: list[Counting] = []

    class Opens:
        def open(self, _: Capture) -> Counting:
            opened.append(Counting())
            return opened[-1]

    times_us = loops.batch_times_us(Opens(), approach, approach.frames(0, 7), repeats=3)  # type: ignore[arg-type]
    assert len(times_us) == 3
    assert [stream.given for stream in opened] == [[(0, 7)]] * 4


def test_reading_the_clock_takes_time() -> None:
    assert 0 < loops.clock_us() < 1e3


def test_the_garbage_collector_comes_back(approach: Capture) -> None:
    assert gc.isenabled()
    with loops.quiet():
        assert not gc.isenabled()
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0


def test_calls_that_cluster_are_marked_where_a_stage_counts_them(approach: Capture) -> None:
    pipeline = detector_from_yaml("schema: 1\nname: n\npipeline:\n  - {use: reference.nothing}\n")
    whole = approach.frames(0, 6)
    assert loops.stream_pass(pipeline, approach, whole)[1] is None

    class Opens:
        def open(self, capture: Capture) -> object:
            stream = pipeline.open(capture)
            stage = stream.stages[0]
            stage.clusterings = 0
            step = stage.step

            def counting(block: object) -> object:
                stage.clusterings += block.frames.first % 3 == 0  # type: ignore[attr-defined]
                return step(block)

            stage.step = counting  # type: ignore[method-assign,assignment]
            return stream

    clustered = loops.stream_pass(Opens(), approach, whole)[1]  # type: ignore[arg-type]
    assert clustered is not None
    assert clustered.tolist() == [True, False, False, True, False, False]
