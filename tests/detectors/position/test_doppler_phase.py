"""Azimuth from Doppler and phase difference together."""

import numpy as np
import pytest

from uwbbench.api import SPEED_OF_LIGHT_M_S, ConfigError, Detections

TAP_M = SPEED_OF_LIGHT_M_S * 1e-9 / 2


def _found(make_radar, make_block, make_stage, run_stage, point_m, motion_rad, transmitter_m=(0.0, 0.0, 0.0)):
    """Azimuth of a point, from what the bank would measure of it."""
    radar = make_radar(has_sts=True, array_spacing_m=0.0178, tx_position_m=transmitter_m)
    point = np.asarray(point_m)
    path_m = np.hypot(*point) + np.hypot(*(point - transmitter_m[:2]))
    middle = point - np.asarray(transmitter_m[:2]) / 2
    seen_rad = np.arctan2(middle[1], middle[0])
    azimuth = np.arctan2(point[1], point[0])
    tap = 7 + (path_m - radar.baseline_length_m) / (2 * TAP_M)
    rows = Detections(
        [0],
        tap=[tap],
        score_db=[40.0],
        motion_cosine=[np.cos(seen_rad - motion_rad)],
        motion_cosine_sd=[0.06],
        motion_rad=[motion_rad],
        pdoa_rad=[2 * np.pi * 0.0178 / radar.wavelength_m * np.sin(azimuth)],
    )
    block = make_block(np.ones((1, 50)), first_path=np.array([7.0]), detections=rows)
    found = run_stage(make_stage("angle.doppler_phase"), radar, block).detections
    return np.rad2deg(found["azimuth_rad"][0] - azimuth), found["angle_cost"][0]


@pytest.mark.parametrize("azimuth_deg", [-80, -35, 0, 20, 44, 75, 130, -150])
@pytest.mark.parametrize("motion_rad", [0.0, 0.3])
def test_both_agree_on_where_a_point_is(azimuth_deg, motion_rad, make_radar, make_block, make_stage, run_stage):
    point = 3 * np.array([np.cos(np.deg2rad(azimuth_deg)), np.sin(np.deg2rad(azimuth_deg))])
    error_deg, cost = _found(make_radar, make_block, make_stage, run_stage, point, motion_rad)
    assert abs(error_deg) < 1.5
    assert cost < 0.35


def test_a_near_point_is_seen_from_the_receiver(make_radar, make_block, make_stage, run_stage):
    error_deg, cost = _found(
        make_radar, make_block, make_stage, run_stage, (0.5, 0.2), 0.0, transmitter_m=(0.0, -0.25, 0.0)
    )
    assert abs(error_deg) < 3
    assert cost < 0.05


def test_an_echo_whose_directions_disagree_is_costly(make_radar, make_block, make_stage):
    stage = make_stage("angle.doppler_phase")
    stage.open(make_radar(has_sts=True, array_spacing_m=0.0178))
    rows = Detections(
        [0], tap=[20.0], score_db=[40.0], motion_cosine=[0.5], motion_cosine_sd=[0.06], motion_rad=[0.0], pdoa_rad=[0.0]
    )
    block = make_block(np.ones((1, 50)), first_path=np.array([7.0]), detections=rows)
    assert stage.step(block).detections["angle_cost"][0] > 1.5


def test_without_the_spacing_of_the_antennas_it_is_refused(make_radar, make_stage):
    with pytest.raises(ConfigError, match="antenna spacing"):
        make_stage("angle.doppler_phase").open(make_radar(has_sts=True))
