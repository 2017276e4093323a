"""What the timed loops hand to a detector."""

import gc

import numpy as np

from uwbbench.api import Capture
from uwbbench.pipeline import detector_from_yaml, load_detector
from uwbbench.timing import loops


class Counting:
    """A stream that notes what it is given."""

    def __init__(self) -> None:
        self.given: list[tuple[int, int]] = []
        self.fresh = True

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


def test_blocks_alternate_and_cover_the_same_frames(approach: Capture) -> None:
    pipeline = load_detector("null")
    first_s, second_s = loops.alternating(pipeline, pipeline, approach, approach.frames(0, 100))
    assert len(first_s) == len(second_s) == 100 // 3  # at least 32 blocks
    assert np.all(first_s > 0)
    assert np.all(second_s > 0)


def test_one_frame_is_enough_to_compare(approach: Capture) -> None:
    pipeline = load_detector("null")
    first_s, _ = loops.alternating(pipeline, pipeline, approach, approach.frames(0, 1))
    assert len(first_s) == 1


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
            stage = stream._stages[0].stage
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
