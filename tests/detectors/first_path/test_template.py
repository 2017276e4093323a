"""Alignment of frames to a running template of their direct path."""

import numpy as np
import pytest

from uwbbench.api import ConfigError

TAP = np.arange(50)
FRAMES = 40


def _pulse(center):
    return np.exp(-((TAP - np.asarray(center, dtype=float)[..., None]) ** 2) / 4)


def _scene(center):
    """Direct path, ringing and an echo 17.3 taps behind it."""
    center = np.asarray(center, dtype=float)
    return _pulse(center) + 0.3j * _pulse(center + 2.1) + 0.2j * _pulse(center + 17.3)


def _drive(frames):
    return {"position_m": np.arange(frames)[:, None] * np.array([0.006, 0, 0])}


def test_any_cut_into_blocks_gives_the_same_bits(make_radar, make_block, make_echoes, run_cut, one_by_one):
    block = make_block(make_echoes(FRAMES), **_drive(FRAMES))
    run_cut("align.template", {}, make_radar(), block, one_by_one(FRAMES))


@pytest.mark.parametrize("scale", [1e-20, 1.0, 1e20])
def test_delay_phase_and_gain_vanish_at_any_scale(scale, make_radar, make_block, make_stage, run_stage):
    rng = np.random.default_rng(0)
    turned = scale * np.exp(2j * np.pi * rng.uniform(size=(FRAMES, 1))) * _scene(rng.uniform(6.0, 8.0, FRAMES))
    block = make_block(turned, **_drive(FRAMES))
    aligned = run_stage(make_stage("align.template"), make_radar(), block)
    frames = aligned.frames.preamble
    assert np.abs(frames - frames[0]).max() < 3e-3
    assert abs(frames[0, 7]) == pytest.approx(1, abs=1e-3)
    np.testing.assert_array_equal(aligned.first_path, 7.0)


def test_each_response_goes_to_its_own_direct_path(make_radar, make_block, make_stage, run_stage):
    rng = np.random.default_rng(1)
    places = rng.uniform(6.0, 8.0, (3, FRAMES))
    preamble, sts1, sts2 = (np.exp(1j * k) * _scene(places[k]) for k in range(3))
    block = make_block(preamble, sts1=sts1, sts2=sts2, **_drive(FRAMES))
    frames = run_stage(make_stage("align.template"), make_radar(has_sts=True), block).frames
    for samples in (frames.sts1, frames.sts2):
        assert np.abs(samples[-1] - frames.preamble[-1]).max() < 5e-3


def test_the_noise_of_the_shift_is_near_the_bound(make_radar, make_block, make_stage, run_stage):
    """Aligned to the template, the echo's place scatters by little more than the best unbiased estimator's shift."""
    rng = np.random.default_rng(2)
    frames, level = 600, 0.01
    samples = _pulse(rng.uniform(6.5, 7.5, frames)) + 0j
    samples += level * (rng.normal(size=samples.shape) + 1j * rng.normal(size=samples.shape)) / np.sqrt(2)
    block = make_block(samples, **_drive(frames))
    aligned = run_stage(make_stage("align.template"), make_radar(), block).frames.preamble[300:]
    slope = (-(TAP - 7) / 2 * _pulse(7.0))[2:9]
    shift = np.real(aligned[:, 2:9] @ slope) / np.sum(slope**2)
    # The seven taps that were fitted, by themselves, show what the fit has left of the shift: nearly nothing.
    assert np.std(shift) < 0.5 * level / np.sqrt(2 * np.sum(slope**2))


@pytest.mark.parametrize("noise_taps", [0, 4])
def test_a_weak_direct_path_is_refused_with_a_note(noise_taps, make_radar, make_block, make_stage, run_stage):
    rng = np.random.default_rng(0)
    samples = np.exp(2j * np.pi * rng.uniform(size=(2, 50))) + np.array([[1000.0], [3.0]]) * _pulse([7, 7])
    stage = make_stage("align.template")
    frames = run_stage(stage, make_radar(noise_taps=noise_taps), make_block(samples)).frames
    assert frames.preamble[0].any()
    assert not frames.preamble[1].any()
    assert len(stage.notes) == 1


@pytest.mark.parametrize("samples", [np.zeros((3, 50)), np.ones((3, 50)), np.ones((0, 50)), np.full((2, 50), np.nan)])
def test_featureless_frames_stay_finite(samples, make_radar, make_block, make_stage, run_stage):
    aligned = run_stage(make_stage("align.template"), make_radar(), make_block(samples)).frames.preamble
    assert aligned.shape == samples.shape
    assert np.isfinite(aligned).all()


def test_radars_that_count_from_transmission_pass_unchanged(make_radar, make_block, make_stage, make_echoes, run_stage):
    stage, block = make_stage("align.template"), make_block(make_echoes(5))
    out = run_stage(stage, make_radar(noise_taps=0, first_tap_delay_s=1e-8), block)
    np.testing.assert_array_equal(out.frames.preamble, block.frames.preamble)
    assert out.first_path == pytest.approx(-10)
    assert len(stage.notes) == 1


@pytest.mark.parametrize("params", [{"to_tap": 47}, {"to_tap": 20}])
def test_a_target_out_of_reach_is_refused(params, make_radar, make_stage):
    with pytest.raises(ConfigError, match=r"align\.template"):
        make_stage("align.template", **params).open(make_radar())
