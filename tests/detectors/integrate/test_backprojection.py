"""Evidence for fixed objects along a way: made-up points, seen from places that a test chooses."""

import numpy as np
import pytest
from scipy.stats import gamma

from uwbbench import load_detector
from uwbbench.api import SPEED_OF_LIGHT_M_S
from uwbbench.config.source import open_dataset
from uwbbench.measure.accuracy.scoring import Region, score
from uwbbench_detectors.integrate.backprojection import thresholds

STEP_M = 0.005
"""Between frames: less than an eighth of the wavelength of 6 cm."""
RADAR = {"center_frequency_hz": 5e9, "bandwidth_hz": 1e9, "sample_interval_s": 0.5e-9, "noise_taps": 0}
NOISE = 0.01


def straight(frames, step_m=STEP_M):
    """Places (frames, 3) along y, the boresight along x."""
    return np.column_stack([np.zeros(frames), step_m * np.arange(frames), np.zeros(frames)])


def scans(places_m, points, taps=64, seed=0):
    """Frames of points (x, y, amplitude): a Gaussian pulse at the delay of each, and noise."""
    rng = np.random.default_rng(seed)
    made = NOISE * (rng.normal(size=(len(places_m), taps)) + 1j * rng.normal(size=(len(places_m), taps)))
    for x, y, height in points:
        delay_s = 2 * np.hypot(x - places_m[:, 0], y - places_m[:, 1])[:, None] / SPEED_OF_LIGHT_M_S
        late_s = np.arange(taps) * RADAR["sample_interval_s"] - delay_s
        turn = np.exp(-2j * np.pi * RADAR["center_frequency_hz"] * delay_s)
        made += height * turn * np.exp(-((late_s * RADAR["bandwidth_hz"] * 1.8) ** 2))
    return made


@pytest.fixture
def located(make_radar, make_block, make_stage, run_stage):
    def run(samples, places_m, **params):
        block = make_block(samples, position_m=places_m, first_path=np.zeros(len(samples)))
        stage = make_stage("integrate.backprojection", **params)
        radar = make_radar(taps=samples.shape[1], first_tap_delay_s=0.0, **RADAR)
        return run_stage(stage, radar, block).detections, stage.notes

    return run


@pytest.mark.parametrize("rate", [0.5, 1e-6])
def test_thresholds_are_the_quantiles_of_the_gamma_distribution(rate):
    stretches = np.arange(1, 257)
    np.testing.assert_allclose(thresholds(rate, 256)[1:], gamma.isf(rate, stretches) - stretches, atol=1e-9)


@pytest.mark.slow
def test_two_points_are_the_strongest_objects_and_lie_where_they_are(located):
    places_m = straight(200)
    points = [(2.0, -0.3, 0.1), (2.4, 1.0, 0.1)]
    found, _ = located(scans(places_m, points), places_m)
    last = np.flatnonzero(found.frame == 199)[:2]
    near = np.sort(np.column_stack([found["x_m"], found["y_m"]])[last], axis=0)
    np.testing.assert_allclose(
        near, [(2.0, -0.3), (2.4, 1.0)], atol=0.15
    )  # across, within half of what a stretch resolves
    ranges_m = np.hypot([2.0, 2.4], 199 * STEP_M - np.array([-0.3, 1.0]))
    np.testing.assert_allclose(np.sort(found.range_m[last]), np.sort(ranges_m), atol=0.03)


@pytest.mark.slow
def test_rings_through_an_object_and_its_mirror_image_are_no_objects(located):
    places_m = straight(200)
    found, _ = located(scans(places_m, [(2.0, 0.5, 0.3)]), places_m, field_of_view_deg=360.0)
    last = found.take(found.frame == 199)
    assert np.abs(last.range_m - np.hypot(2.0, 199 * STEP_M - 0.5)).max() < 0.1
    assert len(last) == 1


@pytest.mark.slow
def test_noise_alone_is_no_object(located):
    places_m = straight(200)
    assert len(located(scans(places_m, []), places_m, false_alarm_rate=1e-12)[0]) == 0


@pytest.mark.slow
def test_a_standing_radar_adds_nothing_and_says_so(located):
    places_m = np.zeros((50, 3))
    samples = scans(places_m, [(2.0, 0.5, 0.3)])
    found, _ = located(samples, places_m)
    once, _ = located(samples[:1], places_m[:1])
    assert np.unique(found["score_db"]).tolist() == np.unique(once["score_db"]).tolist()
    _, notes = located(np.zeros((50, 64)), straight(50))
    assert any("did not move" in note for note in notes)


@pytest.mark.slow
def test_objects_stay_where_they_are_while_the_radar_pauses(located):
    places_m = np.concatenate([straight(120), np.tile(straight(120)[-1:], (60, 1))])
    found, _ = located(scans(places_m, [(2.0, 0.5, 0.1)]), places_m)
    paused = found.take(found.frame > 121)
    assert len(paused) == 58
    assert np.ptp(paused.range_m) == 0


@pytest.mark.slow
def test_stops_far_apart_are_added_by_their_power(located):
    places_m = straight(25, 0.2)
    found, _ = located(scans(places_m, [(3.0, 2.0, 0.1)], taps=80), places_m)
    last = found.take(found.frame == 24)
    assert abs(last.range_m[0] - np.hypot(3.0, 24 * 0.2 - 2.0)) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("smoothed", [False, True])
def test_any_cut_gives_the_same_rows(run_cut, make_radar, make_block, smoothed):
    places_m = straight(60)
    samples = scans(places_m, [(2.0, 0.5, 0.3)])
    samples[20], samples[30] = np.nan, 0
    block = make_block(samples, position_m=places_m + 1e6, first_path=np.zeros(60))
    radar = make_radar(taps=64, first_tap_delay_s=0.0, **RADAR)
    found = run_cut("integrate.backprojection", {"smoothed": smoothed}, radar, block, [1, 2, 17, 31]).detections
    assert len(found) > 30
    assert not np.isin([20, 30], found.frame).any()
    assert np.isfinite(found.range_m).all()


@pytest.mark.slow
def test_smoothed_rows_of_the_first_frames_know_what_came_later(located):
    places_m = straight(200)
    samples = scans(places_m, [(2.0, 0.5, 0.02)])
    early = [located(samples, places_m, smoothed=smoothed)[0] for smoothed in (False, True)]
    found, smooth = (each.take(each.frame < 5) for each in early)
    assert len(found) == 0
    assert np.abs(smooth.range_m - np.hypot(2.0, 0.5 - STEP_M * smooth.frame)).max() < 0.05
    assert len(smooth) == 5


@pytest.mark.slow
def test_samples_of_any_scale_give_the_same_rows(located):
    places_m = straight(60)
    samples = scans(places_m, [(2.0, 0.5, 0.3)])
    usual, _ = located(samples, places_m)
    for scale in (1e-20, 1e20):
        found, _ = located(samples * scale, places_m)
        np.testing.assert_allclose(found.range_m, usual.range_m, atol=1e-9)


@pytest.mark.slow
def test_a_burst_leaves_no_object(located):
    places_m = straight(100)
    samples = scans(places_m, [(2.0, 0.5, 0.1)])
    usual, _ = located(samples, places_m)
    samples[40:43] += 100 * scans(places_m[:3], [], seed=1)
    found, _ = located(samples, places_m)
    assert (found.frame == 99).sum() == (usual.frame == 99).sum() == 1


@pytest.mark.slow
@pytest.mark.data
@pytest.mark.parametrize(("name", "least"), [("champion-map", 0.9), ("champion-map-smoothed", 0.97)])
def test_both_reflectors_of_the_rail_are_its_strongest_objects(data_dir, name, least):
    found = None
    for side in ("left", "right"):
        dataset = open_dataset("pulson440-rail", {"frames": "moving", "reflectors": side}, [data_dir])
        capture = dataset.open(dataset.names()[0])
        found = found or load_detector(name).run(capture)
        assert score(found, capture, "object", 0.2, Region(6.0, 10.0), strongest=2).recall > least
