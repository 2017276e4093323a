"""The background of a capture: of the same radar, and part of the capture's content."""

import dataclasses

import numpy as np
import pytest

from tests.api.written import capture_of
from uwbbench.api import CaptureError


def background_of(capture, **radar):
    other = capture_of(frames=4, receiver=capture.radar.receiver)
    return dataclasses.replace(
        other, name="empty", truth=None, radar=dataclasses.replace(other.radar, **radar), background=None
    )


def test_a_background_may_have_other_frames_and_another_frame_rate():
    capture = capture_of()
    background = background_of(capture, frame_rate_hz=20.0)
    assert dataclasses.replace(capture, background=background).background is background


def test_numbers_that_a_file_has_rounded_are_the_same_radar():
    capture = capture_of()
    background = background_of(capture, sample_interval_s=float(np.float32(1e-9)), mount_yaw_rad=float(np.float32(0.4)))
    assert dataclasses.replace(capture, background=background).background is background


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("model", "other", "model 'other' instead of 'test'"),
        ("channel", 5, "channel 5 instead of 9"),
        ("sample_interval_s", 1.1e-9, "sample_interval_s 1.1e-09 instead of 1e-09"),
        ("mount_position_m", (0.1, 0.2, 0.0), r"mount_position_m \(0.1, 0.2, 0.0\) instead of \(0.1, 0.2, 0.3\)"),
        ("tx_position_m", (0.0, 0.25, 0.0), "tx_position_m"),
        ("receiver", "left", "receiver 'left' instead of 'front'"),
        ("first_tap_delay_s", 1e-9, "first_tap_delay_s 1e-09 instead of None"),
    ],
)
def test_a_background_of_another_radar_is_refused_with_what_differs(name, value, said):
    capture = capture_of()
    with pytest.raises(CaptureError, match=f"'empty' cannot be its background: it is of another radar.*{said}"):
        dataclasses.replace(capture, background=background_of(capture, **{name: value}))


def test_a_background_without_frames_or_with_one_of_its_own_is_refused():
    capture = capture_of()
    empty = capture_of(frames=0)
    with pytest.raises(CaptureError, match="it has no frames"):
        dataclasses.replace(capture, background=empty)
    with pytest.raises(CaptureError, match="it has a background itself"):
        dataclasses.replace(capture, background=dataclasses.replace(capture, background=background_of(capture)))


def test_a_background_is_part_of_the_content_and_a_capture_without_one_keeps_its_hash():
    capture = capture_of()
    one, other = background_of(capture), background_of(capture)
    other = dataclasses.replace(other, preamble=np.asarray(other.preamble) + 1)
    hashes = {dataclasses.replace(capture, background=each).sha256 for each in (None, one, other)}
    assert len(hashes) == 3
    assert capture.sha256 == "9c8c062bfa052a55f163452e15492a14198445a8a7a520f9810de32c9782acb8"
