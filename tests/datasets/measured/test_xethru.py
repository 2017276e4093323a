"""XeThru recordings: synthetic ones in both layouts, and the measured ones."""

import struct

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from uwbbench.api import SPEED_OF_LIGHT_M_S, CaptureError
from uwbbench.config.source import open_dataset
from uwbbench_datasets.measured.xethru import read_recording

RNG = np.random.default_rng(7)
SAMPLES = (RNG.normal(size=(5, 9)) + 1j * RNG.normal(size=(5, 9))).astype(np.complex64)
FS, FC, OFFSET, BIN = 2.916e9, 7.29e9, 0.334321, 0.05144033
COUNTERS = (7, 8, 9, 12, 13)
DAMAGE = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def parts(row):
    return np.concatenate([row.real, row.imag]).astype("<f4").tobytes()


def baseband(counters=COUNTERS, **changes):
    """File content; ``changes`` maps a field of the head to its value in the last frame."""
    frames = []
    for number, counter in enumerate(counters):
        head = {"n": 9, "bin": BIN, "fs": FS, "fc": FC, "offset": OFFSET}
        if number == len(counters) - 1:
            head |= changes
        frames.append(struct.pack("<IIffff", counter, *head.values()) + parts(SAMPLES[number]))
    return b"".join(frames)


def datafloat(counters=COUNTERS, length=18):
    return b"".join(struct.pack("<III", 0, c, length) + parts(row) for c, row in zip(counters, SAMPLES, strict=False))


def x4(folder, *files, **params):
    return open_dataset("xethru-x4", {"files": list(files), **params}, [folder])


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "xethru_baseband_iq_1.dat").write_bytes(baseband())
    (tmp_path / "xethru_datafloat_2.dat").write_bytes(datafloat())
    return tmp_path


def test_a_glob_names_all_recordings_by_their_files(folder):
    assert x4(folder, "*.dat").names() == ["xethru_baseband_iq_1", "xethru_datafloat_2"]


@pytest.mark.parametrize("name", ["xethru_baseband_iq_1", "xethru_datafloat_2"])
def test_samples_and_lost_frames_come_back(folder, name):
    capture = x4(folder, "*.dat", frame_rate_hz=10.0).open(name)
    np.testing.assert_array_equal(capture.preamble, SAMPLES)
    np.testing.assert_allclose(capture.trajectory.timestamp_s, [0.0, 0.1, 0.2, 0.5, 0.6])
    assert capture.truth is None


def test_the_range_axis_of_baseband_iq_is_the_files(folder):
    radar = x4(folder, "*.dat", range_offset_m=9.0, carrier_hz=1e9).open("xethru_baseband_iq_1").radar
    assert radar.first_tap_delay_s * SPEED_OF_LIGHT_M_S / 2 == pytest.approx(OFFSET)
    assert radar.sample_interval_s == pytest.approx(1 / FS)
    assert radar.center_frequency_hz == np.float32(FC)


def test_the_range_axis_of_datafloat_is_the_parameters(folder):
    capture = x4(folder, "*.dat", range_offset_m=0.9, carrier_hz=8.748e9, sample_rate_hz=3e9).open("xethru_datafloat_2")
    assert capture.radar.first_tap_delay_s * SPEED_OF_LIGHT_M_S / 2 == pytest.approx(0.9)
    assert capture.radar.sample_interval_s == pytest.approx(1 / 3e9)
    assert capture.radar.center_frequency_hz == 8.748e9
    assert "assumed to start at 0.9 m" in capture.description


def test_a_file_of_another_name_needs_its_layout(folder):
    (folder / "mine.dat").write_bytes(datafloat())
    with pytest.raises(CaptureError, match=r"mine\.dat.*give the parameter 'layout'"):
        x4(folder, "mine.dat").open("mine")
    np.testing.assert_array_equal(x4(folder, "mine.dat", layout="datafloat").open("mine").preamble, SAMPLES)


FRAME_IQ, FRAME_FLOAT = 24 + 8 * 9, 12 + 8 * 9


@pytest.mark.parametrize(
    ("layout", "content", "byte", "what"),
    [
        ("baseband_iq", b"", 0, "too few"),
        ("datafloat", b"12345678901", 0, "too few"),
        ("baseband_iq", baseband()[:-1], 4 * FRAME_IQ, "ends inside a frame"),
        ("datafloat", datafloat()[:-4], 4 * FRAME_FLOAT, "ends inside a frame"),
        ("baseband_iq", baseband()[:50], 0, "cannot hold 18 values"),
        ("datafloat", datafloat(length=0), 0, "cannot hold 0 values"),
        ("datafloat", datafloat(length=17), 0, "cannot hold 17 values"),
        ("baseband_iq", baseband(n=10), 4 * FRAME_IQ, "'length' differs"),
        ("baseband_iq", baseband(fs=3e9), 4 * FRAME_IQ, "'sample_rate_hz' differs"),
        ("baseband_iq", baseband(fc=8e9), 4 * FRAME_IQ, "'carrier_hz' differs"),
        ("baseband_iq", baseband(offset=0.5), 4 * FRAME_IQ, "'range_offset_m' differs"),
        ("baseband_iq", baseband((1,), fs=5e9), 8, "does not fit"),
        ("baseband_iq", baseband((1,), fs=0.0), 8, "sample rate"),
        ("datafloat", datafloat((1, 2, 2)), 2 * FRAME_FLOAT, "counter does not increase"),
    ],
)
def test_a_broken_recording_is_refused_with_its_name_and_the_byte(layout, content, byte, what, tmp_path):
    path = tmp_path / "bad.dat"
    path.write_bytes(content)
    with pytest.raises(CaptureError, match=rf"bad\.dat: byte {byte}: .*{what}"):
        read_recording(path, layout)


@DAMAGE
@given(st.sampled_from([("baseband_iq", baseband()), ("datafloat", datafloat())]), st.data())
def test_a_truncated_recording_gives_whole_frames_or_an_error(tmp_path, kind, data):
    layout, whole = kind
    path = tmp_path / "cut.dat"
    path.write_bytes(whole[: data.draw(st.integers(0, len(whole)))])
    try:
        samples = read_recording(path, layout).samples
    except CaptureError:
        return
    np.testing.assert_array_equal(samples, SAMPLES[: len(samples)])


@DAMAGE
@given(st.binary(max_size=300), st.sampled_from(["baseband_iq", "datafloat"]))
def test_damage_after_the_first_frame_never_changes_it(tmp_path, garbage, layout):
    path = tmp_path / "garbage.dat"
    first = baseband((7,)) if layout == "baseband_iq" else datafloat((7,))
    path.write_bytes(first + garbage)
    try:
        samples = read_recording(path, layout).samples
    except CaptureError:
        return
    np.testing.assert_array_equal(samples[0], SAMPLES[0])


@DAMAGE
@given(st.binary(max_size=300), st.sampled_from(["baseband_iq", "datafloat"]))
def test_garbage_is_never_anything_but_frames_or_a_capture_error(tmp_path, garbage, layout):
    path = tmp_path / "garbage.dat"
    path.write_bytes(garbage)
    try:
        recording = read_recording(path, layout)
    except CaptureError:
        return
    assert len(recording.samples) == len(recording.counter) > 0


def test_names_need_no_files_and_a_missing_file_is_named(tmp_path):
    dataset = open_dataset("xethru-x4", {}, [tmp_path])
    assert len(dataset.names()) == 2
    with pytest.raises(CaptureError, match=r"xethru-x4/xethru_datafloat_20250109_180251\.dat.*uwbbench fetch"):
        dataset.open("xethru_datafloat_20250109_180251")
    with pytest.raises(CaptureError, match="no recording 'other'"):
        dataset.open("other")
    with pytest.raises(CaptureError, match=r"no file matches '\*\.dat'"):
        x4(tmp_path, "*.dat").names()
    with pytest.raises(CaptureError, match="names no file"):
        x4(tmp_path, "").names()
    with pytest.raises(CaptureError, match="'a\\*\\*b'"):
        x4(tmp_path, "a**b").names()
    with pytest.raises(CaptureError, match="must stay below"):
        x4(tmp_path, "../*.dat").names()


@pytest.mark.data
def test_the_measured_recordings_have_their_published_sizes(data_dir):
    dataset = open_dataset("xethru-x4", {}, [data_dir])
    iq, floats = (dataset.open(name) for name in dataset.names())
    assert (iq.preamble.shape, floats.preamble.shape) == ((514, 54), (1518, 91))
    assert iq.radar.center_frequency_hz == pytest.approx(7.29e9)
    assert iq.radar.sample_interval_s == pytest.approx(floats.radar.sample_interval_s)
    for capture in (iq, floats):  # the direct leakage dominates the first bins of either
        assert np.abs(capture.preamble).mean(axis=0).argmax() < 3
