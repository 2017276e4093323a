"""Alignment of frames on their direct path."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api import ConfigError
from uwbbench_detectors.first_path.estimators import log_parabola

FRAMES = 30
TAP = np.arange(50)


def _pulse(center):
    """Band-limited enough that a fractional shift is exact to 1e-6."""
    return np.exp(-((TAP - np.asarray(center, dtype=float)[..., None]) ** 2) / 4)


def _scene(center):
    """Direct path and an echo 17.3 taps behind it."""
    center = np.asarray(center, dtype=float)
    return _pulse(center) + 0.2j * _pulse(center + 17.3)


@settings(max_examples=10, deadline=None)
@given(cuts=st.lists(st.integers(0, FRAMES), max_size=8))
def test_any_cut_into_blocks_gives_the_same_bits(cuts, make_radar, make_block, make_echoes, run_cut):
    run_cut("align", {}, make_radar(), make_block(make_echoes(FRAMES)), cuts)


@pytest.mark.parametrize("frames", [FRAMES, 800])  # numpy computes large arrays in other ways than small ones
def test_one_frame_a_block_gives_the_same_bits(frames, make_radar, make_block, make_echoes, run_cut, one_by_one):
    run_cut("align", {}, make_radar(), make_block(make_echoes(frames)), one_by_one(frames))


@settings(max_examples=40, deadline=None)
@given(center=st.floats(6.2, 7.7), phase=st.floats(-3.1, 3.1), gain=st.floats(1e-12, 1e12))
def test_delay_phase_and_gain_of_the_direct_path_vanish(
    center, phase, gain, make_radar, make_block, make_stage, run_stage
):
    block = make_block(gain * np.exp(1j * phase) * _scene([center]))
    aligned = run_stage(make_stage("align"), make_radar(), block).frames.preamble
    np.testing.assert_allclose(aligned[0], _scene(7.0), atol=2e-3)
    np.testing.assert_allclose(aligned[0, 7], 1, atol=1e-12)


def test_static_frames_with_random_phase_become_coherent(make_radar, make_block, make_stage, run_stage):
    rng = np.random.default_rng(0)
    turned = np.exp(2j * np.pi * rng.uniform(size=(100, 1))) * _scene(rng.uniform(6.5, 7.5, 100))
    aligned = run_stage(make_stage("align"), make_radar(), make_block(turned)).frames.preamble
    assert np.abs(turned.mean(axis=0)).max() < 0.5  # a mean of 100 phases exceeds it in exp(-25) of the draws
    assert np.abs(aligned - aligned.mean(axis=0)).max() < 2e-3


def test_the_crest_goes_to_a_fractional_tap_too(make_radar, make_block, make_stage, run_stage):
    block = make_block(_scene([7.0]))
    aligned = run_stage(make_stage("align", to_tap=9.25), make_radar(), block).frames.preamble
    np.testing.assert_allclose(aligned[0], _scene(9.25), atol=2e-3)


def test_a_reported_first_path_moves_along(make_radar, make_block, make_stage, run_stage):
    block = make_block(_scene([6.6]), first_path_index=np.array([5.1]))
    moved = run_stage(make_stage("align"), make_radar(), block).frames.first_path_index
    assert moved == pytest.approx(5.5, abs=1e-3)


def test_sts_responses_stay_as_they_are(make_radar, make_block, make_stage, run_stage):
    sts = np.random.default_rng(0).normal(size=(1, 50)).astype(complex)
    block = make_block(_scene([6.6]), sts1=sts, sts2=2 * sts)
    frames = run_stage(make_stage("align"), make_radar(has_sts=True), block).frames
    np.testing.assert_array_equal(frames.sts1, sts)
    np.testing.assert_array_equal(frames.sts2, 2 * sts)


@pytest.mark.parametrize("noise_taps", [0, 4])
def test_frames_with_a_weak_direct_path_are_refused_with_a_note(
    noise_taps, make_radar, make_block, make_stage, run_stage
):
    rng = np.random.default_rng(0)
    noise = np.exp(2j * np.pi * rng.uniform(size=(2, 50)))
    samples = noise + np.array([[1000.0], [3.0]]) * _pulse([7, 7])
    stage = make_stage("align")
    aligned = run_stage(stage, make_radar(noise_taps=noise_taps), make_block(samples)).frames
    assert aligned.amplitude[0].max() == pytest.approx(1, abs=0.05)
    assert not aligned.preamble[1].any()
    assert len(stage.notes) == 1


def test_invalid_frames_cause_no_note_and_stay_zero(make_radar, make_block, make_stage, run_stage):
    stage = make_stage("align")
    samples = np.concatenate([_scene([7.0]), np.full((1, 50), np.nan)])
    aligned = run_stage(stage, make_radar(), make_block(samples)).frames.preamble
    assert not aligned[1].any()
    assert stage.notes == []


@pytest.mark.parametrize("samples", [np.zeros((3, 50)), np.ones((3, 50)), np.ones((0, 50)), np.full((1, 50), np.nan)])
def test_featureless_frames_stay_finite(samples, make_radar, make_block, make_stage, run_stage):
    aligned = run_stage(make_stage("align"), make_radar(), make_block(samples)).frames.preamble
    assert aligned.shape == samples.shape
    assert np.isfinite(aligned).all()


@pytest.mark.parametrize("scale", [5e-324, 1e-310])
def test_frames_too_small_to_divide_by_are_refused(scale, make_radar, make_block, make_stage, make_echoes, run_stage):
    stage = make_stage("align")
    aligned = run_stage(stage, make_radar(), make_block(make_echoes(4) * scale)).frames.preamble
    assert not aligned.any()
    assert len(stage.notes) == 1


def test_radars_counting_from_transmission_pass_unchanged_with_a_note(
    make_radar, make_block, make_stage, make_echoes, run_stage
):
    stage, block = make_stage("align"), make_block(make_echoes(5))
    out = run_stage(stage, make_radar(noise_taps=0, first_tap_delay_s=1e-8), block)
    np.testing.assert_array_equal(out.frames.preamble, block.frames.preamble)
    assert len(stage.notes) == 1
    assert stage.notes[0].startswith("align left out")


def test_a_target_outside_the_frame_is_refused(make_radar, make_stage):
    with pytest.raises(ConfigError, match="last tap of a frame is 49"):
        make_stage("align", to_tap=50).open(make_radar())


def test_a_search_window_inside_the_noise_taps_is_refused(make_radar, make_stage):
    with pytest.raises(ConfigError, match="precede any arrival"):
        make_stage("align", crest_within_taps=4).open(make_radar())


@pytest.mark.parametrize("taps", [31, 50, 64])
@pytest.mark.parametrize("to_tap", [7.0, 9.3])
def test_aligned_frames_are_those_of_the_formula_in_numpy(
    taps, to_tap, make_radar, make_block, make_stage, make_echoes, run_stage
):
    samples = make_echoes(20, taps) * np.exp(2j * np.arange(20)[:, None])
    frequency = np.fft.fftfreq(taps)
    grid = np.arange(4 * 16, 8 * 16) / 16
    spectra = np.fft.fft(samples, axis=1)
    fine = np.abs(spectra @ np.exp(2j * np.pi * np.outer(frequency, grid)) / taps)
    peak = np.argmax(fine, axis=1)
    crest_tap = grid[peak] + log_parabola(fine, peak) / 16
    crest = np.mean(spectra * np.exp(2j * np.pi * frequency * crest_tap[:, None]), axis=1)
    moved = np.exp(2j * np.pi * frequency * (crest_tap - to_tap)[:, None])
    expected = np.fft.ifft(spectra * moved, axis=1) / crest[:, None]
    stage = make_stage("align", to_tap=to_tap, minimum_snr_db=-100.0)
    aligned = run_stage(stage, make_radar(taps), make_block(samples)).frames.preamble
    np.testing.assert_allclose(aligned, expected, rtol=0, atol=1e-13)
