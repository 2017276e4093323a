import dataclasses

import numpy as np
import pytest

import uwbbench
from tests.fixtures.chance import seed
from uwbbench.api import ConfigError, Obstacle, ScoringError, Truth
from uwbbench.config.source import open_dataset
from uwbbench.detect.pipeline import Pipeline, detector_from_yaml
from uwbbench.measure.calibration import Calibration
from uwbbench_detectors.position.ranging import Range, RangeParams


@pytest.fixture(scope="module")
def short_approach():
    dataset = open_dataset("approach", {"start_m": 1.6, "speed_m_s": 0.321, "seed": seed()}, ())
    return dataset.open(dataset.names()[0])


def shifted_paper(bias_m: float = 0.0, bias_deg: float = 0.0) -> Pipeline:
    changes = {"pipeline.range.params.bias_m": bias_m, "pipeline.azimuth.params.bias_deg": bias_deg}
    return uwbbench.load_detector("paper", changes=changes)


def test_bias_is_found_minus_true(short_approach):
    plain = uwbbench.calibrate(shifted_paper(), short_approach)
    short = uwbbench.calibrate(shifted_paper(bias_m=0.30), short_approach)
    right = uwbbench.calibrate(shifted_paper(bias_deg=5.0), short_approach)
    assert short.range_bias_m - plain.range_bias_m == pytest.approx(-0.30)
    assert np.rad2deg(right.azimuth_bias_rad - plain.azimuth_bias_rad) == pytest.approx(-5.0)


def test_settings_add_to_what_is_subtracted_and_leave_no_bias(short_approach):
    calibration = uwbbench.calibrate(shifted_paper(0.30, 1.0), short_approach)
    settings = calibration.as_settings()
    assert settings["pipeline.range.params.bias_m"] == pytest.approx(0.30 + calibration.range_bias_m)
    assert settings["pipeline.azimuth.params.bias_deg"] == pytest.approx(1 + np.rad2deg(calibration.azimuth_bias_rad))
    again = uwbbench.calibrate(uwbbench.load_detector("paper", changes=settings), short_approach)
    assert abs(again.range_bias_m) < 0.01
    assert abs(again.azimuth_bias_rad) < 1e-4


def test_detector_without_azimuth_gets_a_range_bias_alone(short_approach):
    calibration = uwbbench.calibrate(uwbbench.load_detector("background-mean"), short_approach)
    assert calibration.azimuth_bias_rad is None
    assert list(calibration.as_settings()) == ["pipeline.range.params.bias_m"]


def test_oracle_has_no_bias(short_approach):
    calibration = uwbbench.calibrate(uwbbench.load_detector("oracle"), short_approach)
    assert calibration.range_bias_m == 0.0
    assert calibration.azimuth_bias_rad == pytest.approx(0.0, abs=1e-12)
    assert calibration.n == len(short_approach)


def test_offset_of_the_capture_s_channel_is_the_one_added_to(short_approach):
    channel_9_m = shifted_paper({"by_channel": {5: 1.0, 9: 0.2}})
    calibration = uwbbench.calibrate(channel_9_m, short_approach)
    assert calibration.as_settings()["pipeline.range.params.bias_m"] == pytest.approx(0.2 + calibration.range_bias_m)


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        ({"pipeline.range.params.bias_m": "paper"}, "pipeline.range.params.bias_m"),
        ({"pipeline.azimuth.params.bias_domain": "alpha"}, "pipeline.azimuth.params.bias_domain"),
    ],
)
def test_offsets_that_nothing_can_be_added_to_are_an_error(short_approach, changes, place):
    calibration = uwbbench.calibrate(uwbbench.load_detector("paper", changes=changes), short_approach)
    with pytest.raises(ConfigError, match=place):
        calibration.as_settings()


def test_detector_without_a_range_step_has_nothing_to_set(short_approach):
    calibration = uwbbench.calibrate(uwbbench.load_detector("oracle"), short_approach)
    with pytest.raises(ConfigError, match="range"):
        calibration.as_settings()


def test_settings_name_a_step_by_its_own_name():
    stages = {"my range": Range(RangeParams(bias_m=0.1))}
    assert Calibration(0.2, None, 10, stages).as_settings() == {"pipeline.my range.params.bias_m": pytest.approx(0.3)}


def test_an_azimuth_offset_that_no_step_takes_is_left_out():
    measured = Calibration(0.2, 0.1, 10, {"range": Range(RangeParams())})
    assert not measured.takes_azimuth
    assert measured.as_settings() == {"pipeline.range.params.bias_m": 0.2}


def test_no_truth_is_an_error(short_approach):
    with pytest.raises(ScoringError, match="ground truth"):
        uwbbench.calibrate(shifted_paper(), dataclasses.replace(short_approach, truth=None))


def test_too_few_matches_are_an_error(short_approach):
    far = Truth((Obstacle("far", "metal", np.array([[500.0, 0.0]])),))
    with pytest.raises(ScoringError, match="only 0 detections"):
        uwbbench.calibrate(shifted_paper(), dataclasses.replace(short_approach, truth=far))


def test_detector_that_finds_nothing_is_an_error(short_approach):
    with pytest.raises(ScoringError, match="only 0 detections"):
        uwbbench.calibrate(uwbbench.load_detector("null"), short_approach)


def test_structure_and_occluded_objects_are_not_compared_with(short_approach):
    plate = short_approach.truth.objects[0]
    beside_m = plate.outline_m + np.array([0.3, 0.0])
    others = (Obstacle("wall", "concrete", beside_m - 0.6, structure=True), Obstacle("hidden", "metal", beside_m))
    crowded = dataclasses.replace(short_approach, truth=Truth((plate, others[1])))
    plain = uwbbench.calibrate(shifted_paper(), short_approach)
    assert uwbbench.calibrate(shifted_paper(), crowded).range_bias_m == pytest.approx(plain.range_bias_m)
    walled = detector_from_yaml("{schema: 1, name: one, pipeline: [{use: reference.constant}]}")
    only_wall = dataclasses.replace(short_approach, truth=Truth((others[0],)))
    with pytest.raises(ScoringError, match="only 0 detections"):
        uwbbench.calibrate(walled, only_wall)


@pytest.mark.parametrize("gate_m", [0.0, -1.0, float("nan")])
def test_gate_must_be_positive(short_approach, gate_m):
    with pytest.raises(ValueError, match="gate_m"):
        uwbbench.calibrate(shifted_paper(), short_approach, gate_m=gate_m)
