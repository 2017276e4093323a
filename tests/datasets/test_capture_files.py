"""The adapter of one's own capture files: which files, which names, and what a broken one says."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from uwbbench.api import Capture, CaptureError, write_capture
from uwbbench.config.source import CaptureRef, open_dataset


def dataset(*roots, **params):
    return open_dataset("capture", params, [Path(root) for root in roots])


def as_receiver(capture: Capture, name: str) -> Capture:
    return dataclasses.replace(capture, radar=dataclasses.replace(capture.radar, receiver=name))


@pytest.fixture
def short(approach) -> Capture:
    part = approach.frames(0, 5)
    track = dataclasses.replace(
        approach.trajectory, timestamp_s=part.timestamp_s, position_m=part.position_m, yaw_rad=part.yaw_rad
    )
    rows = {
        name: getattr(part, name)
        for name in ("preamble", "sts1", "sts2", "first_path_index", "first_path_index_sts1", "first_path_index_sts2")
    }
    return dataclasses.replace(approach, trajectory=track, **rows)


def test_a_file_with_one_receiver_is_named_after_its_stem(tmp_path, short):
    write_capture(tmp_path / "run.h5", short)
    found = dataset(tmp_path, files=["*.h5"])
    assert found.names() == ["run"]
    np.testing.assert_array_equal(found.open("run").frames().preamble, short.preamble)


def test_receivers_of_one_file_are_captures_of_their_own(tmp_path, short):
    write_capture(tmp_path / "run.h5", as_receiver(short, "left"), as_receiver(short, "right"))
    found = dataset(tmp_path, files=["run.h5"])
    assert found.names() == ["run/left", "run/right"]
    assert found.open("run/right").radar.receiver == "right"
    assert dataset(tmp_path, files=["run.h5"], receiver="left").names() == ["run/left"]


def test_opening_a_file_of_several_receivers_by_its_stem_asks_which(tmp_path, short):
    write_capture(tmp_path / "run.h5", as_receiver(short, "left"), as_receiver(short, "right"))
    with pytest.raises(CaptureError, match=r"/receivers.*choose one of: left, right"):
        dataset(tmp_path, files=["run.h5"]).open("run")


def test_equal_stems_are_told_apart_by_their_folders(tmp_path, short):
    for folder in ("monday/a", "tuesday/a", "tuesday/b"):
        write_capture(tmp_path / folder / "run.h5", short)
    found = dataset(tmp_path, files=["**/*.h5"])
    assert found.names() == ["monday/a/run", "tuesday/a/run", "b/run"]
    assert all(len(found.open(name)) == len(short) for name in found.names())


def test_files_that_differ_in_their_suffix_alone_keep_distinct_names(tmp_path, short):
    write_capture(tmp_path / "run.h5", short)
    write_capture(tmp_path / "run.hdf5", short)
    names = dataset(tmp_path, files=["run.*"]).names()
    assert len(set(names)) == 2


def test_a_file_matched_by_two_patterns_is_one_capture(tmp_path, short):
    write_capture(tmp_path / "run.h5", short)
    assert dataset(tmp_path, files=["*.h5", "run.h5", str(tmp_path / "r*.h5")]).names() == ["run"]


def test_the_first_root_with_a_match_wins(tmp_path, short):
    for folder in ("second", "third"):
        write_capture(tmp_path / folder / "run.h5", dataclasses.replace(short, name=folder))
    (tmp_path / "first").mkdir()
    found = dataset(tmp_path / "first", tmp_path / "second", tmp_path / "third", files=["*.h5"])
    assert found.names() == ["run"]
    assert found.open("run").name == "second"


def test_a_name_with_glob_characters_is_found_as_it_stands(tmp_path, short):
    write_capture(tmp_path / "day [1]" / "run[2].h5", short)
    assert dataset(tmp_path / "day [1]", files=["run[2].h5"]).names() == ["run[2]"]
    assert dataset(tmp_path / "day [1]", files=["run*.h5"]).names() == ["run[2]"]


def test_no_match_names_the_pattern_and_every_folder_searched(tmp_path):
    with pytest.raises(CaptureError) as caught:
        dataset(tmp_path / "a", tmp_path / "b", files=["runs/*.h5"]).names()
    assert all(part in str(caught.value) for part in ("runs/*.h5", str(tmp_path / "a"), str(tmp_path / "b")))


def test_a_broken_file_is_listed_and_says_what_is_wrong_when_opened(tmp_path, short):
    write_capture(tmp_path / "good.h5", short)
    (tmp_path / "bad.h5").write_bytes(b"not HDF5 at all")
    found = dataset(tmp_path, files=["*.h5"])
    assert found.names() == ["bad", "good"]
    with pytest.raises(CaptureError, match=r"bad\.h5: not a readable HDF5 file"):
        found.open("bad")


def test_a_receiver_that_a_file_lacks_is_reported_with_the_nearest_name(tmp_path, short):
    write_capture(tmp_path / "run.h5", short)
    found = dataset(tmp_path, files=["run.h5"], receiver="frnt")
    assert found.names() == ["run"]
    with pytest.raises(CaptureError, match=r"no receiver 'frnt'. Did you mean 'front'"):
        found.open("run")


def test_an_unknown_capture_suggests_the_nearest(tmp_path, short):
    write_capture(tmp_path / "kitchen.h5", short)
    with pytest.raises(CaptureError, match=r"'kichen'. Did you mean 'kitchen'"):
        dataset(tmp_path, files=["*.h5"]).open("kichen")


@pytest.mark.parametrize("receiver", [None, "front"])
def test_a_reference_to_a_file_opens_it_again(tmp_path, short, receiver):
    write_capture(tmp_path / "run.h5", short)
    assert CaptureRef.of_file(tmp_path / "run.h5", receiver).open().sha256 == short.sha256


def driven(capture: Capture, name: str, **odometry) -> Capture:
    track = capture.trajectory
    usual = {"odometry_position_m": track.position_m, "odometry_yaw_rad": track.yaw_rad}
    return dataclasses.replace(as_receiver(capture, name), **{**usual, **odometry})


def test_a_file_is_one_run_of_all_its_receivers(tmp_path, short):
    write_capture(tmp_path / "both.h5", driven(short, "left"), driven(short, "right"))
    write_capture(tmp_path / "one.h5", driven(short, "front"))
    found = dataset(tmp_path, files=["*.h5"])
    assert found.runs() == {"both": ("both/left", "both/right"), "one": ("one",)}
    drive = found.open_run("both", found.runs()["both"])
    assert list(drive.radars) == ["left", "right"]
    assert np.array_equal(drive.odometry[:, :2], short.trajectory.position_m[:, :2])
    assert dataset(tmp_path, files=["both.h5"], receiver="right").runs() == {"both": ("both/right",)}


def test_a_run_whose_receivers_disagree_is_refused_when_it_is_opened(tmp_path, short):
    other = short.trajectory.position_m + 1.0
    write_capture(tmp_path / "run.h5", driven(short, "left"), driven(short, "right", odometry_position_m=other))
    found = dataset(tmp_path, files=["run.h5"])
    with pytest.raises(CaptureError, match="no receivers of one run: their odometry differs by"):
        found.open_run("run", found.runs()["run"])


def test_a_broken_file_is_a_run_that_fails_when_it_is_opened(tmp_path):
    (tmp_path / "bad.h5").write_bytes(b"nothing")
    found = dataset(tmp_path, files=["*.h5"])
    assert found.runs() == {"bad": ("bad",)}
    with pytest.raises(CaptureError, match=r"bad\.h5: not a readable HDF5 file"):
        found.open_run("bad", ("bad",))
