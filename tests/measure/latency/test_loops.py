"""What the timed loops hand to a detector."""

import dataclasses
import gc

import numpy as np
import pytest

from uwbbench.api import Capture, Detections, Frames, analytic
from uwbbench.detect.pipeline import detector_from_yaml, load_detector
from uwbbench.measure.latency import loops
from uwbbench.measure.latency.received import received


class Counting:
    """A stream that notes what it is given."""

    needs: frozenset[str] = frozenset()
    stages = ()

    def __init__(self) -> None:
        self.given: list[tuple[int, int]] = []
        self.fresh = True

    def flush(self) -> Detections:
        return Detections.empty()

    def step(self, frames: object) -> Detections:
        self.given.append((frames.first, len(frames)))  # type: ignore[attr-defined]
        self.fresh &= "amplitude" not in vars(frames)
        frames.amplitude  # type: ignore[attr-defined]  # noqa: B018 - remembered by the frames from now on
        return Detections.empty()


def test_every_frame_is_one_call_in_order(approach: Capture) -> None:
    stream = Counting()
    passed = loops.timed_calls(stream, received(approach), 0, 30)  # type: ignore[arg-type]
    assert stream.given == [(index, 1) for index in range(30)]
    assert len(passed.times_us) == len(passed.step_us) == 30
    assert np.all(passed.step_us > 0)


def test_a_second_pass_profits_nothing_from_the_first(approach: Capture) -> None:
    frames = received(approach, 10)
    for _ in range(2):
        stream = Counting()
        loops.timed_calls(stream, frames, 0, 10)  # type: ignore[arg-type]
        assert stream.fresh


def test_real_samples_become_analytic_inside_the_call(approach: Capture) -> None:
    radar = dataclasses.replace(approach.radar, samples="rf", has_sts=False, has_first_path=False)
    none = dict.fromkeys(("sts1", "sts2", "first_path_index", "first_path_index_sts1", "first_path_index_sts2"))
    real = np.real(approach.preamble[:]).copy()
    capture = dataclasses.replace(approach, radar=radar, preamble=real, **none)  # type: ignore[arg-type]
    frames = received(capture, 8)
    assert not np.iscomplexobj(frames.preamble)  # what is in memory before the clock starts
    stepped: list[np.ndarray] = []

    class Keeping(Counting):
        def step(self, block: Frames) -> Detections:  # type: ignore[override]
            stepped.append(block.preamble)
            return super().step(block)

    loops.timed_calls(Keeping(), frames, 0, 8)  # type: ignore[arg-type]
    np.testing.assert_array_equal(np.concatenate(stepped), analytic(real[:8]))


def test_the_step_is_a_part_of_the_way_from_samples_to_rows(approach: Capture) -> None:
    passed = loops.stream_pass(load_detector("paper-filtering"), approach, received(approach))
    assert np.all(passed.step_us < passed.times_us)
    assert passed.flush_us > 0


@pytest.mark.parametrize("count", [1, 6])
def test_a_warm_up_of_few_frames_comes_to_an_end(approach: Capture, count: int) -> None:
    assert loops.warm_up(load_detector("null"), approach, received(approach, count), 2) in (True, False)


def test_a_batch_covers_all_frames_and_its_warm_up_is_not_among_the_times(approach: Capture) -> None:
    opened: list[Counting] = []

    class Opens:
        def open(self, _: Capture) -> Counting:
            opened.append(Counting())
            return opened[-1]

    times_us = loops.batch_times_us(Opens(), approach, received(approach, 7), repeats=3)  # type: ignore[arg-type]
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
    frames = received(approach, 6)
    assert loops.stream_pass(pipeline, approach, frames).clustered is None

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

    clustered = loops.stream_pass(Opens(), approach, frames).clustered  # type: ignore[arg-type]
    assert clustered is not None
    assert clustered.tolist() == [True, False, False, True, False, False]
