"""The curve that detectors search."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api import ConfigError

FRAMES = 30
CONFIGS = [
    ("profile.minmax", {}),
    ("profile.minmax", {"scope": "frame_all_taps"}),
    ("profile.minmax", {"scope": "recording"}),
    ("profile.amplitude", {}),
]
every_config = pytest.mark.parametrize(("name", "params"), CONFIGS)
every_minmax = pytest.mark.parametrize("scope", ["frame", "frame_all_taps", "recording"])


@pytest.fixture(scope="session")
def profile_of(make_radar, make_block, make_stage, run_stage):
    def run(samples, name="profile.minmax", taps=50, **params):
        return run_stage(make_stage(name, **params), make_radar(taps=taps), make_block(samples)).profile

    return run


@every_config
@settings(max_examples=10, deadline=None)
@given(cuts=st.lists(st.integers(0, FRAMES), max_size=8))
def test_any_cut_into_blocks_gives_the_same_bits(name, params, cuts, make_radar, make_block, make_echoes, run_cut):
    block = make_block(make_echoes(FRAMES), first=7, first_path=np.arange(30.0), noise_rms=np.ones(30))
    result = run_cut(name, params, make_radar(), block, cuts)
    np.testing.assert_array_equal(result.first_path, block.first_path)
    assert result.profile.shape == (FRAMES, 46)
    assert result.profile_start == 4


def test_each_frame_is_scaled_by_the_taps_kept(profile_of):
    amplitude = np.random.default_rng(0).uniform(1, 2, (20, 50))
    amplitude[:, 0] = 100
    kept = amplitude[:, 4:]
    low, high = kept.min(axis=1, keepdims=True), kept.max(axis=1, keepdims=True)
    np.testing.assert_allclose(profile_of(amplitude), (kept - low) / (high - low), rtol=1e-12, atol=1e-15)


def test_all_taps_can_set_the_scale(profile_of):
    amplitude = np.random.default_rng(0).uniform(1, 2, (20, 50))
    low, high = amplitude.min(axis=1, keepdims=True), amplitude.max(axis=1, keepdims=True)
    expected = (amplitude - low) / (high - low)
    np.testing.assert_allclose(profile_of(amplitude, scope="frame_all_taps"), expected[:, 4:], rtol=1e-12, atol=1e-15)


def test_the_whole_recording_can_set_the_scale(profile_of):
    kept = np.random.default_rng(0).uniform(1, 2, (20, 50))[:, 4:]
    amplitude = np.concatenate([np.full((20, 4), 9.0), kept], axis=1)
    expected = (kept - kept.min()) / (kept.max() - kept.min())
    np.testing.assert_allclose(profile_of(amplitude, scope="recording"), expected, rtol=1e-12, atol=1e-15)


def test_invalid_frames_do_not_set_the_scale_of_a_recording(profile_of):
    amplitude = np.random.default_rng(0).uniform(1, 2, (20, 50))
    spoiled = np.insert(amplitude, 3, np.inf, axis=0)
    profile = profile_of(spoiled, scope="recording")
    np.testing.assert_array_equal(np.delete(profile, 3, axis=0), profile_of(amplitude, scope="recording"))
    assert not profile[3].any()


def test_a_recording_is_held_back_until_its_end(make_radar, make_block, make_stage, make_echoes):
    stage = make_stage("profile.minmax", scope="recording")
    stage.open(make_radar())
    assert len(stage.step(make_block(make_echoes(5))).frames) == 0
    assert len(stage.flush().frames) == 5


@every_minmax
@settings(max_examples=30, deadline=None)
@given(exponent=st.integers(-150, 149), seed=st.integers(0, 1000))
def test_profiles_span_zero_to_one_whatever_the_amplitude(scope, exponent, seed, profile_of):
    amplitude = np.random.default_rng(seed).uniform(1, 9, (6, 50)) * 10.0**exponent
    profile = profile_of(amplitude, scope=scope)
    assert profile.min() >= 0
    assert profile.max() <= 1
    if scope == "frame":
        np.testing.assert_array_equal(profile.min(axis=1), 0)
        np.testing.assert_array_equal(profile.max(axis=1), 1)


@every_minmax
@pytest.mark.parametrize("level", [0.0, 1.0, 1e-150, 1e150])
def test_constant_frames_become_zero(scope, level, profile_of):
    assert not profile_of(np.full((4, 50), level), scope=scope).any()


@every_minmax
def test_a_ripple_in_the_last_place_is_no_peak(scope, profile_of):
    amplitude = np.ones((4, 50))
    amplitude[:, 20] = np.nextafter(1, 2)
    assert not profile_of(amplitude, scope=scope).any()


def test_amplitude_profile_is_the_magnitude_of_the_taps_kept(profile_of):
    samples = np.random.default_rng(0).normal(size=(5, 50)) * (3 + 4j)
    np.testing.assert_allclose(profile_of(samples, name="profile.amplitude"), np.abs(samples[:, 4:]), rtol=1e-14)
    assert profile_of(samples, name="profile.amplitude", skip_taps=0).shape == (5, 50)


@every_config
@pytest.mark.parametrize("frames", [0, 1])
def test_captures_of_no_frame_and_of_one_pass(name, params, frames, profile_of, make_echoes):
    assert profile_of(make_echoes(1)[:frames], name=name, **params).shape == (frames, 46)


@every_config
def test_skipping_every_tap_is_refused(name, params, make_radar, make_stage):
    with pytest.raises(ConfigError, match="leaves nothing to search"):
        make_stage(name, skip_taps=50, **params).open(make_radar())
