"""PulsON 440 stops before a tree: synthetic files with known content, and the measured ones."""

import numpy as np
import pytest

from tests.datasets.measured.test_pulson440 import SAMPLES, SIZES, packet, scan_file
from uwbbench.api import SPEED_OF_LIGHT_M_S, CaptureError, analytic
from uwbbench.config.source import open_dataset

STOPS = 23
ORDER = [0, 1, *range(6, 16), 2, *range(16, 23), 3, 4, 5]
"""File of each stop."""


def stop_file(start_ms, **changes):
    packets = [packet(scan, index, time=start_ms + 20 * scan, **changes) for scan in range(4) for index in range(3)]
    return scan_file(packets, changes.get("start", 23342))


@pytest.fixture
def folder(tmp_path):
    for stop, number in enumerate(ORDER):
        (tmp_path / f"scan_{number + 1}.txt").write_bytes(stop_file(1000 * stop + 5000))
    return tmp_path


def tree(folder, **params):
    return open_dataset("pulson440-tree", params, [folder]).open("trial_1")


def test_stops_follow_the_clock_and_not_the_numbers_of_their_files(folder):
    capture = tree(folder, frames="scans")
    np.testing.assert_allclose(
        capture.trajectory.timestamp_s, (1.0 * np.arange(STOPS)[:, None] + 0.02 * np.arange(4)).ravel()
    )
    np.testing.assert_allclose(capture.trajectory.position_m[::4, 1], 0.3048 * (11 - np.arange(STOPS)), atol=1e-12)
    np.testing.assert_array_equal(capture.preamble[:4], SAMPLES.astype(np.float32))
    assert capture.radar.frame_rate_hz == pytest.approx(50)


def test_a_frame_is_the_mean_of_the_scans_of_a_stop(folder):
    capture = tree(folder)
    assert capture.preamble.shape == (STOPS, sum(SIZES))
    np.testing.assert_allclose(capture.preamble[0], SAMPLES.mean(axis=0), rtol=1e-6)
    np.testing.assert_allclose(np.diff(capture.trajectory.timestamp_s), 1.0)
    assert capture.radar.frame_rate_hz == pytest.approx(1.0)


def test_the_tree_stands_where_it_was_taped_and_the_capture_says_what_was_fitted(folder):
    capture = tree(folder)
    range_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[:, 0]
    assert range_m[11] == pytest.approx(25 * 0.3048)
    assert np.argmin(range_m) == 14  # 0.95 m to the right of the middle
    assert not capture.truth.exhaustive
    assert "FITTED ON THE SCORED OBJECT" in capture.description


def test_range_counts_from_the_device_less_a_bias(folder):
    start_m = SPEED_OF_LIGHT_M_S * (23342e-12 - 10e-9) / 2
    for bias_m in (0.0, 0.44):
        radar = tree(folder, range_bias_m=bias_m).radar
        assert radar.first_tap_delay_s * SPEED_OF_LIGHT_M_S / 2 == pytest.approx(start_m - bias_m)


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (stop_file(99_000, start=1000), r"start_s differs from that of .*scan_1\.txt"),
        (stop_file(99_000, step=16), "sample_interval_s differs"),
        (stop_file(5_010), r"recorded while .*scan_1\.txt was"),
        (b"", "ends inside"),
    ],
)
def test_a_stop_that_does_not_belong_to_the_others_is_named(content, what, folder):
    (folder / "scan_9.txt").write_bytes(content)
    with pytest.raises(CaptureError, match=rf"scan_9\.txt: .*{what}"):
        tree(folder)


def test_a_missing_stop_is_named_with_the_command_that_brings_it(folder):
    (folder / "scan_17.txt").unlink()
    with pytest.raises(CaptureError, match=r"scan_17\.txt.*uwbbench fetch"):
        tree(folder)


@pytest.mark.data
def test_the_echo_of_the_measured_tree_is_a_hyperbola_in_the_order_of_the_clock(data_dir):
    """The strongest bin beyond 4.5 m is the tree at most stops; in the order of the names it is at fewer."""
    capture = tree(data_dir)
    samples = np.asarray(capture.preamble, float)
    envelope = np.abs(analytic(samples - np.median(samples, axis=0)))
    radar = capture.radar
    delay_s = radar.first_tap_delay_s + np.arange(radar.taps) * radar.sample_interval_s
    range_m = delay_s * SPEED_OF_LIGHT_M_S / 2
    strongest_m = range_m[np.argmax(np.where(range_m > 4.5, envelope, 0), axis=1)]
    true_m = capture.truth.seen_from(radar, capture.trajectory).range_m[:, 0]
    error_m = np.abs(strongest_m - true_m)
    assert (error_m < 0.2).sum() >= 18
    assert np.median(error_m) < 0.08
