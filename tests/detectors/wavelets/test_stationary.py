"""Stationary wavelet transform, and the features of taps that it makes."""

from pathlib import Path

import numpy as np
import pytest

from uwbbench.api import ConfigError
from uwbbench_detectors.wavelets.stationary import filters_of
from uwbbench_detectors.wavelets.stationary_loops import transform

WAVELETS = ("haar", "db2", "db4")
LEVELS = 3
GOLDEN = np.load(Path(__file__).parent / "pywt.npz")
"""``signal`` (48,), and of each wavelet what pywt 1.9.0 makes of it: ``pywt.swt(..., level=3, trim_approx=True)``."""


def bands_of(signal, wavelet):
    bands = np.empty((len(signal), 1 + LEVELS))
    transform(signal, *filters_of(wavelet), bands)
    return bands


@pytest.mark.parametrize("wavelet", WAVELETS)
def test_bands_are_those_that_pywavelets_gave(wavelet):
    np.testing.assert_allclose(bands_of(GOLDEN["signal"], wavelet), GOLDEN[wavelet], rtol=0, atol=1e-12)


@pytest.mark.parametrize("wavelet", WAVELETS)
def test_bands_are_those_of_pywavelets(wavelet):
    pywt = pytest.importorskip("pywt")
    signal = np.random.default_rng(2).normal(size=64)
    expected = np.stack(pywt.swt(signal, wavelet, level=LEVELS, trim_approx=True), axis=1)
    np.testing.assert_allclose(bands_of(signal, wavelet), expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("wavelet", WAVELETS)
def test_filters_are_orthogonal(wavelet):
    low, high = filters_of(wavelet)
    assert [low @ low, high @ high, low @ high, high.sum()] == pytest.approx([1, 1, 0, 0], abs=1e-12)
    assert low.sum() == pytest.approx(np.sqrt(2))


def features_of(samples, make_stage, make_radar, make_block, run_stage, **params):
    samples = np.asarray(samples, complex)
    stage = make_stage("wavelet.stationary", **params)
    return run_stage(stage, make_radar(samples.shape[1]), make_block(samples)).features


def test_features_are_the_logarithm_and_its_bands_on_the_frames_own_taps(
    make_stage, make_radar, make_block, run_stage, make_echoes
):
    samples = make_echoes(3)
    features = features_of(samples, make_stage, make_radar, make_block, run_stage)
    signal = np.log10(np.abs(samples) + 1e-4)
    padded = np.pad(signal, ((0, 0), (3, 3)), "edge")  # 50 taps become 56, a multiple of 8
    assert features.shape == (3, 50, 5)
    np.testing.assert_allclose(features[..., 0], signal, atol=1e-14)
    np.testing.assert_allclose(features[1, :, 1:], bands_of(padded[1], "db4")[3:-3], atol=1e-12)


def test_an_echo_that_moves_by_a_tap_moves_its_bands_by_a_tap(make_stage, make_radar, make_block, run_stage):
    frames = np.full((2, 64), 0.01, complex)
    frames[0, 30], frames[1, 31] = 1, 1
    features = features_of(frames, make_stage, make_radar, make_block, run_stage)
    np.testing.assert_allclose(features[1, 1:], features[0, :-1], atol=1e-12)


def test_any_cut_of_the_frames_gives_the_same_features(run_cut, make_radar, make_block, make_echoes, one_by_one):
    run_cut("wavelet.stationary", {"levels": 2}, make_radar(), make_block(make_echoes(30)), one_by_one(30))


def test_more_levels_than_a_frame_has_room_for_are_refused(make_stage, make_radar):
    with pytest.raises(ConfigError, match="64 taps, but a frame has 50"):
        make_stage("wavelet.stationary", levels=6).open(make_radar())
