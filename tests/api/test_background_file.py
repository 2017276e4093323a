"""Backgrounds in capture files: in a group of the file, or in a file beside it."""

import dataclasses

import h5py
import numpy as np
import pytest

from tests.api.written import capture_of
from uwbbench.api import CaptureError, Obstacle, Truth, open_capture, write_capture

PLACE = "/backgrounds/front"


def background_of(capture, frames=4, seed=0, **parts):
    rng = np.random.default_rng(seed)
    other = capture_of(frames=frames, receiver=capture.radar.receiver, source=capture.source)
    wall = Truth((Obstacle("wall", "brick", np.array([[5.0, -1], [5, 1]]), structure=True),))
    samples = (rng.normal(size=(frames, 5)) + 1j * rng.normal(size=(frames, 5))).astype(np.complex64)
    radar = dataclasses.replace(other.radar, frame_rate_hz=20.0)
    given = {"name": "empty", "truth": wall, "radar": radar, "preamble": samples, "description": "nothing there"}
    return dataclasses.replace(other, **{**given, **parts})


def with_background(receiver="front", **parts):
    capture = capture_of(receiver=receiver)
    return dataclasses.replace(capture, background=background_of(capture, **parts))


@pytest.fixture
def path(tmp_path):
    write_capture(tmp_path / "run.h5", with_background())
    return tmp_path / "run.h5"


def test_a_background_comes_back_exactly(path):
    written, read = with_background(), open_capture(path)
    assert read.sha256 == written.sha256
    assert read.background.sha256 == written.background.sha256
    for name in ("name", "description", "recording", "radar", "source"):
        assert getattr(read.background, name) == getattr(written.background, name)
    with h5py.File(path) as file:
        assert file.attrs["format_version"] == "1.2"
        assert file["receivers/front"].attrs["background"] == PLACE


def test_each_receiver_has_a_background_of_its_own(tmp_path):
    first, second = with_background("a", seed=1), with_background("b", seed=2)
    write_capture(tmp_path / "run.h5", first, second, capture_of(receiver="c"))
    assert open_capture(tmp_path / "run.h5", "a").background.sha256 == first.background.sha256
    assert open_capture(tmp_path / "run.h5", "b").background.sha256 == second.background.sha256
    assert open_capture(tmp_path / "run.h5", "c").background is None


def test_a_background_without_truth_or_texts_takes_what_the_file_says(path):
    with h5py.File(path, "a") as file:
        del file[f"{PLACE}/truth"]
        for name in ("name", "frame_rate_hz", "description", "recording"):
            del file[PLACE].attrs[name]
    background = open_capture(path).background
    assert (background.name, background.truth, background.radar.frame_rate_hz) == ("run 1 background", None, 50.0)
    assert background.recording == "run 1"


def beside(tmp_path, name, background):
    write_capture(tmp_path / "run.h5", capture_of())
    write_capture(tmp_path / background, *(background_of(capture_of()),))
    with h5py.File(tmp_path / "run.h5", "a") as file:
        file["receivers/front"].attrs["background"] = name
    return tmp_path / "run.h5"


def test_a_background_may_lie_in_a_file_beside(tmp_path):
    path = beside(tmp_path, "rooms/empty.h5", "rooms/empty.h5")
    assert open_capture(path).background.name == "empty"


def test_a_file_whose_own_background_leads_back_is_read_without_end(tmp_path):
    path = beside(tmp_path, "empty.h5", "empty.h5")
    with h5py.File(tmp_path / "empty.h5", "a") as file:
        file["receivers/front"].attrs["background"] = "run.h5"
    assert open_capture(path).background.background is None


@pytest.mark.parametrize("name", ["../other/empty.h5", "/somewhere/empty.h5", "link/empty.h5"])
def test_a_background_outside_the_files_folder_is_refused(tmp_path, name):
    (tmp_path / "other").mkdir()
    folder = tmp_path / "mine"
    folder.mkdir()
    write_capture(tmp_path / "other/empty.h5", background_of(capture_of()))
    (folder / "link").symlink_to(tmp_path / "other")
    path = beside(folder, name, "empty.h5")
    message = "names the group" if name.startswith("/") else "which must lie in this file's folder"
    with pytest.raises(CaptureError, match=rf"run.h5: /receivers/front@background: .*{message}"):
        open_capture(path)


SPOILT = {
    "no group": (lambda file: file.__delitem__(PLACE), r"names the group '/backgrounds/front', which is not there"),
    "no preamble": (lambda file: file[PLACE].__delitem__("preamble"), f"{PLACE}/preamble: array missing"),
    "another mount": (
        lambda file: file[PLACE].attrs.__setitem__("mount_yaw_rad", 1.0),
        "it is of another radar, with mount_yaw_rad 1.0 instead of 0.4",
    ),
    "another robot": (
        lambda file: [file.attrs.__setitem__("robot", "a"), file[PLACE].attrs.__setitem__("robot", "b")],
        "it is of another robot, 'b' instead of 'a'",
    ),
    "too few times": (
        lambda file: [file[PLACE].__delitem__("timestamp_s"), file[PLACE].create_dataset("timestamp_s", data=[0.0])],
        f"{PLACE}/timestamp_s: expected shape",
    ),
    "an array in its place": (
        lambda file: [file.__delitem__(PLACE), file.create_dataset(PLACE, data=[0.0])],
        f"{PLACE}",
    ),
    "no frame rate": (
        lambda file: file[PLACE].attrs.__setitem__("frame_rate_hz", -1.0),
        f"{PLACE}@frame_rate_hz: expected a positive number",
    ),
}


@pytest.mark.parametrize(("spoil", "message"), SPOILT.values(), ids=SPOILT)
def test_a_damaged_background_is_refused_in_one_line(path, spoil, message):
    with h5py.File(path, "a") as file:
        spoil(file)
    with pytest.raises(CaptureError, match=message) as caught:
        open_capture(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_file_beside_that_is_missing_or_of_other_receivers_is_named(tmp_path):
    path = beside(tmp_path, "gone.h5", "empty.h5")
    with pytest.raises(CaptureError, match=r"gone.h5: no such capture file"):
        open_capture(path)
    write_capture(tmp_path / "gone.h5", background_of(capture_of(receiver="left")))
    with pytest.raises(
        CaptureError, match=r"gone.h5: /receivers: no receiver 'front', whose background .*run.h5 expec"
    ):
        open_capture(path)
