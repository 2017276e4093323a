"""The capture file: what is written comes back."""

import dataclasses
import subprocess
import sys

import h5py
import numpy as np
import pytest

from tests.api.written import assert_same, capture_of
from uwbbench.api import CaptureError, Obstacle, Truth, open_capture, write_capture
from uwbbench.api.capture_file import list_receivers


@pytest.fixture
def path(tmp_path):
    """A correct file."""
    write_capture(tmp_path / "run.h5", capture_of())
    return tmp_path / "run.h5"


@pytest.mark.parametrize("samples", ["iq", "rf"])
@pytest.mark.parametrize("sts", [True, False])
@pytest.mark.parametrize("frames", [0, 1, 6])
def test_everything_written_comes_back(tmp_path, samples, sts, frames):
    capture = capture_of(frames, samples=samples, sts=sts)
    write_capture(tmp_path / "run.h5", capture)
    found = open_capture(tmp_path / "run.h5")
    assert_same(found, capture)
    assert found.sha256 == capture.sha256
    assert len(found.frames()) == frames


def test_what_is_optional_may_be_absent(tmp_path):
    bare = capture_of(sts=False)
    absent = ("first_path_index", "first_path_index_sts1", "first_path_index_sts2", "odometry_yaw_rad")
    radar = dataclasses.replace(bare.radar, has_first_path=False, channel=None, array_spacing_m=None)
    bare = dataclasses.replace(
        bare, radar=radar, truth=None, citation="", odometry_position_m=None, **dict.fromkeys(absent)
    )
    write_capture(tmp_path / "run.h5", bare)
    assert_same(open_capture(tmp_path / "run.h5"), bare)


def test_a_known_first_tap_delay_comes_back(tmp_path):
    capture = capture_of()
    capture = dataclasses.replace(capture, radar=dataclasses.replace(capture.radar, first_tap_delay_s=-2e-9))
    write_capture(tmp_path / "run.h5", capture)
    assert open_capture(tmp_path / "run.h5").radar.first_tap_delay_s == -2e-9


def test_without_pose_the_robot_stands_at_the_origin(path):
    with h5py.File(path, "a") as file:
        del file["receivers/front/position_m"], file["receivers/front/yaw_rad"]
    track = open_capture(path).trajectory
    assert not track.position_m.any()
    assert not track.yaw_rad.any()


def test_each_receiver_comes_back_by_name(tmp_path):
    left, right = capture_of(receiver="left"), capture_of(frames=4, receiver="right")
    write_capture(tmp_path / "run.h5", left, right)
    assert list_receivers(tmp_path / "run.h5") == ("left", "right")
    both = ("left", "right")
    assert_same(open_capture(tmp_path / "run.h5", "left"), dataclasses.replace(left, receivers=both))
    assert_same(open_capture(tmp_path / "run.h5", "right"), dataclasses.replace(right, receivers=both))
    with pytest.raises(CaptureError, match="choose one of: left, right"):
        open_capture(tmp_path / "run.h5")


def test_moving_objects_come_back_and_raise_the_minor_version(tmp_path):
    walker = np.random.default_rng(0).normal(size=(6, 1, 2))
    walker[2] = np.nan
    capture = capture_of(truth=Truth((Obstacle("person", "body", walker),)))
    write_capture(tmp_path / "run.h5", capture)
    assert_same(open_capture(tmp_path / "run.h5"), capture)
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["format_version"] == "1.1"


def test_contiguous_samples_are_views_of_the_mapped_file(path):
    capture = open_capture(path)
    for name in ("preamble", "sts1", "sts2"):
        first, second = (getattr(capture.frames(), name) for _ in range(2))
        assert np.shares_memory(first, second)
        assert not first.flags.writeable


def test_samples_of_the_other_byte_order_are_read_in_this_machines(path):
    expected = np.array(open_capture(path).preamble)
    other = expected.dtype.newbyteorder("S")
    with h5py.File(path, "a") as file:
        del file["receivers/front/preamble"]
        file.create_dataset("receivers/front/preamble", data=expected.astype(other))
    capture = open_capture(path)
    assert capture.preamble.dtype == other
    found = capture.frames().preamble
    assert found.dtype == expected.dtype
    assert found.dtype.isnative
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(
    "options", [{"chunks": (2, 5)}, {"compression": "gzip"}, {"compression": "gzip", "shuffle": 1}]
)
def test_chunked_and_compressed_samples_are_read_the_same(path, options):
    expected = np.array(open_capture(path).preamble)
    with h5py.File(path, "a") as file:
        del file["receivers/front/preamble"]
        file.create_dataset("receivers/front/preamble", data=expected, **options)
    capture = open_capture(path)
    np.testing.assert_array_equal(capture.frames().preamble, expected)
    np.testing.assert_array_equal(capture.frames(3, 5).preamble, expected[3:5])


def test_a_user_block_does_not_shift_the_samples(path, tmp_path):
    """MATLAB puts 512 bytes in front of its HDF5 files."""
    with h5py.File(path) as old, h5py.File(tmp_path / "block.h5", "w", userblock_size=512) as new:
        new.attrs.update(old.attrs)
        for name in old:
            old.copy(name, new)
    np.testing.assert_array_equal(open_capture(tmp_path / "block.h5").preamble, open_capture(path).preamble)


def test_attributes_of_one_element_are_read_as_matlab_writes_them(path):
    with h5py.File(path, "a") as file:
        file["radar"].attrs["sample_interval_s"] = np.array([2e-9])
        file["receivers/front"].attrs["noise_taps"] = np.array([[3.0]])
        file["radar"].attrs["model"] = np.bytes_("DW3000")
    radar = open_capture(path).radar
    assert (radar.sample_interval_s, radar.noise_taps, radar.model) == (2e-9, 3, "DW3000")


def test_a_newer_minor_version_is_read(path):
    with h5py.File(path, "a") as file:
        file.attrs["format_version"] = "1.7"
    assert len(open_capture(path)) == 6


# Writing.


def test_writing_replaces_an_existing_file_whole_and_leaves_nothing_beside_it(path):
    write_capture(path, capture_of(frames=2))
    assert len(open_capture(path)) == 2
    assert [item.name for item in path.parent.iterdir()] == ["run.h5"]


def test_a_written_file_has_the_permissions_that_other_new_files_have(path, tmp_path):
    (tmp_path / "plain").touch()
    assert path.stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_writing_below_a_file_is_refused(path):
    with pytest.raises(CaptureError, match="cannot be written"):
        write_capture(path / "deeper.h5", capture_of())


def test_a_full_disk_is_refused_and_the_old_file_stays(path):
    """A limit on the size of files stands for the full disk."""
    script = (
        "import resource, signal, sys\n"
        "from uwbbench.api import open_capture, write_capture, CaptureError\n"
        "import dataclasses, numpy as np\n"
        "path = sys.argv[1]\n"
        "old = open_capture(path)\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))\n"
        "big = np.ones((6, 50000), np.complex64)\n"
        "radar = dataclasses.replace(old.radar, taps=50000)\n"
        "try:\n"
        "    write_capture(path, dataclasses.replace(old, radar=radar, preamble=big, sts1=big, sts2=big))\n"
        "except CaptureError as error:\n"
        "    print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=False)
    assert "cannot be written" in done.stdout, done.stderr
    assert len(open_capture(path)) == 6
    assert [item.name for item in path.parent.iterdir()] == ["run.h5"]


@pytest.mark.parametrize("names", [[], ["a", "a"], ["a/b"], [""], ["."]])
def test_receivers_need_names_that_can_be_told_apart(tmp_path, names):
    with pytest.raises(CaptureError, match="distinct names"):
        write_capture(tmp_path / "run.h5", *[capture_of(receiver=name) for name in names])


def test_captures_of_different_radars_do_not_go_into_one_file(tmp_path):
    first, second = capture_of(receiver="a"), capture_of(receiver="b")
    other = dataclasses.replace(second, radar=dataclasses.replace(second.radar, channel=5))
    with pytest.raises(CaptureError, match="'a' and 'b' are not of one run: they differ in channel"):
        write_capture(tmp_path / "run.h5", first, other)
    with pytest.raises(CaptureError, match="differ in truth"):
        write_capture(tmp_path / "run.h5", first, dataclasses.replace(second, truth=None))
    assert not list(tmp_path.iterdir())


def test_an_object_whose_name_cannot_be_stored_is_refused(tmp_path):
    capture = capture_of(truth=Truth((Obstacle("a/b", "metal", np.zeros((1, 2))),)))
    with pytest.raises(CaptureError, match="object name 'a/b' cannot be stored"):
        write_capture(tmp_path / "run.h5", capture)
