"""The adaptive threshold holds the rate of false alarms that it states."""

import numpy as np
import pytest

from uwbbench.api import ConfigError, Detections

WAY_M = 0.03
"""Between frames: each of them enters the history."""


def bounds(rate, trials):
    """Counts that a binomial variable leaves in fewer than one of 10^7 draws."""
    spread = 5.4 * np.sqrt(trials * rate * (1 - rate))
    return trials * rate - spread - 3, trials * rate + spread + 3


def noise(rng, frames, taps):
    return (rng.normal(size=(frames, taps)) + 1j * rng.normal(size=(frames, taps))) / np.sqrt(2)


@pytest.fixture
def passed(make_radar, make_block, make_stage, run_stage):
    """Detections that pass behind ``peaks``, in frames of a robot that moves."""

    def passed(samples, profile="profile.minmax", cuts=(), first=0, **params):
        frames, taps = samples.shape
        radar = make_radar(taps)
        way = np.zeros((frames, 3))
        way[:, 0] = WAY_M * np.arange(frames)
        block = make_block(samples, position_m=way, first=first, first_path=np.full(frames, 7.0))
        for name in (profile, "peaks"):
            block = run_stage(make_stage(name), radar, block)
        return run_stage(make_stage("filter.adaptive", **params), radar, block, cuts).detections

    return passed


@pytest.mark.parametrize(
    ("taps", "rate", "scale"), [(24, 0.02, 1e-20), (50, 0.01, 1.0), (50, 0.002, 1e20), (300, 0.01, 3.0)]
)
def test_noise_alone_passes_at_the_stated_rate_of_whatever_scale(passed, taps, rate, scale):
    frames = 150_000 // taps
    samples = scale * noise(np.random.default_rng(taps), frames, taps)
    low, high = bounds(rate, frames * (taps - 4))
    assert low < len(passed(samples, false_alarm_rate=rate)) < high


def test_the_rate_holds_where_one_tap_says_what_the_noise_is(passed):
    samples = noise(np.random.default_rng(1), 3000, 50)
    low, high = bounds(0.02, 3000 * 46)
    assert low < len(passed(samples, false_alarm_rate=0.02, noise_taps=1)) < high


def test_the_rate_does_not_hang_on_how_the_profile_is_scaled(passed):
    samples = noise(np.random.default_rng(2), 500, 50)
    one, other = (passed(samples, profile=name) for name in ("profile.minmax", "profile.amplitude"))
    assert one["tap"].tolist() == other["tap"].tolist()


@pytest.mark.parametrize("scale", [1e-20, pytest.param(1e20, marks=pytest.mark.slow)])
def test_the_rate_holds_at_each_delay_of_a_floor_that_decays(passed, scale):
    """Only the last frame of each history is counted, as its neighbours share the threshold."""
    taps, frames, rate = 2000, 40, 0.02
    level = scale * 10 ** (-3 * np.arange(taps) / taps)
    near = far = 0
    for seed in range(12):
        tap = passed(level * noise(np.random.default_rng(seed), frames, taps), floor="measured", false_alarm_rate=rate)
        last = tap["tap"][tap.frame == frames - 1]
        near, far = near + np.count_nonzero(last < taps / 2), far + np.count_nonzero(last >= taps / 2)
    low, high = bounds(rate, 12 * taps / 2)
    assert low < near < high
    assert low < far < high


def test_ringing_that_is_the_same_in_all_frames_passes_no_more_often_than_stated(passed):
    frames, rate = 700, 0.02
    tap = np.arange(50)
    ringing = np.where(tap < 4, 0, 30 * np.exp(-tap / 8) * np.exp(1j * tap))
    samples = ringing + noise(np.random.default_rng(3), frames, 50)
    found = passed(samples, floor="measured", false_alarm_rate=rate)
    settled = np.count_nonzero(found.frame >= 64)
    assert settled < bounds(rate, (frames - 64) * 46)[1]


def test_an_echo_that_comes_nearer_does_not_hide_itself(passed):
    """Over its way to the robot it stands 20 dB above the noise, in ringing 10 dB stronger than itself."""
    frames = 90
    tap = np.arange(50)
    place = 40 - 0.2 * np.arange(frames)[:, None]  # 3 cm a frame are 0.2 taps
    pulse = 10 * np.exp(-((tap - place) ** 2) / 1.5) * np.exp(2j * place)
    ringing = np.where(tap < 6, 0, 60 * np.exp(-np.maximum(tap - 7, 0) / 2.5))
    found = passed(pulse + ringing + noise(np.random.default_rng(4), frames, 50), floor="measured")
    near = np.abs(found["tap"] - place[found.frame, 0]) <= 1
    assert len(np.unique(found.frame[near])) > 0.95 * frames
    late = (found.frame > 45) & ~near & (np.abs(found["tap"] - 7) < 6)
    assert np.count_nonzero(late) <= 3


@pytest.mark.parametrize("floor", ["noise", "measured"])
def test_any_cut_gives_the_same_detections(
    make_radar, make_block, make_stage, run_stage, run_cut, make_echoes, one_by_one, floor
):
    frames = 90
    way = np.zeros((frames, 3))
    way[:, 1] = 0.01 * np.arange(frames)
    block = make_block(make_echoes(frames), position_m=way, first_path=np.where(np.arange(frames) == 30, np.nan, 7.2))
    for name in ("profile.minmax", "peaks"):
        block = run_stage(make_stage(name), make_radar(), block)
    params = {"floor": floor, "history_frames": 16, "spacing_m": 0.02, "least_echo_db": -40}
    run_cut("filter.adaptive", params, make_radar(), block, one_by_one(frames))


def test_a_robot_that_stands_learns_no_floor(make_radar, make_block, make_stage, run_stage):
    samples = np.zeros((200, 50), complex) + 0.1 * noise(np.random.default_rng(5), 200, 50)
    samples[:, 20] = 10
    block = make_block(samples, first_path=np.full(200, 7.0))
    for name in ("profile.minmax", "peaks"):
        block = run_stage(make_stage(name), make_radar(), block)
    found = run_stage(make_stage("filter.adaptive", floor="measured"), make_radar(), block).detections
    assert np.count_nonzero(found["tap"] == 20) == 200


@pytest.mark.parametrize(("spreading", "passing"), [("mirror", [10, 20, 40]), ("point", [20, 40])])
def test_the_weakest_echo_of_interest_falls_with_the_range(
    make_radar, make_block, make_stage, run_stage, spreading, passing
):
    """Of echoes that fall by less than 1/R in amplitude the near one is too weak where echoes of points are meant."""
    samples = np.full((1, 50), 1e-6, complex)
    tap = np.array([10.0, 20.0, 40.0])
    range_m = (tap - 7) * 1e-9 * 299792458 / 2
    height = 0.06 * range_m ** np.array(-1.0)
    samples[0, 7], samples[0, tap.astype(int)] = 1.0, height
    found = Detections(np.zeros(3, int), tap=tap, amplitude=height, prominence=height)
    block = make_block(samples, first_path=np.array([7.0]), detections=found, profile=np.abs(samples))
    stage = make_stage("filter.adaptive", least_echo_db=20 * np.log10(0.05), spreading=spreading)
    assert run_stage(stage, make_radar(), block).detections["tap"].tolist() == passing


def test_noise_of_zero_holds_no_rate(passed):
    samples = np.zeros((2, 50), complex)
    samples[:, 20] = 1
    assert len(passed(samples)) == 0


def test_without_taps_of_noise_the_median_of_all_holds_the_rate_nearly(make_radar, make_block, make_stage, run_stage):
    """It is 8 % lower: the median of 50 taps is no Gamma variable, and looks at the tested tap too."""
    radar, frames, rate = make_radar(noise_taps=0), 4000, 0.01
    block = make_block(noise(np.random.default_rng(6), frames, 50), first_path=np.full(frames, 7.0))
    for name in ("profile.amplitude", "peaks", "filter.adaptive"):
        block = run_stage(make_stage(name, **({"false_alarm_rate": rate} if "filter" in name else {})), radar, block)
    low, high = bounds(rate, frames * 50)
    assert 0.8 * low < len(block.detections) < high


def test_a_frame_of_nothing_but_noise_taps_is_refused(make_radar, make_stage):
    with pytest.raises(ConfigError, match="lower 'noise_taps'"):
        make_stage("filter.adaptive", noise_taps=50).open(make_radar())
