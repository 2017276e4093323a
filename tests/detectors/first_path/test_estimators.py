"""Where delays start."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api import ConfigError

FRAMES = 30
CONFIGS = [
    ("first_path.crest", {}),
    ("first_path.crest", {"interpolate": True}),
    ("first_path.leading_edge", {}),
    ("first_path.leading_edge", {"fraction": 0.1, "within_taps": 8}),
]
every_config = pytest.mark.parametrize(("name", "params"), CONFIGS)


def _gaussian(center, taps=50, width=1.4, height=1.0):
    return height * np.exp(-0.5 * ((np.arange(taps) - np.asarray(center)[..., None]) / width) ** 2)


@every_config
@settings(max_examples=10, deadline=None)
@given(cuts=st.lists(st.integers(0, FRAMES), max_size=8))
def test_any_cut_into_blocks_gives_the_same_bits(name, params, cuts, make_radar, make_block, make_echoes, run_cut):
    run_cut(name, params, make_radar(), make_block(make_echoes(FRAMES)), cuts)


def test_crest_is_the_largest_of_the_taps_behind_the_noise(make_radar, make_block, make_stage, run_stage):
    samples = np.zeros((1, 50))
    samples[0, [2, 6, 9, 10]] = [9, 1, 3, 8]  # tap 2 is a noise tap, tap 10 lies beyond six taps
    assert run_stage(make_stage("first_path.crest"), make_radar(), make_block(samples)).first_path == [9]


@settings(max_examples=40, deadline=None)
@given(center=st.floats(5.6, 8.4), height=st.floats(1e-6, 1e6))
def test_interpolated_crest_of_a_gaussian_pulse_is_exact(center, height, make_radar, make_block, make_stage, run_stage):
    block = make_block(_gaussian([center], height=height))
    found = run_stage(make_stage("first_path.crest", interpolate=True), make_radar(), block).first_path
    assert found == pytest.approx(center, abs=1e-9)


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10_000), within=st.integers(1, 60), noise_taps=st.integers(0, 9))
def test_interpolation_moves_at_most_half_a_tap(
    seed, within, noise_taps, make_radar, make_block, make_stage, run_stage
):
    samples = np.random.default_rng(seed).integers(0, 4, size=(20, 10)).astype(float)
    radar, block = make_radar(taps=10, noise_taps=noise_taps), make_block(samples)
    whole, fine = (
        run_stage(make_stage("first_path.crest", within_taps=within, interpolate=i), radar, block).first_path
        for i in (False, True)
    )
    assert np.all(np.abs(fine - whole) <= 0.5 + 1e-12)


def test_leading_edge_interpolates_between_the_taps_around_the_crossing(make_radar, make_block, make_stage, run_stage):
    samples = np.zeros((1, 50))
    samples[0, 4:9] = [0.1, 0.2, 0.4, 1.0, 0.8]
    found = run_stage(make_stage("first_path.leading_edge"), make_radar(), make_block(samples)).first_path
    assert found == pytest.approx(6 + 0.1 / 0.6)


def test_leading_edge_takes_the_first_crossing(make_radar, make_block, make_stage, run_stage):
    samples = np.zeros((1, 50))
    samples[0, 4:9] = [0.0, 0.6, 0.1, 1.0, 0.2]
    found = run_stage(make_stage("first_path.leading_edge"), make_radar(), make_block(samples)).first_path
    assert found == pytest.approx(4 + 0.5 / 0.6)


@settings(max_examples=40, deadline=None)
@given(fraction=st.floats(0.05, 0.95), seed=st.integers(0, 10_000), noise_taps=st.integers(0, 4))
def test_the_straight_line_between_taps_has_the_wanted_height_at_the_edge(
    fraction, seed, noise_taps, make_radar, make_block, make_stage, run_stage
):
    amplitude = np.random.default_rng(seed).uniform(0.01, 1, size=(10, 12))
    stage = make_stage("first_path.leading_edge", fraction=fraction)
    radar = make_radar(taps=12, noise_taps=noise_taps)
    found = run_stage(stage, radar, make_block(amplitude)).first_path
    for row, edge in zip(amplitude, found, strict=True):
        threshold = fraction * row[noise_taps : noise_taps + 6].max()
        height = np.interp(edge, np.arange(12), row)
        if edge == noise_taps:  # the window opens above the threshold
            assert height >= threshold * (1 - 1e-12)
        else:
            assert height == pytest.approx(threshold, rel=1e-9)
        assert max(noise_taps - 1, 0) <= edge <= noise_taps + 5


def test_edge_of_a_raised_cosine_pulse_comes_1_15_ns_before_its_crest(make_radar, make_block, make_stage, run_stage):
    time_s = (np.arange(400) - 150) * 0.02e-9
    u = time_s / 2e-9
    pulse = np.sinc(u) * np.cos(np.pi * 0.5 * u) / (1 - u**2 + 1e-300)
    pulse[np.isclose(np.abs(u), 1)] = np.pi / 4 * np.sinc(1)
    radar = make_radar(taps=400, sample_interval_s=0.02e-9)
    crest, edge = (
        run_stage(make_stage(name, within_taps=390), radar, make_block(pulse[None])).first_path[0]
        for name in ("first_path.crest", "first_path.leading_edge")
    )
    assert (crest - edge) * 0.02 == pytest.approx(1.15, abs=0.01)


def test_reported_index_is_passed_on(make_radar, make_block, make_stage, run_stage):
    block = make_block(np.ones((3, 50)), first_path_index=np.array([6.5, 7.25, 6.75]))
    found = run_stage(make_stage("first_path.reported"), make_radar(has_first_path=True), block).first_path
    np.testing.assert_array_equal(found, [6.5, 7.25, 6.75])


def test_a_missing_reported_index_is_noted(make_radar, make_block, make_stage, run_stage):
    stage = make_stage("first_path.reported")
    block = make_block(np.ones((2, 50)), first_path_index=np.array([6.5, np.nan]))
    run_stage(stage, make_radar(has_first_path=True), block)
    assert len(stage.notes) == 1


@pytest.mark.parametrize("name", ["first_path.crest", "first_path.leading_edge", "first_path.reported"])
def test_delays_from_transmission_start_at_a_constant_tap(name, make_radar, make_block, make_stage, run_stage):
    radar = make_radar(noise_taps=0, sample_interval_s=0.5e-9, first_tap_delay_s=20e-9)
    found = run_stage(make_stage(name), radar, make_block(np.ones((3, 50)))).first_path
    np.testing.assert_allclose(found, -40)


@every_config
@pytest.mark.parametrize("samples", [np.zeros((3, 50)), np.ones((3, 50)), np.full((1, 50), np.nan), np.ones((0, 50))])
def test_featureless_frames_give_a_finite_tap(name, params, samples, make_radar, make_block, make_stage, run_stage):
    found = run_stage(make_stage(name, **params), make_radar(), make_block(samples)).first_path
    assert found.shape == (len(samples),)
    assert np.isfinite(found).all()


@every_config
def test_a_radar_without_taps_behind_the_noise_is_refused(name, params, make_radar, make_stage):
    with pytest.raises(ConfigError, match="precede the first arrival"):
        make_stage(name, **params).open(make_radar(taps=4))
