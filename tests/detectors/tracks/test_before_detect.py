"""Tracks before detection: what noise alone may gather, and what a path is."""

import numpy as np
import pytest

from uwbbench_detectors.tracks.noise_paths import moment, neutral_db, threshold_db

TAPS, FRAMES = 60, 150
CLIPS = (-3.0, 18.0)


def scene(rng, echoes=(), frames=FRAMES):
    """Noise of unit power, and echoes of an amplitude at a place (frames,) in taps."""
    samples = (rng.normal(size=(frames, TAPS)) + 1j * rng.normal(size=(frames, TAPS))) / np.sqrt(2)
    for amplitude, place in echoes:
        rows = np.flatnonzero(np.broadcast_to(amplitude, frames) > 0)
        samples[rows, np.rint(np.broadcast_to(place, frames)[rows]).astype(int)] += np.broadcast_to(amplitude, frames)[
            rows
        ] * np.exp(2j * np.pi * rng.uniform(size=len(rows)))
    return samples


@pytest.fixture
def detect(make_radar, make_block, make_stage, run_stage):
    def run(samples, noise=1.0, **params):
        frames = len(samples)
        times_s = params.pop("timestamp_s", np.arange(frames) / 48.0)
        level = np.full(frames, noise) if np.ndim(noise) == 0 else noise
        block = make_block(samples, noise_rms=level, first_path=np.zeros(frames), timestamp_s=times_s)
        return run_stage(make_stage("track.before_detect", **params), make_radar(TAPS), block).detections

    return run


def test_moments_are_those_of_clipped_logarithms_of_an_exponential_power():
    power = (np.arange(1_000_000) + 0.5) / 1_000_000
    evidence = np.clip(10 * np.log10(-np.log1p(-power)) - 6.0, *CLIPS)
    at = np.array([0, 7, 15])
    s = 0.25 * (at + 1)
    wanted = np.exp(s[:, None] * evidence * np.log(10) / 10).mean(axis=1)
    np.testing.assert_allclose(moment(6.0, *CLIPS)[at], wanted, rtol=2e-3)


def test_noise_alone_keeps_the_rate_that_the_threshold_is_made_for():
    cells, rate = 5, 0.05
    neutral = neutral_db(cells, *CLIPS)
    threshold = threshold_db(cells, TAPS, rate, neutral, CLIPS)
    rng, gathered, alarms = np.random.default_rng(2), np.zeros(TAPS), 0
    for _ in range(4000):
        evidence = np.clip(10 * np.log10(rng.exponential(size=TAPS)) - neutral, *CLIPS)
        near = np.lib.stride_tricks.sliding_window_view(np.pad(gathered, cells // 2), cells).max(axis=1)
        gathered = np.maximum(near + evidence, 0)
        alarms += gathered.max() > threshold
    assert 0 < alarms < rate * 4000


def test_noise_alone_and_a_burst_of_one_frame_are_no_detections(detect):
    samples = scene(np.random.default_rng(3))
    samples[70, 33] = 1e6
    assert len(detect(samples)) == 0


def test_a_body_is_followed_through_frames_in_which_it_fades(detect):
    rng = np.random.default_rng(4)
    place = 20 + 0.1 * np.arange(FRAMES)
    amplitude = np.where(rng.uniform(size=FRAMES) < 0.4, 0.0, 5.0)
    found = detect(scene(rng, [(amplitude, place)]))
    assert np.mean(np.abs(found["tap"] - place[found.frame]) < 1) > 0.95
    assert len(found) > 0.8 * np.count_nonzero(amplitude[40:])
    assert found.frame.min() < 40


def test_a_body_goes_on_while_frames_are_lost_and_no_faster_than_it_may(detect):
    rng = np.random.default_rng(5)
    place = 10 + 0.1 * np.arange(FRAMES) + np.where(np.arange(FRAMES) < 80, 0, 20)
    samples = scene(rng, [(6.0, place)])
    slow, gone_s = np.arange(FRAMES) / 48.0, np.where(np.arange(FRAMES) < 80, 0.0, 1.6)  # 20 taps are 3 m
    jumped = detect(samples, start_s=0.2)
    walked = detect(samples, start_s=0.2, timestamp_s=slow + gone_s)
    assert walked.frame[walked["tap"] >= 38][0] < 83
    assert jumped.frame[jumped["tap"] >= 38][0] > 85


def test_what_a_tap_has_always_shown_is_no_evidence(detect):
    rng = np.random.default_rng(6)
    samples = scene(rng, [(6.0, 40.0)], frames=300)
    assert len(detect(samples)) == 0
    assert len(detect(samples[::-1], start_s=0.0)) > 0


def test_several_bodies_are_found_where_they_are_asked_for(detect):
    one, other = 20 + 0.05 * np.arange(FRAMES), 50 - 0.08 * np.arange(FRAMES)
    samples = scene(np.random.default_rng(7), [(8.0, one), (6.0, other)])
    found = detect(samples, targets=3)
    late = found.take((found.frame > 90) & (found.frame < 140))
    per_frame = np.bincount(late.frame, minlength=140)[91:]
    assert np.median(per_frame) == 2
    assert per_frame.max() == 2
    assert np.bincount(detect(samples).frame).max() == 1


@pytest.mark.parametrize("scale", [1e-20, 1e20])
def test_any_scale_of_the_samples_gives_the_same_taps(detect, scale):
    samples = scene(np.random.default_rng(8), [(6.0, 20 + 0.1 * np.arange(FRAMES))])
    usual, scaled = detect(samples), detect(samples * scale, scale)
    np.testing.assert_array_equal(usual["tap"], scaled["tap"])
    np.testing.assert_allclose(usual["score_db"], scaled["score_db"], rtol=1e-9)


def test_any_cut_gives_the_same_rows_and_lost_frames_are_passed_over(run_cut, make_radar, make_block, make_echoes):
    samples = make_echoes(120)
    noise = np.full(120, 2e-3)
    noise[30:33] = 0.0
    block = make_block(samples, noise_rms=noise, first_path=np.full(120, 7.0))
    found = run_cut("track.before_detect", {"targets": 2, "start_s": 0.1}, make_radar(50), block, [1, 2, 6, 40, 41, 90])
    assert len(found.detections) > 50
    assert not {5, 30, 31, 32} & set(found.detections.frame.tolist())
