"""Anchors and their messages: what is refused, and what is heard in other frames."""

import dataclasses

import numpy as np
import pytest

from tests.api.written import capture_of
from uwbbench.api import Anchors, CaptureError, Messages


def messages(count=5, **parts):
    given = {
        "anchor": np.arange(count),
        "azimuth_rad": np.linspace(-1, 1, count),
        "range_m": np.arange(count) + 1.0,
        "placed": np.zeros(count, bool),
    }
    return Messages(**{**given, **parts})


def anchors(**parts):
    given = {
        "identity": np.array([3, 7]),
        "position_m": np.array([[1.0, 2.0], [3.0, 4.0]]),
        "frame": np.array([0, 2, 2, 3, 5]),
        "messages": messages(),
    }
    return Anchors(**{**given, **parts})


@pytest.mark.parametrize(
    ("parts", "what"),
    [
        ({"range_m": np.zeros(4)}, r"of lengths \[5, 5, 4, 5\]"),
        ({"range_m": np.array([1, 1, np.inf, 1, 1])}, "range_m of message 2 is infinite"),
        (
            {"azimuth_rad": np.full(5, np.nan), "range_m": np.array([1, np.nan, 1, 1, 1])},
            "message 1 needs azimuth_rad or",
        ),
        ({"placed": np.ones(5, bool), "range_m": np.array([1, 1, 1, np.nan, 1])}, "message 3 needs both"),
    ],
)
def test_messages_that_say_nothing_or_the_infinite_are_refused(parts, what):
    with pytest.raises(CaptureError, match=what):
        messages(**parts)


def test_a_message_may_have_only_a_direction_or_only_a_distance():
    assert len(messages(2, azimuth_rad=np.array([0.1, np.nan]), range_m=np.array([np.nan, 2.0]))) == 2


@pytest.mark.parametrize(
    ("parts", "what"),
    [
        ({"identity": np.array([3, 3])}, r"an identity appears twice in \[3, 3\]"),
        ({"position_m": np.zeros((2, 3))}, r"position_m has shape \(2, 3\), expected \(2, 2\)"),
        ({"position_m": np.array([[0, 0], [np.inf, 0]])}, "a place is infinite"),
        ({"frame": np.arange(4)}, "5 messages in 4 frames"),
        ({"frame": np.array([0, 2, 1, 3, 4])}, "frame decreases at message 2"),
    ],
)
def test_anchors_that_contradict_themselves_are_refused(parts, what):
    with pytest.raises(CaptureError, match=what):
        anchors(**parts)


@pytest.mark.parametrize("frame", [[-1, 2, 2, 3, 5], [0, 2, 2, 3, 6]])
def test_a_message_in_a_frame_that_is_not_there_is_refused(frame):
    with pytest.raises(CaptureError, match=r"'run 1': an anchor is heard in frame (-1|6) of 6"):
        capture_of(frames=6, anchors=anchors(frame=np.array(frame)))


def test_messages_follow_their_frames_into_another_capture():
    other = anchors().of_frames(np.array([2, 4, 3, 3, -1, 0]))
    assert other.frame.tolist() == [0, 0, 2, 3, 5]
    assert other.messages.anchor.tolist() == [1, 2, 3, 3, 0]
    assert other.messages.range_m.tolist() == [2.0, 3.0, 4.0, 4.0, 1.0]
    assert other.identity.tolist() == [3, 7]


def test_frames_say_what_was_heard_in_them():
    assert [anchors().heard_in(frame).anchor.tolist() for frame in range(6)] == [[0], [], [1, 2], [3], [], [4]]


@pytest.mark.parametrize("name", ["identity", "position_m", "frame", "anchor", "azimuth_rad", "range_m", "placed"])
def test_a_captures_hash_tells_of_its_anchors(name):
    whole = anchors(messages=messages(azimuth_rad=np.zeros(5)))
    if hasattr(whole, name):
        other = dataclasses.replace(whole, **{name: getattr(whole, name) * 2 // 2 + (name != "frame")})
        other = dataclasses.replace(other, frame=np.array([0, 2, 2, 3, 4])) if name == "frame" else other
    else:
        values = getattr(whole.messages, name)
        changed = ~values if values.dtype == bool else values + 1
        other = dataclasses.replace(whole, messages=dataclasses.replace(whole.messages, **{name: changed}))
    hashes = {capture_of(anchors=one).sha256 for one in (None, whole, other)}
    assert len(hashes) == 3
