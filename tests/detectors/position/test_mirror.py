"""Range of a mirror that faces the radar."""

import numpy as np
import pytest

from uwbbench.api import SPEED_OF_LIGHT_M_S, Detections


def _ranges(make_radar, make_block, make_stage, run_stage, path_m, azimuth_rad, transmitter_m, **params):
    radar = make_radar(tx_position_m=transmitter_m)
    tap = 7 + (np.asarray(path_m) - radar.baseline_length_m) / (SPEED_OF_LIGHT_M_S * 1e-9)
    rows = Detections(np.zeros(len(tap), int), tap=tap, azimuth_rad=azimuth_rad)
    block = make_block(np.ones((1, 50)), first_path=np.array([7.0]), detections=rows)
    return run_stage(make_stage("range.mirror", **params), radar, block).detections.range_m


@pytest.mark.parametrize("transmitter_m", [(0.0, -0.25, 0.0), (-0.2, 0.0, 0.0), (0.1, 0.2, 0.0)])
@pytest.mark.parametrize("azimuth_deg", [0.0, 25.0, -40.0])
@pytest.mark.parametrize("range_m", [0.3, 2.0, 5.0])
def test_the_path_goes_by_way_of_the_transmitters_image(
    transmitter_m, azimuth_deg, range_m, make_radar, make_block, make_stage, run_stage
):
    normal = np.array([np.cos(np.deg2rad(azimuth_deg)), np.sin(np.deg2rad(azimuth_deg))])
    at = np.asarray(transmitter_m[:2])
    path_m = np.linalg.norm(at + 2 * (range_m - at @ normal) * normal)
    found = _ranges(make_radar, make_block, make_stage, run_stage, [path_m], [np.deg2rad(azimuth_deg)], transmitter_m)
    assert found[0] == pytest.approx(range_m, abs=1e-9)


def test_next_to_the_direct_path_no_digits_are_lost(make_radar, make_block, make_stage, run_stage):
    transmitter_m = (-0.2, 0.0, 0.0)
    found = _ranges(make_radar, make_block, make_stage, run_stage, [0.2 + 1e-9], [0.0], transmitter_m)
    assert found[0] == pytest.approx(5e-10, rel=1e-5)


def test_before_the_direct_path_there_is_no_range(make_radar, make_block, make_stage, run_stage):
    found = _ranges(make_radar, make_block, make_stage, run_stage, [0.1], [0.0], (0.0, -0.25, 0.0))
    assert np.isnan(found[0])


def test_without_an_azimuth_it_faces_along_the_boresight(make_radar, make_block, make_stage, run_stage):
    given = [np.nan, 0.0, 0.1, 0.5]
    found = _ranges(make_radar, make_block, make_stage, run_stage, [4.0] * 4, given, (0.0, -0.25, 0.0))
    assert found[0] == found[1] == found[2]
    assert found[3] != found[0]


def test_an_offset_is_taken_off(make_radar, make_block, make_stage, run_stage):
    plain = _ranges(make_radar, make_block, make_stage, run_stage, [4.0], [0.0], (0.0, -0.25, 0.0))
    less = _ranges(make_radar, make_block, make_stage, run_stage, [4.0], [0.0], (0.0, -0.25, 0.0), bias_m=0.1)
    assert plain[0] - less[0] == pytest.approx(0.1)
