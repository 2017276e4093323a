"""The detectors of a walking person, where the person stops."""

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from uwbbench import load_detector
from uwbbench.api import Capture, Radar, Trajectory

RATE_HZ, FRAMES, STOPS, GOES = 48.0, 480, 240, 432


@pytest.fixture(scope="module")
def walk():
    """An echo that recedes at 0.3 m/s, stands for four seconds, and goes on; and where it is, in metres."""
    walked_s = np.minimum(np.arange(FRAMES), STOPS) + np.maximum(np.arange(FRAMES) - GOES, 0)
    range_m = 1.5 + 0.3 * walked_s / RATE_HZ
    tap, rng = np.arange(50), np.random.default_rng(3)
    place = 7 + range_m[:, None] / 0.1499
    echo = 0.1 * np.exp(-((tap - place) ** 2) / 3) * np.exp(-2j * np.pi * place * 8)
    noise = 3e-3 * (rng.normal(size=(FRAMES, 50)) + 1j * rng.normal(size=(FRAMES, 50)))
    samples = np.exp(-((tap - 7) ** 2) / 3) + echo + noise
    radar = Radar("test", 7987.2e6, 499.2e6, 1e-9, RATE_HZ, taps=50, noise_taps=4)
    still = Trajectory(np.arange(FRAMES) / RATE_HZ, np.zeros((FRAMES, 3)), np.zeros(FRAMES))
    return Capture(name="walk", radar=radar, trajectory=still, source="simulated", preamble=samples), range_m


def recall(found, range_m, start, stop):
    """Share of frames whose nearest answer is within 0.2 m."""
    near = found.take(np.abs(found.range_m - range_m[found.frame]) < 0.2)
    return np.isin(np.arange(start, stop), near.frame).mean()


@pytest.mark.slow
def test_a_person_who_stops_becomes_background_and_is_found_again(walk):
    capture, range_m = walk
    with threadpool_limits(1):
        found = load_detector("walker-svd").run(capture)
    assert recall(found, range_m, 80, STOPS) > 0.9
    assert recall(found, range_m, STOPS + 96, GOES) < 0.5
    assert recall(found, range_m, GOES + 20, FRAMES) > 0.8


def moving_body(range_m, seed=5):
    """A capture of the radar of the walk, with an echo at a range in each frame; NaN where nobody is."""
    tap, rng = np.arange(50), np.random.default_rng(seed)
    place = 7 + np.nan_to_num(range_m, nan=1e6)[:, None] / 0.1499
    echo = 0.05 * np.exp(-np.minimum((tap - place) ** 2 / 3, 700)) * np.exp(-2j * np.pi * place * 8)
    noise = 3e-3 * (rng.normal(size=(len(range_m), 50)) + 1j * rng.normal(size=(len(range_m), 50)))
    radar = Radar("test", 7987.2e6, 499.2e6, 1e-9, RATE_HZ, taps=50, noise_taps=4)
    still = Trajectory(np.arange(len(range_m)) / RATE_HZ, np.zeros((len(range_m), 3)), np.zeros(len(range_m)))
    samples = np.exp(-((tap - 7) ** 2) / 3) + echo + noise
    return Capture(name="walk", radar=radar, trajectory=still, source="simulated", preamble=samples)


@pytest.mark.slow
def test_champion_still_finds_who_walks_and_holds_who_stops_for_two_seconds():
    range_m = 1.5 + 0.5 * np.minimum(np.arange(FRAMES), STOPS) / RATE_HZ
    found = load_detector("champion-still").run(moving_body(range_m))
    assert recall(found, range_m, 60, STOPS) > 0.9
    held = found.take(found["held"] > 0)
    assert STOPS < found.frame.max() < STOPS + 4 * RATE_HZ
    assert len(held.take(held.frame > STOPS)) > 1.5 * RATE_HZ


@pytest.mark.slow
def test_champion_still_says_nothing_where_nobody_walks():
    assert len(load_detector("champion-still").run(moving_body(np.full(2000, np.nan)))) == 0
