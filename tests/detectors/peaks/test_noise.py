"""Noise level of each frame."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.special import polygamma

from tests.fixtures.chance import SIGMAS
from uwbbench.api import ConfigError
from uwbbench_detectors.peaks.noise import rms

FRAMES = 70
CONFIGS = [
    {"method": "leading"},
    {"method": "running_median", "frames": 7},
    {"method": "running_median", "frames": 100},
    {"method": "tail"},
    {"method": "median"},
    {},
]
every_config = pytest.mark.parametrize("params", CONFIGS)


def _white(frames, taps=50, sigma=1.0, seed=0):
    """Complex noise of RMS ``sigma``."""
    rng = np.random.default_rng(seed)
    return sigma / np.sqrt(2) * (rng.normal(size=(frames, taps)) + 1j * rng.normal(size=(frames, taps)))


@pytest.fixture
def noise_of(make_radar, make_block, make_stage, run_stage):
    def run(samples, radar=None, **params):
        return run_stage(make_stage("noise_floor", **params), radar or make_radar(), make_block(samples)).noise_rms

    return run


@every_config
@settings(max_examples=10, deadline=None)
@given(cuts=st.lists(st.integers(0, FRAMES), max_size=8))
def test_any_cut_into_blocks_gives_the_same_bits(params, cuts, make_radar, make_block, make_echoes, run_cut):
    run_cut("noise_floor", params, make_radar(), make_block(make_echoes(FRAMES)), cuts)


@every_config
def test_one_frame_a_block_gives_the_same_bits(params, make_radar, make_block, make_echoes, run_cut, one_by_one):
    run_cut("noise_floor", params, make_radar(), make_block(make_echoes(FRAMES)), one_by_one(FRAMES))


def test_leading_is_the_rms_of_the_first_taps(noise_of):
    samples = _white(20)
    expected = np.sqrt(np.mean(np.abs(samples[:, :4]) ** 2, axis=1))
    np.testing.assert_allclose(noise_of(samples, method="leading"), expected, rtol=1e-14)
    np.testing.assert_allclose(
        noise_of(samples, method="leading", taps=9), np.sqrt(np.mean(np.abs(samples[:, :9]) ** 2, axis=1)), rtol=1e-14
    )


def test_tail_is_the_rms_of_the_last_taps(noise_of):
    samples = _white(20)
    expected = np.sqrt(np.mean(np.abs(samples[:, -6:]) ** 2, axis=1))
    np.testing.assert_allclose(noise_of(samples, method="tail", taps=6), expected, rtol=1e-14)


def test_four_taps_of_white_noise_spread_by_2_3_db(noise_of):
    level_db = 20 * np.log10(noise_of(_white(20_000), method="leading"))
    spread_db = 10 / np.log(10) * np.sqrt(polygamma(1, 4))  # of the logarithm of a sum of four exponential powers
    assert spread_db == pytest.approx(2.3, abs=0.05)
    fourth = np.mean(((level_db - level_db.mean()) / spread_db) ** 4)
    assert level_db.std() == pytest.approx(spread_db, rel=SIGMAS * np.sqrt((fourth - 1) / (4 * 20_000)))


def test_running_median_is_steadier_than_the_level_it_comes_from(noise_of):
    samples = _white(20_000)  # some 200 windows: 20 % of the steady level's spread are 4 %, and 10 times that is left
    single, steady = (20 * np.log10(noise_of(samples, method=m)) for m in ("leading", "running_median"))
    assert steady[100:].std() < single[100:].std() / 4


@settings(max_examples=25, deadline=None)
@given(window=st.integers(1, 30), frames=st.integers(0, 40))
def test_running_median_looks_at_the_last_frames_and_the_current_one(
    window, frames, make_radar, make_block, make_stage, run_stage
):
    samples = _white(frames)
    single = np.sqrt(np.mean(np.abs(samples[:, :4]) ** 2, axis=1))
    expected = [np.median(single[max(0, k - window + 1) : k + 1]) for k in range(frames)]
    stage = make_stage("noise_floor", method="running_median", frames=window)
    np.testing.assert_allclose(run_stage(stage, make_radar(), make_block(samples)).noise_rms, expected, rtol=1e-14)


def test_invalid_and_empty_frames_leave_no_trace_in_the_running_median(noise_of, make_echoes):
    samples = make_echoes(FRAMES)
    blank = ~np.isfinite(samples).all(axis=1) | ~samples.any(axis=1)
    with_gaps = noise_of(samples, method="running_median", frames=9)
    np.testing.assert_array_equal(with_gaps[~blank], noise_of(samples[~blank], method="running_median", frames=9))
    assert not with_gaps[blank].any()


def test_median_gives_the_rms_of_white_noise(noise_of):
    level = noise_of(_white(4000, taps=50, sigma=3.0), method="median")
    # The median of n Rayleigh magnitudes has the relative standard error 1 / (2 ln 2 sqrt(n)).
    assert level.std() / 3.0 == pytest.approx(1 / (2 * np.log(2) * np.sqrt(50)), rel=0.1)
    assert level.mean() == pytest.approx(3.0, rel=0.02)


def test_median_hardly_notices_echoes_in_a_few_taps(noise_of):
    samples = _white(2000)
    samples[:, 5:10] += 1000
    assert noise_of(samples, method="median").mean() == pytest.approx(1.0, rel=0.15)


def test_auto_is_leading_where_there_are_noise_taps(noise_of):
    np.testing.assert_array_equal(noise_of(_white(5)), noise_of(_white(5), method="leading"))


def test_auto_is_median_where_there_are_none_and_says_so(make_radar, make_block, make_stage, run_stage, noise_of):
    radar, stage = make_radar(noise_taps=0), make_stage("noise_floor")
    found = run_stage(stage, radar, make_block(_white(5))).noise_rms
    np.testing.assert_array_equal(found, noise_of(_white(5), radar, method="median"))
    assert stage.notes == ["noise_floor: no taps before the first arrival, used the median magnitude of all taps"]


@pytest.mark.parametrize("method", ["leading", "running_median", "tail"])
def test_a_window_without_taps_is_refused(method, make_radar, make_stage):
    with pytest.raises(ConfigError, match="needs 'taps'"):
        make_stage("noise_floor", method=method).open(make_radar(noise_taps=0))


def test_a_window_longer_than_the_frame_is_refused(make_radar, make_stage):
    with pytest.raises(ConfigError, match="only 50 taps"):
        make_stage("noise_floor", method="tail", taps=51).open(make_radar())


def test_taps_without_effect_are_refused(make_stage):
    with pytest.raises(ValidationError, match="no meaning"):
        make_stage("noise_floor", method="median", taps=4)


@every_config
@pytest.mark.parametrize("scale", [1e-150, 1e-23, 1e150])
def test_extreme_amplitudes_scale_the_level(params, scale, noise_of):
    samples = _white(10)
    np.testing.assert_allclose(noise_of(samples * scale, **params), noise_of(samples, **params) * scale, rtol=1e-9)


@pytest.mark.parametrize("scale", [1e-200, 1.0, 1e200])
def test_rms_neither_vanishes_nor_overflows_where_squares_do(scale):
    np.testing.assert_allclose(rms(scale * np.array([[3.0, 4.0], [0.0, 0.0]])), [scale * np.sqrt(12.5), 0], rtol=1e-14)


def test_single_precision_samples_near_1e_23_have_a_level(noise_of):
    samples = (1e-23 * _white(10)).astype(np.complex64)
    assert np.all(noise_of(samples, method="leading") > 1e-24)


@every_config
@pytest.mark.parametrize("samples", [np.zeros((3, 50)), np.ones((3, 50)), np.full((1, 50), np.nan), np.ones((0, 50))])
def test_featureless_frames_give_a_finite_level(params, samples, noise_of):
    level = noise_of(samples, **params)
    assert level.shape == (len(samples),)
    assert np.isfinite(level).all()


def _leaking(frames, share):
    """White noise whose first taps are a thousand times stronger in this share of the frames."""
    samples = _white(frames, taps=200)
    samples[: int(share * frames), :4] *= 1000
    return samples


@pytest.mark.parametrize(
    ("frames", "share", "noted"), [(50, 0.9, True), (50, 0.2, False), (10, 0.9, True), (1, 1, True)]
)
def test_leading_taps_that_hold_more_than_noise_are_noted(
    frames, share, noted, make_radar, make_block, make_stage, run_stage
):
    stage = make_stage("noise_floor", method="leading")
    run_stage(stage, make_radar(taps=200), make_block(_leaking(frames, share)))
    assert [("hold more than noise" in note) for note in stage.notes] == [True] * noted


@pytest.mark.parametrize("cuts", [[], [20, 40, 60], [50]])
def test_the_verdict_on_the_leading_taps_does_not_change_after_fifty_frames(
    cuts, make_radar, make_block, make_stage, run_stage
):
    samples = np.concatenate([_white(50, taps=200), _leaking(500, 1)])
    stage = make_stage("noise_floor", method="leading")
    run_stage(stage, make_radar(taps=200), make_block(samples), cuts)
    assert stage.notes == []


@pytest.mark.parametrize("cuts", [[], [20, 40, 60], [50]])
def test_the_verdict_comes_however_the_first_fifty_frames_are_cut(cuts, make_radar, make_block, make_stage, run_stage):
    stage = make_stage("noise_floor", method="leading")
    run_stage(stage, make_radar(taps=200), make_block(_leaking(100, 0.9)), cuts)
    assert len(stage.notes) == 1


def test_no_verdict_without_frames(make_radar, make_block, make_stage, run_stage):
    stage = make_stage("noise_floor")
    run_stage(stage, make_radar(), make_block(np.full((3, 50), np.nan)))
    assert stage.notes == []
