"""Scenes of radars that are no IEEE 802.15.4 radio."""

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from uwbbench.api import SPEED_OF_LIGHT_M_S, ConfigError, open_capture, write_capture
from uwbbench_datasets.simulator.radar import RadarModel
from uwbbench_datasets.simulator.scene import read_scenes

DEVICE = {
    "model": "PulsON 440",
    "carrier_ghz": 3.95,
    "bandwidth_ghz": 1.4,
    "sample_interval_ns": 0.061,
    "samples": "rf",
    "first_tap_delay_ns": 7.5,
}
POST = {"id": "post", "shape": "point", "center_m": [3.0, 0.0]}


def of_device(run_scene, **device: Any):
    return run_scene(
        [{"use": "direct"}, {"use": "echo.point"}],
        radar={"device": {**DEVICE, **device}, "taps": 400},
        trajectory={"kind": "static", "duration_s": 0.1},
        objects=[POST],
    )


def test_an_echo_stands_at_its_delay_from_transmission(run_scene) -> None:
    capture = of_device(run_scene)
    radar = capture.radar
    assert (radar.channel, radar.has_sts, radar.samples, radar.model) == (None, False, "rf", "simulated PulsON 440")
    crest = int(np.abs(capture.frames().preamble[0]).argmax())
    flown = 3.0 + np.hypot(3.0, radar.baseline_length_m)
    delay_s = radar.first_tap_delay_s + crest * radar.sample_interval_s
    assert delay_s * SPEED_OF_LIGHT_M_S == pytest.approx(flown, abs=0.02)


def test_real_samples_are_the_real_part_at_the_carrier(run_scene) -> None:
    real, envelope = of_device(run_scene), of_device(run_scene, samples="iq")
    assert np.asarray(real.preamble).dtype == np.float32
    analytic, expected = real.frames().preamble[0], np.asarray(envelope.preamble)[0]
    size = np.abs(expected).max()
    assert np.abs(np.abs(analytic) - np.abs(expected)).max() < 0.01 * size
    turns = np.exp(2j * np.pi * real.radar.center_frequency_hz * real.radar.sample_interval_s * np.arange(400))
    assert np.abs(analytic - expected * turns).max() < 0.01 * size


def test_the_pulse_is_as_wide_as_the_band_allows(run_scene) -> None:
    pulse = RadarModel.model_validate({"device": DEVICE}).shape()
    time_s = np.arange(-512, 512) * 0.061e-9
    spectrum_db = 20 * np.log10(np.abs(np.fft.rfft(pulse(time_s))) + 1e-12)
    within = np.fft.rfftfreq(1024, 0.061e-9)[spectrum_db > spectrum_db[0] - 10]
    assert 2 * within[-1] == pytest.approx(1.4e9, rel=0.05)


def test_it_is_written_and_read_like_any_capture(run_scene, tmp_path) -> None:
    capture = of_device(run_scene)
    write_capture(tmp_path / "run.h5", capture)
    assert open_capture(tmp_path / "run.h5").sha256 == capture.sha256


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"channel": 9}, "a radar with a device of its own has no channel"),
        ({"sts": True}, "has no sts"),
        ({"crest_tap": 3.0}, "has no crest_tap"),
        ({"device": {**DEVICE, "carrier_ghz": 0.5}}, "carrier_ghz must be more than half"),
    ],
)
def test_what_a_device_does_not_have_is_refused(given, message) -> None:
    with pytest.raises(ValidationError, match=message):
        RadarModel.model_validate({"device": DEVICE, **given})


def test_the_robot_of_a_radio_is_refused(tmp_path) -> None:
    (tmp_path / "scene.yaml").write_text(
        "schema: 1\nrobot: twin\nradar: {device: {model: a, carrier_ghz: 4, bandwidth_ghz: 1, sample_interval_ns: 1}}\n"
        "trajectory: {kind: static, duration_s: 1}\nterms: [{use: direct}]\n"
    )
    with pytest.raises(ConfigError, match="is the robot of another radar: the scene's has a device of its own"):
        read_scenes(tmp_path / "scene.yaml")
