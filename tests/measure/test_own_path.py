"""What a drive shows of the robot itself, and a detector's zero of delay from it."""

import math

import numpy as np
import pytest

from tests.api.ringing_robot import INTERVAL_S, frames_of, gauss, radar_of
from uwbbench.api import SPEED_OF_LIGHT_M_S, Capture, ConfigError, ScoringError, Trajectory, stated_pulse
from uwbbench.detect.pipeline import detector_from_yaml
from uwbbench.measure.calibration import Calibration, settings_by_receiver
from uwbbench.measure.own_path import calibrate_zero, own_paths
from uwbbench_detectors.position.ranging import Range, RangeParams

CM = 0.01
PEAKS = "{use: profile.amplitude}, {use: peaks}, {use: range, params: {bias_m: 0.3}}"
CREST = detector_from_yaml(
    f"{{schema: 1, name: d, pipeline: [{{use: first_path.crest, params: {{interpolate: true}}}}, {PEAKS}]}}"
)


def capture_of(samples, **radar):
    frames = len(samples)
    trajectory = Trajectory(np.arange(frames) / 48.0, np.zeros((frames, 3)), np.zeros(frames))
    return Capture(name="drive", radar=radar_of(**radar), trajectory=trajectory, preamble=samples)


@pytest.fixture(scope="module")
def drive():
    """A drive past an echo, and where its direct path lies behind its crest, in metres of range."""
    samples, _ = frames_of(frames=100)
    fine = np.arange(6.0, 8.0, 1e-3)
    time_s = (fine - 7) * INTERVAL_S
    from tests.api.ringing_robot import RETURNS

    whole = gauss(time_s) + sum(amplitude * gauss(time_s - delay_s) for delay_s, amplitude in RETURNS)
    zero_m = (7 - fine[np.abs(whole).argmax()]) * INTERVAL_S * SPEED_OF_LIGHT_M_S / 2
    return capture_of(samples), zero_m


def test_a_drive_with_an_echo_shows_pulse_and_zero(drive):
    capture, zero_m = drive
    (own,) = own_paths(capture)
    assert (own.response, own.frames, own.doubt) == ("preamble", 100, "")
    assert own.pulse_width_s == pytest.approx(3.2e-9, rel=0.02)
    assert own.zero_m == pytest.approx(zero_m, abs=1 * CM)
    assert abs(own.zero_m - zero_m) < 3 * own.zero_sd_m
    assert own.snr_db == pytest.approx(-20 * math.log10(3e-4 * math.sqrt(2)), abs=1.5)


def test_the_zero_replaces_the_offset_that_a_detector_has(drive):
    capture, zero_m = drive
    calibration = calibrate_zero(CREST, capture)
    settings = calibration.as_settings()
    assert calibration.range_bias_m == pytest.approx(zero_m, abs=1 * CM)
    assert settings == {"pipeline.range.params.bias_m": pytest.approx(calibration.range_bias_m)}


def test_a_first_path_of_another_kind_is_measured_with_its_own_offset(drive):
    capture, _ = drive
    edge = detector_from_yaml(f"{{schema: 1, name: e, pipeline: [{{use: first_path.leading_edge}}, {PEAKS}]}}")
    later_m = calibrate_zero(edge, capture).range_bias_m - calibrate_zero(CREST, capture).range_bias_m
    assert later_m == pytest.approx(1.6e-9 * SPEED_OF_LIGHT_M_S / 2, abs=4 * CM)


def test_zeros_of_responses_go_to_the_step_that_takes_them(drive):
    capture, zero_m = drive
    aligned = detector_from_yaml(
        "{schema: 1, name: a, pipeline: [{use: align}, {use: first_path.crest}, "
        f"{{use: align.zero, params: {{preamble_ns: 5.0}}}}, {PEAKS}]}}"
    )
    settings = calibrate_zero(aligned, capture).as_settings()
    assert list(settings) == ["pipeline.align.zero.params.preamble_ns"]
    zero_ns = settings["pipeline.align.zero.params.preamble_ns"]
    assert zero_ns * 1e-9 * SPEED_OF_LIGHT_M_S / 2 == pytest.approx(zero_m, abs=1 * CM)


def test_an_empty_drive_gives_a_zero_by_a_stated_pulse_alone():
    empty = capture_of(frames_of(frames=100, echo=0.0)[0])
    with pytest.raises(ScoringError, match=r"only 0 echoes .* unless the pulse is stated"):
        calibrate_zero(CREST, empty)
    (own,) = own_paths(empty, stated_pulse("gauss", 3.2e-9))
    assert (own.echoes, own.doubt) == (0, "")
    assert math.isnan(own.pulse_width_s)
    with pytest.raises(ScoringError, match="does not rise like the pulse"):
        calibrate_zero(CREST, empty, stated_pulse("gauss", 5e-9))


def test_a_capture_without_a_direct_path_is_one_message():
    with pytest.raises(ScoringError, match="no frame's preamble has a direct path"):
        own_paths(capture_of(np.zeros((3, 50), complex)))
    with pytest.raises(ScoringError, match="count from transmission"):
        own_paths(capture_of(np.zeros((3, 50), complex), first_tap_delay_s=0.0))


def test_each_receiver_has_an_offset_of_its_own():
    stages = {"range": Range(RangeParams(bias_m=0.1))}
    front, side = Calibration(0.02, None, 10, stages), Calibration(-0.03, None, 10, stages)
    assert settings_by_receiver({"front": front}) == front.as_settings()
    settings = settings_by_receiver({"front": front, "side": side})
    assert settings == {"pipeline.range.params.bias_m": {"front": pytest.approx(0.12), "side": pytest.approx(0.07)}}


def test_an_azimuth_that_some_receivers_lack_is_one_message():
    class Both(Range):
        def recalibrated(self, column, offset):
            return {"bias_m" if column == "range_m" else "turn": offset}

    stages = {"both": Both(RangeParams())}
    with pytest.raises(ConfigError, match="azimuth could not be measured on side"):
        settings_by_receiver({"front": Calibration(0.0, 0.1, 10, stages), "side": Calibration(0.0, None, 10, stages)})
