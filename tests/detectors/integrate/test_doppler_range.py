"""The Doppler-range bank."""

import numpy as np
import pytest
from scipy.special import gammaincc

from uwbbench_detectors.integrate.doppler_range import geometric_phase_rad, least_power

STEP_M = 0.006


def _rows(make_stage, run_stage, radar, block, **params):
    return run_stage(make_stage("integrate.doppler_range", **params), radar, block).detections


@pytest.mark.parametrize("azimuth_deg", [0, 30, -60, 90])
def test_a_point_is_found_at_its_range_and_cosine(azimuth_deg, array_radar, make_drive, make_stage, run_stage):
    x_m = STEP_M * np.arange(60)
    azimuth = np.deg2rad(azimuth_deg)
    point = (x_m[-1] + 3 * np.cos(azimuth), 3 * np.sin(azimuth))
    rows = _rows(make_stage, run_stage, array_radar, make_drive([point], x_m), second=True)
    last = rows.take(rows.frame == 59)
    best = np.argmax(last["score_db"])
    assert last["tap"][best] == pytest.approx(7 + 3 / 0.149896229, abs=0.05)
    assert last["motion_cosine"][best] == pytest.approx(np.cos(azimuth), abs=0.04)
    assert last["pdoa_rad"][best] == pytest.approx(2.979 * np.sin(azimuth), abs=0.15)
    assert last["motion_rad"][best] == 0
    assert last["held"][best] == 0


def test_phase_differences_count_from_the_direct_path_as_it_was_measured(
    array_radar, make_drive, make_stage, run_stage
):
    block = make_drive([(3.0, 0.0)], STEP_M * np.arange(30))
    usual, turned = (
        _rows(make_stage, run_stage, array_radar, block, second=True, direct_phase_rad=phase) for phase in (None, 0.5)
    )
    expected = usual["pdoa_rad"] - geometric_phase_rad(array_radar) + 0.5
    np.testing.assert_allclose(np.exp(1j * turned["pdoa_rad"]), np.exp(1j * expected), atol=1e-5)


def test_an_echo_below_the_noise_of_a_frame_is_found(array_radar, make_drive, make_stage, run_stage):
    """Fifteen decibels for 32 frames, three for the second channel."""
    block = make_drive([(4.0, 0.0)], STEP_M * np.arange(150), noise=0.07)
    rows = _rows(make_stage, run_stage, array_radar, block, second=True)
    late = rows.take(rows.frame >= 50)
    true = np.abs(late["tap"] - 7 - (4.0 - STEP_M * late.frame) / 0.149896229) < 1
    assert len(np.unique(late.frame[true])) > 90


@pytest.mark.parametrize("second", [False, True])
def test_noise_alone_passes_as_often_as_is_stated(second, array_radar, make_drive, make_stage, run_stage):
    frames, rate = 1500, 1e-3
    block = make_drive([], STEP_M * np.arange(frames), seed=3)
    rows = _rows(make_stage, run_stage, array_radar, block, second=second, false_alarm_rate=rate)
    # At most one maximum in each cell of 33 cosines and 40 taps above the threshold; neighbours share them.
    assert 0.01 * rate < len(rows) / (frames * 33 * 40) < 1.2 * rate


@pytest.mark.parametrize(("rate", "channels"), [(1e-7, 1), (1e-7, 2), (1e-3, 2), (0.5, 2)])
def test_the_threshold_is_that_of_its_rate(rate, channels):
    assert gammaincc(channels, least_power(rate, channels)) == pytest.approx(rate, rel=1e-6)


def test_a_robot_that_stops_keeps_its_rows_as_held(array_radar, make_drive, make_stage, run_stage):
    x_m = STEP_M * np.minimum(np.arange(200), 60)
    rows = _rows(make_stage, run_stage, array_radar, make_drive([(3.0, 0.0)], x_m), second=True)
    standing = rows.take(rows.frame > 60)
    assert len(np.unique(standing.frame)) == 139
    np.testing.assert_array_equal(standing["held"], 1)
    assert len(np.unique(standing["tap"])) == np.sum(rows.frame == 60)


def test_a_robot_that_turns_on_the_spot_has_no_rows_until_it_moves(array_radar, make_drive, make_stage, run_stage):
    frame = np.arange(200)
    x_m = STEP_M * (np.minimum(frame, 60) + np.maximum(frame - 150, 0))
    yaw_rad = np.deg2rad(1.2) * np.clip(frame - 60, 0, 60)
    rows = _rows(make_stage, run_stage, array_radar, make_drive([(3.0, 0.5)], x_m, yaw_rad=yaw_rad), second=True)
    assert np.sum(rows.frame < 60) > 40
    assert not np.any((rows.frame > 75) & (rows.frame <= 150))
    assert np.any(rows.frame > 150)


def test_one_that_has_never_moved_has_no_rows(array_radar, make_drive, make_stage, run_stage):
    rows = _rows(make_stage, run_stage, array_radar, make_drive([(3.0, 0.0)], np.zeros(50)), second=True)
    assert len(rows) == 0


def test_driving_back_is_motion_too(array_radar, make_drive, make_stage, run_stage):
    x_m = STEP_M * np.abs(np.arange(120) - 60)
    rows = _rows(make_stage, run_stage, array_radar, make_drive([(3.0, 0.0)], x_m), second=True)
    last = rows.take(rows.frame == 119)
    assert abs(last["motion_cosine"][np.argmax(last["score_db"])]) == pytest.approx(1, abs=0.05)
    assert last["tap"][np.argmax(last["score_db"])] == pytest.approx(7 + (3 - x_m[-1]) / 0.149896229, abs=0.1)


def test_any_cut_into_blocks_gives_the_same_bits(array_radar, make_drive, run_cut, one_by_one):
    block = make_drive([(3.0, 0.5), (2.0, -1.0)], STEP_M * np.arange(60))
    run_cut("integrate.doppler_range", {"second": True}, array_radar, block, one_by_one(60))
