"""Anchors in capture files: written and read back, and what is refused."""

import dataclasses

import h5py
import numpy as np
import pytest

from tests.api.test_anchors import anchors, messages
from tests.api.written import capture_of
from uwbbench.api import CaptureError, open_capture, write_capture

HEARD = "/receivers/front/anchors"


@pytest.fixture
def path(tmp_path):
    write_capture(tmp_path / "run.h5", capture_of(anchors=anchors()))
    return tmp_path / "run.h5"


def test_anchors_come_back_exactly(tmp_path):
    said = messages(azimuth_rad=np.array([0.1, np.nan, 0.3, 0.4, 0.5]), placed=np.array([1, 0, 0, 0, 0], bool))
    known = np.array([[1.0, 2.0], [np.nan, np.nan]])
    written = capture_of(anchors=anchors(messages=said, position_m=known))
    write_capture(tmp_path / "run.h5", written)
    read = open_capture(tmp_path / "run.h5")
    assert read.sha256 == written.sha256
    assert read.anchors.messages.placed.dtype == bool
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["format_version"] == "1.3"


def test_an_empty_list_of_anchors_is_not_none(tmp_path):
    nobody = anchors(
        identity=np.zeros(0, int), position_m=np.zeros((0, 2)), frame=np.zeros(0, int), messages=messages(0)
    )
    write_capture(tmp_path / "run.h5", capture_of(anchors=nobody))
    assert len(open_capture(tmp_path / "run.h5").anchors.identity) == 0


def test_each_receiver_has_messages_of_its_own(tmp_path):
    other = anchors(messages=messages(range_m=np.full(5, 9.0)))
    several = capture_of(receiver="a", anchors=anchors()), capture_of(receiver="b", anchors=other)
    write_capture(tmp_path / "run.h5", *several, capture_of(receiver="c"))
    read = {name: open_capture(tmp_path / "run.h5", name).anchors for name in "abc"}
    assert read["a"].messages.range_m.tolist() == [1, 2, 3, 4, 5]
    assert read["b"].messages.range_m.tolist() == [9] * 5
    assert read["c"] is None


def test_receivers_that_disagree_about_places_are_not_written(tmp_path):
    moved = dataclasses.replace(anchors(), position_m=np.zeros((2, 2)))
    with pytest.raises(CaptureError, match="'a' and 'b' are not of one run: they differ in anchors"):
        write_capture(
            tmp_path / "run.h5", capture_of(receiver="a", anchors=anchors()), capture_of(receiver="b", anchors=moved)
        )


def test_files_without_anchors_are_those_of_before(tmp_path):
    write_capture(tmp_path / "run.h5", capture_of())
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["format_version"] == "1.0"
        assert "anchors" not in file
    assert open_capture(tmp_path / "run.h5").anchors is None


def put(where, data):
    def spoil(file):
        del file[where]
        if data is not None:
            file[where] = data

    return spoil


SPOILT = {
    "no places": (put("/anchors", None), f"/anchors: missing, though {HEARD} has messages"),
    "no identities": (put("/anchors/identity", None), "/anchors/identity: array missing"),
    "identities in text": (put("/anchors/identity", "abc"), "/anchors/identity: expected int64, found object"),
    "twice one identity": (
        put("/anchors/identity", [3, 3]),
        rf"{HEARD}: anchors: an identity appears twice in \[3, 3\]",
    ),
    "places in space": (put("/anchors/position_m", np.zeros((2, 3))), r"anchors: position_m has shape \(2, 3\)"),
    "an infinite place": (put("/anchors/position_m", [[0, 0], [np.inf, 0]]), "anchors: a place is infinite"),
    "no azimuths": (put(f"{HEARD}/azimuth_rad", None), f"{HEARD}/azimuth_rad: array missing"),
    "a table of azimuths": (put(f"{HEARD}/azimuth_rad", np.zeros((5, 2))), r"one value a row, found shape \(5, 2\)"),
    "too few distances": (put(f"{HEARD}/range_m", np.zeros(4)), f"{HEARD}: messages: columns .* of lengths"),
    "an infinite distance": (put(f"{HEARD}/range_m", np.full(5, np.inf)), f"{HEARD}: messages: range_m of message 0"),
    "fractions of frames": (put(f"{HEARD}/frame", np.zeros(5)), f"{HEARD}/frame: expected int64, found float64"),
    "frames that go back": (put(f"{HEARD}/frame", [0, 2, 1, 3, 4]), f"{HEARD}: anchors: frame decreases at message 2"),
    "a frame too many": (put(f"{HEARD}/frame", [0, 2, 2, 3, 6]), "an anchor is heard in frame 6 of 6"),
    "placed by two": (put(f"{HEARD}/placed", [0, 2, 0, 0, 0]), f"{HEARD}/placed: expected 0 or 1"),
    "an array for the group": (put(HEARD, [1, 2]), f"{HEARD}.*"),
}


@pytest.mark.parametrize("what", SPOILT)
def test_what_cannot_be_is_refused_with_its_place_in_the_file(path, what):
    spoil, message = SPOILT[what]
    with h5py.File(path, "a") as file:
        spoil(file)
    with pytest.raises(CaptureError, match=rf"run\.h5: .*{message}"):
        open_capture(path)
