"""The built-in simulated approach: what it promises to those who test against it."""

import numpy as np
import pytest

from uwbbench.api import CaptureError, ConfigError, write_capture
from uwbbench.api.capture_file import open_capture
from uwbbench.config.source import open_dataset


def simulated_approach(**params):
    dataset = open_dataset("approach", params, [])
    return dataset.open(dataset.names()[0])


def test_the_same_parameters_give_the_same_capture():
    assert simulated_approach().sha256 == simulated_approach().sha256


def test_another_seed_gives_other_noise():
    assert simulated_approach(seed=2).sha256 != simulated_approach().sha256


def test_runs_differ_in_noise_and_share_the_scene():
    dataset = open_dataset("approach", {"runs": 2}, [])
    first, second = (dataset.open(name) for name in dataset.names())
    assert first.sha256 != second.sha256
    np.testing.assert_array_equal(first.truth.objects[0].outline_m, second.truth.objects[0].outline_m)


def test_the_plate_is_approached_from_start_to_stop():
    capture = simulated_approach(start_m=2.0, stop_m=1.0, lateral_m=0.0)
    range_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[:, 0]
    np.testing.assert_allclose(range_m[[0, -1]], [2.0, 1.0], atol=1e-12)
    assert np.all(np.diff(range_m) < 0)


@pytest.mark.parametrize("channel", [5, 9])
def test_without_noise_to_speak_of_the_strongest_late_tap_is_the_plate(channel):
    capture = simulated_approach(channel=channel, start_m=2.0, stop_m=1.5)
    frames = capture.frames()
    truth_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[:, 0]
    excess_m = np.hypot(truth_m, 0.25) + truth_m - 0.25
    expected = frames.first_path_index + excess_m / 299_792_458 / capture.radar.sample_interval_s
    late = 14 + np.argmax(frames.amplitude[:, 14:], axis=1)
    assert np.median(np.abs(late - expected)) < 1.0


def test_without_sts_it_has_none_and_says_so():
    capture = simulated_approach(sts=False)
    assert (capture.sts1, capture.sts2, capture.radar.has_sts) == (None, None, False)


def test_it_says_that_it_is_simulated():
    assert simulated_approach().source == "simulated"


def test_it_survives_the_capture_file_unchanged(tmp_path):
    capture = simulated_approach(start_m=1.0, stop_m=0.8)
    write_capture(tmp_path / "run.h5", capture)
    assert open_capture(tmp_path / "run.h5").sha256 == capture.sha256


def test_an_unknown_run_suggests_the_nearest():
    with pytest.raises(CaptureError, match="Did you mean 'approach-ch9-metal-1'"):
        open_dataset("approach", {}, []).open("approach-ch9-metal-2")


def test_a_mistyped_parameter_is_named():
    with pytest.raises(ConfigError, match=r"unknown key 'chanel'\. Did you mean 'channel'"):
        open_dataset("approach", {"chanel": 9}, [])
