"""The capture file: what is broken is refused with the place in the file."""

import shutil

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.api.written import capture_of
from uwbbench.api import CaptureError, open_capture, write_capture


@pytest.fixture(autouse=True)
def here(monkeypatch):
    """Files are read here; tests/fuzz is about the child that reads them first."""
    monkeypatch.setenv("UWBBENCH_TRUST_FILES", "1")


@pytest.fixture
def path(tmp_path):
    """A correct file, to be spoilt."""
    write_capture(tmp_path / "run.h5", capture_of())
    return tmp_path / "run.h5"


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


@pytest.mark.parametrize("value", ["x" * 40_000, "x y " * 10_000, np.arange(5000.0), np.full(5, 1e308)])
@pytest.mark.parametrize("attribute", ["sample_interval_s", "samples", "channel"])
def test_a_message_repeats_at_most_200_characters_of_an_attribute(path, attribute, value):
    with h5py.File(path, "a") as file:
        file["radar"].attrs[attribute] = value
    with pytest.raises(CaptureError, match=f"/radar@{attribute}: expected") as caught:
        open_capture(path)
    assert len(str(caught.value).removeprefix(str(path))) < 300


@pytest.mark.parametrize("value", [1e308, 2**62, 5e-324])
@pytest.mark.parametrize("attribute", ["sample_interval_s", "frame_rate_hz", "bandwidth_hz", "center_frequency_hz"])
def test_a_number_that_nothing_can_be_multiplied_with_is_refused(path, attribute, value):
    with h5py.File(path, "a") as file:
        file["radar"].attrs[attribute] = value
    with pytest.raises(CaptureError, match=f"radar {attribute} must lie between"):
        open_capture(path)
