"""ET4173 MATLAB files: synthetic ones with known content, and the measured walk."""

import io

import numpy as np
import pytest
import scipy.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from uwbbench.api import SPEED_OF_LIGHT_M_S, CaptureError, analytic
from uwbbench.config.source import open_dataset
from uwbbench_datasets.measured.et4173 import read_scans

SAMPLES = np.random.default_rng(6).integers(-(10**5), 10**5, (900, 12)).astype(np.int32)
DAMAGE = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def scans(samples=SAMPLES, **changes):
    record = np.zeros((1, len(samples)), [(name, object) for name in ("scn", "Tstmp", "Nbin", "Tstrt")])
    for i, row in enumerate(samples):
        record[0, i] = (row, 1000 + 33 * i, 32, 17499)
    for name, values in changes.items():
        for i, value in values.items():
            record[0, i][name] = value
    return record


def mat(**variables):
    stream = io.BytesIO()
    scipy.io.savemat(stream, variables or {"scn": scans(SAMPLES[:3])}, do_compression=True)
    return stream.getvalue()


def walk(folder, **params):
    return open_dataset("et4173-walk", params, [folder])


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    folder = tmp_path_factory.mktemp("walk")
    (folder / "102_P1.mat").write_bytes(mat(scn=scans()))
    return walk(folder).open("102")


def test_samples_times_and_range_offset_come_back(capture):
    assert capture.preamble.dtype == np.float32
    np.testing.assert_array_equal(capture.preamble, SAMPLES)
    np.testing.assert_allclose(capture.trajectory.timestamp_s, np.arange(900) * 0.033)
    assert capture.radar.first_tap_delay_s == pytest.approx(7.499e-9)
    assert capture.radar.sample_interval_s == pytest.approx(61.035e-12, rel=1e-5)
    assert "FITTED ON THE SCORED OBJECT" in capture.description


def test_another_range_offset_can_be_given(tmp_path):
    (tmp_path / "101_P1.mat").write_bytes(mat(scn=scans()))
    capture = walk(tmp_path, range_offset_m=1.112).open("101")
    assert capture.radar.first_tap_delay_s * SPEED_OF_LIGHT_M_S / 2 == pytest.approx(1.112)
    assert "bin 0 at 1.112 m as given" in capture.description


def test_the_person_passes_the_corners_at_their_frames(capture):
    outline = capture.truth.objects[0].outline_m
    assert outline.shape == (900, 1, 2)
    np.testing.assert_allclose(outline[248, 0], (1, 1))  # a corner falls on this frame
    np.testing.assert_allclose(outline[437, 0], (-1, 1), atol=0.01)
    labelled = np.flatnonzero(np.isfinite(outline).all(axis=(1, 2)))
    assert (labelled[0], labelled[-1], len(labelled)) == (54, 762, 709)


def test_the_node_sees_the_person_from_its_corner_facing_the_middle(capture):
    sight = capture.truth.seen_from(capture.radar, capture.trajectory)
    assert sight.range_m[248, 0] == pytest.approx(np.sqrt(2))
    assert sight.azimuth_rad[248, 0] == pytest.approx(0, abs=1e-9)
    assert np.isnan(sight.range_m[[0, 899], 0]).all()


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"", "not a MATLAB file"),
        (b"garbage " * 100, "not a MATLAB file"),
        (mat(other=1), "no variable 'scn'"),
        (mat(scn=np.arange(4)), r"scn\(1\) has no field scn, Tstmp, Nbin, Tstrt"),
        (mat(scn=scans(SAMPLES[:0])), "'scn' is empty"),
        (mat(scn=scans(SAMPLES[:3], scn={1: np.arange(5)})), r"scn\(2\)\.scn must be one row"),
        (mat(scn=scans(SAMPLES[:3], scn={0: "text"})), r"scn\(1\)\.scn must be one row"),
        (mat(scn=scans(SAMPLES[:3], Tstmp={2: [1, 2]})), r"scn\(3\)\.Tstmp must be one number"),
        (mat(scn=scans(SAMPLES[:3], Nbin={2: 16})), "Nbin.* the same"),
        (mat(scn=scans(SAMPLES[:3], Nbin={0: 0, 1: 0, 2: 0})), "Nbin.*positive"),
        (mat(scn=scans(SAMPLES[:3], Tstrt={1: 1})), "Tstrt.* the same"),
        (mat(scn=scans(SAMPLES[:1])), "a frame rate needs two"),
        (mat(scn=scans(SAMPLES[:3], Tstmp={1: 0})), "timestamp_s must be finite and not decrease"),
    ],
)
def test_a_broken_file_is_refused(content, what, tmp_path):
    (tmp_path / "101_P1.mat").write_bytes(content)
    with pytest.raises(CaptureError, match=what):
        walk(tmp_path).open("101")


@DAMAGE
@given(st.data())
def test_a_damaged_file_gives_the_scans_or_a_capture_error(tmp_path, data):
    path = tmp_path / "cut.mat"
    whole = mat()
    length = data.draw(st.integers(0, len(whole)))
    path.write_bytes(whole[:length] + data.draw(st.binary(max_size=30)))
    try:
        samples, *_ = read_scans(path)
    except CaptureError:
        return
    np.testing.assert_array_equal(samples, SAMPLES[:3])


def test_names_need_no_files_and_a_missing_file_is_named(tmp_path):
    dataset = walk(tmp_path)
    assert dataset.names() == ["101", "102"]
    with pytest.raises(CaptureError, match=r"et4173-walk/101_P1\.mat.*uwbbench fetch"):
        dataset.open("101")
    with pytest.raises(CaptureError, match="no node '103'"):
        dataset.open("103")


@pytest.mark.data
@pytest.mark.parametrize("node", ["101", "102"])
def test_the_leading_edge_of_the_measured_person_is_on_the_path(node, data_dir):
    """Along the walk, the moving part of the echo is weak just before the labelled range and strong just behind it."""
    capture = walk(data_dir).open(node)
    assert capture.preamble.shape == (1024, 480)
    samples = np.asarray(capture.preamble, float)
    envelope = np.abs(analytic(samples - samples.mean(axis=0)))
    envelope /= np.median(envelope, axis=1, keepdims=True)
    radar = capture.radar
    true_m = capture.truth.seen_from(radar, capture.trajectory).range_m[:, 0]
    walking = np.flatnonzero(np.isfinite(true_m))
    assert len(walking) == 709

    def level(offset_m):
        delay_s = 2 * (true_m[walking] + offset_m) / SPEED_OF_LIGHT_M_S
        tap = np.rint((delay_s - radar.first_tap_delay_s) / radar.sample_interval_s).astype(int)
        return np.median(envelope[walking, np.clip(tap, 0, radar.taps - 1)])

    before, behind = (np.mean([level(sign * step) for step in (0.1, 0.15, 0.2, 0.25)]) for sign in (-1, 1))
    assert behind > 3 * before
