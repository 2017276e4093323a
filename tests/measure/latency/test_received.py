"""Frames as a radio hands them over."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from uwbbench.api import Anchors, Capture, Messages, open_capture, write_capture
from uwbbench.detect.pipeline import load_detector
from uwbbench.measure.latency.received import laps, received


def test_received_frames_are_those_of_the_capture(approach: Capture) -> None:
    frames = received(approach, 10)
    assert (len(frames), frames.truth) == (10, None)
    for sts in (True, False):
        one, other = frames.frames(4, 5, sts=sts), approach.frames(4, 5, sts=sts)
        assert vars(one).keys() == vars(other).keys()
        for name, value in vars(other).items():
            assert_array_equal(getattr(one, name), value, err_msg=name)


def test_samples_of_a_file_are_in_memory_as_they_are_stored(approach: Capture, tmp_path) -> None:
    write_capture(tmp_path / "a.h5", approach)
    frames = received(open_capture(tmp_path / "a.h5"), 5)
    assert isinstance(frames.preamble, np.ndarray)
    assert not isinstance(frames.preamble, np.memmap)
    assert frames.preamble.dtype == np.asarray(approach.preamble[:1]).dtype


def test_laps_go_on_as_one_recording(approach: Capture) -> None:
    source, numbers = laps(received(approach, 7), 30)
    frames = [source.frames(number, number + 1) for number in numbers]
    assert [one.first for one in frames] == list(range(30))
    assert {len(one) for one in frames} == {1}
    times_s = np.array([one.timestamp_s[0] for one in frames])
    assert np.all(np.diff(times_s) > 0)
    assert times_s[7] - times_s[6] == pytest.approx(1 / approach.radar.frame_rate_hz)
    assert_array_equal(frames[17].preamble, approach.frames(3, 4).preamble)
    assert_array_equal(frames[17].sts1, approach.frames(3, 4).sts1)


def test_messages_of_anchors_stay_with_their_frames_lap_by_lap(approach: Capture) -> None:
    none = np.full(3, np.nan)
    said = Messages(np.array([1, 1, 1]), none, np.array([2.0, 3.0, 4.0]), np.zeros(3, bool))
    anchors = Anchors(np.array([1]), np.zeros((1, 2)), np.array([2, 4, 90]), said)
    source, _ = laps(received(replace(approach, anchors=anchors), 7), 16)
    assert source.anchors is not None
    assert source.anchors.frame.tolist() == [2, 4, 9, 11]
    assert source.anchors.messages.range_m.tolist() == [2.0, 3.0, 2.0, 3.0]


def test_a_detector_that_looks_up_the_truth_gets_the_old_numbers_again(approach: Capture) -> None:
    source, numbers = laps(received(approach, 7), 30, renumbered=False)
    oracle = load_detector("oracle").open(approach)
    assert numbers == [index % 7 for index in range(30)]
    assert sum(len(oracle.step(source.frames(number, number + 1))) for number in numbers) == 30
