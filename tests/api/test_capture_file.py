"""The capture file: what is written comes back, and what is broken is refused with the place in the file."""

import dataclasses
import shutil
import subprocess
import sys

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from uwbbench.api import Capture, CaptureError, Obstacle, Radar, Trajectory, Truth, open_capture, write_capture
from uwbbench.api.capture_file import list_receivers


def capture_of(frames=6, taps=5, samples="iq", sts=True, receiver="front", **parts) -> Capture:
    rng = np.random.default_rng(frames * 100 + taps)

    def response():
        return (rng.normal(size=(frames, taps)) + 1j * rng.normal(size=(frames, taps))).astype(np.complex64)

    radar = Radar(
        model="test",
        center_frequency_hz=7987.2e6,
        bandwidth_hz=499.2e6,
        sample_interval_s=1e-9,
        frame_rate_hz=50.0,
        taps=taps,
        samples=samples,
        channel=9,
        receiver=receiver,
        mount_position_m=(0.1, 0.2, 0.3),
        mount_yaw_rad=0.4,
        tx_position_m=(0.0, -0.25, 0.0),
        noise_taps=min(2, taps),
        array_spacing_m=0.0178,
        has_sts=sts,
        has_first_path=True,
    )
    truth = Truth(
        (
            Obstacle("box", "metal", np.array([[1.0, 0], [1, 1], [2, 1]])),
            Obstacle("wall", "brick", np.array([[5.0, -1, 0], [5, 1, 2]]), structure=True),
        ),
        exhaustive=False,
    )
    given = {
        "name": "run 1",
        "radar": radar,
        "trajectory": Trajectory(np.arange(frames) / 50.0, rng.normal(size=(frames, 3)), rng.normal(size=frames)),
        "truth": truth,
        "source": "simulated",
        "license": "CC0",
        "citation": "nobody",
        "description": "ünïcode",
        "preamble": response() if samples == "iq" else rng.normal(size=(frames, taps)).astype(np.float32),
        "sts1": response() if sts else None,
        "sts2": response() if sts else None,
        "first_path_index": rng.uniform(0, taps, frames),
        "first_path_index_sts1": rng.uniform(0, taps, frames),
        "first_path_index_sts2": rng.uniform(0, taps, frames),
        "odometry_position_m": rng.normal(size=(frames, 3)),
        "odometry_yaw_rad": rng.normal(size=frames),
        "receivers": (receiver,),
    }
    return Capture(**{**given, **parts})


def assert_same(found: Capture, expected: Capture):
    for field in dataclasses.fields(Capture):
        mine, theirs = getattr(found, field.name), getattr(expected, field.name)
        if field.name == "trajectory":
            for name in ("timestamp_s", "position_m", "yaw_rad"):
                np.testing.assert_array_equal(getattr(mine, name), getattr(theirs, name))
        elif field.name == "truth":
            assert (mine is None) == (theirs is None)
            if mine is not None:
                assert mine.exhaustive == theirs.exhaustive
                for a, b in zip(mine.objects, theirs.objects, strict=True):
                    assert (a.name, a.material, a.structure) == (b.name, b.material, b.structure)
                    np.testing.assert_array_equal(a.outline_m, b.outline_m)
        elif isinstance(theirs, np.ndarray):
            np.testing.assert_array_equal(np.asarray(mine), theirs)
        else:
            assert mine == theirs


@pytest.fixture
def path(tmp_path):
    """A correct file, to be spoilt."""
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


def set_attribute(where, name, value):
    return lambda file: file[where].attrs.__setitem__(name, value)


def drop_attribute(where, name):
    return lambda file: file[where].attrs.__delitem__(name)


def put(where, data):
    def spoil(file):
        if where in file:
            del file[where]
        if data is not None:
            file[where] = data

    return spoil


def rename_attribute(attributes, old, new):
    attributes[new] = attributes.pop(old)


F = "receivers/front"
SPOILT = {
    "another format": (set_attribute("/", "format", "other"), r"/@format: expected 'uwbbench-capture', found 'other'"),
    "no format": (drop_attribute("/", "format"), "/@format: attribute missing"),
    "a newer major version": (set_attribute("/", "format_version", "2.0"), r"/@format_version: version 2\.0"),
    "no name": (drop_attribute("/", "name"), "/@name: attribute missing"),
    "an unknown source": (set_attribute("/", "source", "guessed"), "/@source: expected 'measured' or 'simulated'"),
    "no licence": (drop_attribute("/", "license"), "/@license: attribute missing"),
    "no radar": (put("radar", None), "/radar: expected a group, found nothing"),
    "a mistyped attribute": (
        lambda file: rename_attribute(file["radar"].attrs, "sample_interval_s", "sample_intervals"),
        "/radar@sample_interval_s: attribute missing.*Did you mean 'sample_intervals'",
    ),
    "text for a number": (set_attribute("radar", "bandwidth_hz", "wide"), "/radar@bandwidth_hz: expected float"),
    "an infinite bandwidth": (set_attribute("radar", "bandwidth_hz", np.inf), "/radar@bandwidth_hz: .*finite"),
    "samples of no kind": (set_attribute("radar", "samples", "am"), "/radar@samples: expected 'iq' or 'rf'"),
    "a sample interval of zero": (set_attribute("radar", "sample_interval_s", 0.0), "/radar@sample_interval_s: "),
    "a negative sample interval": (set_attribute("radar", "sample_interval_s", -1e-9), "/radar@sample_interval_s: "),
    "half a channel": (set_attribute("radar", "channel", 5.5), "/radar@channel: expected int"),
    "no receivers": (put("receivers", None), "/receivers: expected a group, found nothing"),
    "an empty list of receivers": (put(F, None), "/receivers: expected at least one receiver"),
    "an array for a receiver": (put(F, np.zeros(3)), f"/{F}"),
    "a mount of two numbers": (set_attribute(F, "mount_position_m", [0.0, 1.0]), f"/{F}@mount_position_m: expected 3"),
    "no mount yaw": (drop_attribute(F, "mount_yaw_rad"), f"/{F}@mount_yaw_rad: attribute missing"),
    "no transmitter": (drop_attribute(F, "tx_position_m"), f"/{F}@tx_position_m: attribute missing"),
    "no noise taps": (drop_attribute(F, "noise_taps"), f"/{F}@noise_taps: attribute missing"),
    "more noise taps than taps": (set_attribute(F, "noise_taps", 6), f"/{F}: noise_taps must lie between 0 and the 5"),
    "no preamble": (put(f"{F}/preamble", None), f"/{F}/preamble: array missing"),
    "a flat preamble": (put(f"{F}/preamble", np.zeros(6, np.complex64)), f"/{F}/preamble: expected shape"),
    "a real preamble of an IQ radar": (put(f"{F}/preamble", np.zeros((6, 5))), f"/{F}/preamble: expected complex64"),
    "a group for a preamble": (lambda file: put(f"{F}/preamble", None)(file) or file.create_group(f"{F}/preamble"),
                               f"/{F}/preamble: expected an array, found a group"),
    "zero taps": (put(f"{F}/preamble", np.zeros((6, 0), np.complex64)), f"/{F}/preamble: expected at least one tap"),
    "one STS alone": (put(f"{F}/sts2", None), f"/{F}/sts1: one STS array without the other"),
    "the other STS alone": (put(f"{F}/sts1", None), f"/{F}/sts2: one STS array without the other"),
    "an STS of fewer taps": (put(f"{F}/sts1", np.zeros((6, 4), np.complex64)), f"/{F}/sts1: expected shape"),
    "an STS of fewer frames": (put(f"{F}/sts1", np.zeros((5, 5), np.complex64)), f"/{F}/sts1: expected shape"),
    "no timestamps": (put(f"{F}/timestamp_s", None), f"/{F}/timestamp_s: array missing"),
    "too few timestamps": (put(f"{F}/timestamp_s", np.arange(5.0)), f"/{F}/timestamp_s: expected shape"),
    "decreasing timestamps": (put(f"{F}/timestamp_s", [0, 1, 2, 1.5, 3, 4]), f"/{F}/timestamp_s: .*not decrease"),
    "a timestamp that is no number": (put(f"{F}/timestamp_s", [0, 1, np.nan, 3, 4, 5]), f"/{F}/timestamp_s: "),
    "timestamps as text": (put(f"{F}/timestamp_s", ["a"] * 6), f"/{F}/timestamp_s: expected float64"),
    "flat positions": (put(f"{F}/position_m", np.zeros((6, 2))), f"/{F}/position_m: expected shape"),
    "too many headings": (put(f"{F}/yaw_rad", np.zeros(7)), f"/{F}/yaw_rad: expected shape"),
    "too few first paths": (put(f"{F}/first_path_index", np.zeros(3)), f"/{F}/first_path_index: expected shape"),
    "flat odometry": (put(f"{F}/odometry_position_m", np.zeros(6)), f"/{F}/odometry_position_m: expected shape"),
    "truth that does not say whether it is all": (drop_attribute("truth", "exhaustive"), "/truth@exhaustive: attrib"),
    "text for yes or no": (set_attribute("truth", "exhaustive", "false"), "/truth@exhaustive: expected bool"),
    "an object without material": (drop_attribute("truth/objects/box", "material"), "/truth/objects/box@material: "),
    "an object without outline": (put("truth/objects/box/outline_m", None), "/truth/objects/box/outline_m: array miss"),
    "an outline of one dimension": (put("truth/objects/box/outline_m", np.zeros(4)), "/truth/objects/box/outline_m: "),
    "an outline without corners": (put("truth/objects/box/outline_m", np.zeros((0, 2))), "objects/box/outline_m: expe"),
    "a moving outline of too few frames": (put("truth/objects/box/outline_m", np.zeros((5, 1, 2))), "box/outline_m: e"),
    "an outline with a corner nowhere": (put("truth/objects/box/outline_m", [[0, np.nan]]), "box/outline_m: .*finite"),
    "an outline of text": (put("truth/objects/box/outline_m", [["a", "b"]]), "box/outline_m: expected float64"),
}  # fmt: skip


@pytest.mark.parametrize("case", SPOILT)
def test_a_file_that_breaks_the_format_is_refused_with_the_place(path, case):
    spoil, message = SPOILT[case]
    with h5py.File(path, "a") as file:
        spoil(file)
    with pytest.raises(CaptureError, match=message) as caught:
        open_capture(path)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize("place", [f"{F}/preamble", f"{F}/sts1", f"{F}/yaw_rad", "truth", F])
@pytest.mark.parametrize("kind", ["soft", "external", "dangling"])
def test_links_are_refused(path, tmp_path, place, kind):
    shutil.copy(path, tmp_path / "other.h5")
    with h5py.File(path, "a") as file:
        file.move(place, "elsewhere")
        file[place] = {
            "soft": h5py.SoftLink("/elsewhere"),
            "external": h5py.ExternalLink("other.h5", f"/{place}"),
            "dangling": h5py.SoftLink("/nowhere"),
        }[kind]
    with pytest.raises(CaptureError, match=rf"/{place}.*links are not followed"):
        open_capture(path)


def test_samples_in_another_raw_file_are_refused(path, tmp_path):
    (tmp_path / "raw.bin").write_bytes(bytes(240))
    with h5py.File(path, "a") as file:
        del file[f"{F}/preamble"]
        outside = [(str(tmp_path / "raw.bin"), 0, 240)]
        file.create_dataset(f"{F}/preamble", shape=(6, 5), dtype=np.complex64, external=outside)
    with pytest.raises(CaptureError, match=f"/{F}/preamble: the array lies in another file"):
        open_capture(path)


def test_virtual_samples_are_refused(path, tmp_path):
    shutil.copy(path, tmp_path / "other.h5")
    layout = h5py.VirtualLayout(shape=(6, 5), dtype=np.complex64)
    layout[:] = h5py.VirtualSource(tmp_path / "other.h5", f"{F}/preamble", shape=(6, 5))
    with h5py.File(path, "a") as file:
        del file[f"{F}/preamble"]
        file.create_virtual_dataset(f"{F}/preamble", layout)
    with pytest.raises(CaptureError, match=f"/{F}/preamble: the array lies in another file"):
        open_capture(path)


def read_all(path):
    """All that a detector and a scorer would touch."""
    capture = open_capture(path)
    return capture.frames(), capture.sha256


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0, 1, exclude_max=True))
def test_a_file_truncated_anywhere_is_refused_and_nothing_else(path, tmp_path, share):
    content = path.read_bytes()
    (tmp_path / "cut.h5").write_bytes(content[: int(share * len(content))])
    with pytest.raises(CaptureError, match=r"cut\.h5"):
        read_all(tmp_path / "cut.h5")


@pytest.mark.parametrize("signature", [b"SNOD", b"TREE", b"HEAP"])
def test_damaged_metadata_of_groups_are_refused(path, signature):
    content = path.read_bytes()
    assert signature in content
    path.write_bytes(content.replace(signature, b"????"))
    with pytest.raises(CaptureError, match=r"run\.h5: "):
        read_all(path)


def test_a_damaged_compressed_array_is_refused_when_it_is_read(path):
    with h5py.File(path, "a") as file:
        del file[f"{F}/preamble"]
        data = np.ones((6, 5), np.complex64)
        stored = file.create_dataset(f"{F}/preamble", data=data, compression="gzip", fletcher32=True)
        chunk = stored.id.get_chunk_info(0)
    with path.open("r+b") as file:
        file.seek(chunk.byte_offset)
        file.write(b"\xff" * chunk.size)
    capture = open_capture(path)
    with pytest.raises(CaptureError, match="preamble: cannot be read, damaged file"):
        capture.frames()


@pytest.mark.parametrize("content", [b"", b"hello", b"\x89HDF\r\n\x1a\n" + bytes(40)])
def test_a_file_that_is_not_hdf5_is_refused(tmp_path, content):
    (tmp_path / "run.h5").write_bytes(content)
    with pytest.raises(CaptureError, match="not a readable HDF5 file"):
        open_capture(tmp_path / "run.h5")


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    for path in (tmp_path / "none.h5", tmp_path):
        with pytest.raises(CaptureError, match="no such capture file"):
            open_capture(path)


def test_an_unknown_receiver_suggests_the_nearest(path):
    with pytest.raises(CaptureError, match=r"no receiver 'frond'\. Did you mean 'front'"):
        open_capture(path, "frond")


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
