"""Difference from a background: which bin, which threshold, and how many windows make the background."""

import numpy as np
import pytest
from scipy import stats

from uwbbench.api import Bins, ConfigError, WindowProfile
from uwbbench_detectors.still.difference import Background, variance_ratio

BINS = Bins(-4, 8, 320)
FRAMES = 40
LENGTH = 20
CREST = 0.3
"""Direct crest of the background, in taps behind the first path."""


def bump(tap, height=1.0):
    return height * np.exp(-((BINS.place - tap) ** 2) / 3)


def profile(value, count=240, stop=None, refused=()):
    """Windows of 20 frames with these values (windows, bins)."""
    value = np.atleast_2d(value)
    windows = len(value)
    stop = LENGTH * np.arange(1, windows + 1) if stop is None else np.asarray(stop)
    return WindowProfile(
        BINS, np.repeat(np.arange(windows), LENGTH), stop, value, np.full(value.shape, count, np.int64), refused
    )


@pytest.fixture
def found(make_stage, make_radar, make_block):
    """What a difference finds in windows of given means and deviations: its detections."""

    def run(name, mean, sd=None, background_sd=None, counts=(240, 240), first_path=7.25, **params):
        def block_of(mean, sd, count):
            frames = LENGTH * len(np.atleast_2d(mean))
            return make_block(
                np.ones((frames, 50)),
                first_path=np.full(frames, first_path),
                window_mean=profile(mean, count),
                window_sd=None if sd is None else profile(sd, count),
            )

        stage = make_stage(name, **params)
        stage.open(make_radar())
        stage.show_background(iter([block_of(bump(CREST), background_sd, counts[1])]))
        return stage.step(block_of(mean, sd, counts[0])).detections

    return run


def test_every_frame_of_a_window_gets_the_largest_difference_counted_from_the_direct_crest(found):
    mean = np.stack([bump(CREST) + bump(12.0, 0.1) + bump(20.0, 0.05), bump(CREST) + bump(15.03, 0.2)])
    answer = found("detect.bma", mean)
    assert answer.frame.tolist() == list(range(FRAMES))
    np.testing.assert_allclose(answer["tap"][:LENGTH] - 7.25, 12.0 - CREST, atol=2e-3)
    np.testing.assert_allclose(answer["tap"][LENGTH:] - 7.25, 15.03 - CREST, atol=2e-3)
    np.testing.assert_allclose(answer["amplitude"][:LENGTH], 0.1, atol=1e-3)


def test_without_interpolation_crests_are_whole_bins(found):
    answer = found("detect.bma", bump(CREST) + bump(12.03, 0.1), interpolate=False)
    assert (answer["tap"] - 7.25).tolist() == [12.0 - 0.25] * LENGTH


def test_nothing_is_found_within_the_guard_behind_the_direct_crest(found):
    mean = bump(CREST) + np.where(BINS.place < CREST + 2.5, 0.3, 0.0) + bump(12.0, 0.1)
    np.testing.assert_allclose(found("detect.bma", mean)["tap"] - 7.25, 12.0 - CREST, atol=2e-3)


def test_a_window_equal_to_the_background_gives_nothing(found):
    assert not len(found("detect.bma", bump(CREST)))
    sd = np.full(BINS.count, 0.01)
    assert not len(found("detect.bsda", bump(CREST), sd, sd))


def test_the_threshold_of_means_is_made_of_the_differences_below_zero(found):
    ripple = 0.01 * np.sign(np.sin(np.arange(BINS.count)))
    mean = bump(CREST) + ripple
    peak = np.argmin(np.abs(BINS.place - 15))
    below, above = mean.copy(), mean.copy()
    below[peak], above[peak] = bump(CREST)[peak] + 0.0299, bump(CREST)[peak] + 0.0301
    assert not len(found("detect.bma", below))
    assert len(found("detect.bma", above)) == LENGTH
    assert len(found("detect.bma", below, sigmas=2.0)) == LENGTH
    assert len(found("detect.bma", mean, sigmas=None)) == LENGTH


@pytest.mark.parametrize("counts", [(240, 240), (30, 120)])
def test_the_threshold_of_deviations_is_that_of_the_f_distribution(found, counts):
    background_sd = np.full(BINS.count, 0.02)
    ratio = np.sqrt(stats.f.isf(1e-3, counts[0] - 1, counts[1] - 1))
    for factor, there in ((0.999, 0), (1.001, LENGTH)):
        sd = np.where(np.abs(BINS.place - 15) < 0.5, 0.02 * ratio * factor, 0.02)
        assert len(found("detect.bsda", bump(CREST), sd, background_sd, counts)) == there


@pytest.mark.parametrize("rate", [0.1, 1e-3, 1e-9])
@pytest.mark.parametrize("counts", [(240, 240), (3, 17)])
def test_ratio_of_variances_is_the_quantile_of_scipy(rate, counts):
    expected = stats.f.isf(rate, counts[0] - 1, counts[1] - 1)
    assert variance_ratio(rate, *counts) == pytest.approx(expected, rel=1e-8)


def test_bins_of_which_no_deviation_is_known_are_passed_over(found):
    sd = np.full(BINS.count, 0.01)
    sd[100:120] = np.nan
    louder = sd + bump(15.0, 0.1)
    np.testing.assert_allclose(found("detect.bsda", bump(CREST), louder, sd)["tap"] - 7.25, 15 - CREST, atol=2e-3)


def test_first_takes_the_crest_of_the_nearest_run_that_is_long_enough(found):
    spike = np.where(np.arange(BINS.count) == 80, 0.5, 0.0)
    mean = bump(CREST) + spike + bump(12.0, 0.1) + bump(20.0, 0.3) - 0.005  # a threshold of 0.015
    taps = {
        peak: found("detect.bma", mean, peak=peak, **params)["tap"][0] - 7.25 + CREST
        for peak, params in (("max", {}), ("first", {"run_taps": 2.0, "pulse_taps": 4.0}))
    }
    assert taps["max"] == pytest.approx(BINS.place[80], abs=0.1)
    assert taps["first"] == pytest.approx(12.0, abs=0.05)


def test_what_only_runs_need_is_refused_where_no_runs_are_looked_at(make_stage):
    with pytest.raises(ValueError, match="'run_taps' has no meaning with peak 'max'"):
        make_stage("detect.bma", run_taps=2.0)


def test_windows_of_a_background_are_merged_as_if_their_frames_were_one(make_block):
    rng = np.random.default_rng(3)
    values = rng.normal(1.0, 0.2, (60, BINS.count))
    parts = np.split(values, [20, 50])
    mean, sd = ([getattr(part, name)(axis=0, **more) for part in parts] for name, more in MOMENTS)
    count = np.array([[20], [30], [10]]) * np.ones((1, BINS.count), np.int64)
    row = np.repeat(np.arange(3), 20)
    blocks = make_block(
        np.ones((60, 50)),
        window_mean=WindowProfile(BINS, row, np.array([20, 40, 60]), np.stack(mean), count),
        window_sd=WindowProfile(BINS, row, np.array([20, 40, 60]), np.stack(sd), count),
    )
    whole = Background.of([blocks], "test")
    np.testing.assert_allclose(whole.mean, values.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(whole.sd, values.std(axis=0, ddof=1), rtol=1e-12)
    assert (whole.count == 60).all()
    cut = Background.of([blocks.cut(0, 13), blocks.cut(13, 41), blocks.cut(41, 60)], "test")
    np.testing.assert_array_equal(cut.sd, whole.sd)
    assert (cut.count == 60).all()


MOMENTS = (("mean", {}), ("std", {"ddof": 1}))


def test_a_background_without_a_window_is_refused_with_its_reason(make_stage, make_radar, make_block):
    empty = profile(np.empty((0, BINS.count)), refused=("no answer for a window whose bins are not filled",))
    stage = make_stage("detect.bma")
    stage.open(make_radar())
    with pytest.raises(ConfigError, match=r"detect\.bma: the background gives no window .*bins are not filled"):
        stage.show_background([make_block(np.ones((0, 50)), window_mean=empty)])


def test_a_first_path_that_is_not_known_leaves_its_frame_without_a_place(found, make_block):
    assert np.isnan(found("detect.bma", bump(CREST) + bump(12.0, 0.1), first_path=np.nan)["tap"]).all()
