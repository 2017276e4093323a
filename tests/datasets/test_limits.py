"""Test signals have the pulse, the noise and the truth that they claim."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.fixtures.chance import SIGMAS, seed
from uwbbench.api import SPEED_OF_LIGHT_M_S, Capture, ConfigError
from uwbbench.config.detector import read_detector
from uwbbench.config.source import open_dataset
from uwbbench.detect.pipeline import Pipeline
from uwbbench_datasets.limits import CREST_TAP, PULSE, SAMPLE_INTERVAL_S

ALIKE = 1.75
"""Taps of noise that are as sure of a mean as one independent sample: the sum of their squared correlation."""


def signal(**params: object) -> Capture:
    dataset = open_dataset("limits", {"seed": seed(), **params}, [])
    (name,) = dataset.names()
    return dataset.open(name)


def ranges(capture: Capture) -> np.ndarray:
    assert capture.truth is not None
    return capture.truth.seen_from(capture.radar, capture.trajectory).range_m


def errors_m(detector: str, capture: Capture) -> np.ndarray:
    """Errors of the detections of echoes between 2 and 5.5 m, less than 20 cm off."""
    found = Pipeline(read_detector(detector)).run(capture)
    true_m = ranges(capture)[found.frame, 0]
    error_m = found.range_m - true_m
    return error_m[(true_m > 2.0) & (true_m < 5.5) & (np.abs(error_m) < 0.2)]


def test_noise_is_correlated_like_the_pulse_and_has_unit_power() -> None:
    tail = signal(scene="noise", snr_db=-20, frames=20_000).frames().preamble[:, 20:]
    measured = [np.mean(tail[:, lag:] * tail[:, : tail.shape[1] - lag].conj()).real for lag in range(5)]
    off = SIGMAS * np.sqrt(
        1.75 / tail.size
    )  # 1.75, the sum of the squared correlation, of neighbours that say the same
    assert_allclose(measured, PULSE(np.arange(5) * SAMPLE_INTERVAL_S), atol=off)
    assert measured[1] == pytest.approx(0.60, abs=0.01 + off)


def test_noise_is_circular() -> None:
    tail = signal(scene="noise", snr_db=-20, frames=20_000).frames().preamble[:, 20:]
    assert abs(np.mean(tail**2)) < SIGMAS * np.sqrt(2 * ALIKE / tail.size)


def test_frames_are_independent() -> None:
    tail = signal(scene="noise", snr_db=-20, frames=20_000).frames().preamble[:, 20:]
    power = np.abs(tail) ** 2 - 1
    off = SIGMAS * np.sqrt(ALIKE / tail.size)
    for apart in (1, 2, 7):
        assert abs(np.mean(tail[apart:] * tail[:-apart].conj())) < off
        assert abs(np.mean(power[apart:] * power[:-apart])) < off


def test_a_strong_echo_is_the_pulse_at_its_true_delay() -> None:
    capture = signal(scene="echo", snr_db=80, frames=50, min_range_m=2.5)
    amplitude = capture.frames().amplitude
    delay_s = 2 * ranges(capture) / SPEED_OF_LIGHT_M_S
    after_crest_s = (np.arange(50) - CREST_TAP) * SAMPLE_INTERVAL_S - delay_s
    beside = np.abs(after_crest_s) < 1.5e-9
    expected = 1e4 * np.abs(PULSE(after_crest_s))
    assert_allclose(amplitude[beside], expected[beside], atol=1e4 * 0.01)  # side lobes of the direct path


def test_the_signal_to_noise_ratio_is_that_of_the_crest() -> None:
    capture = signal(scene="echo", snr_db=20, frames=4000, min_range_m=3.0)
    taps = CREST_TAP + 2 * ranges(capture)[:, 0] / SPEED_OF_LIGHT_M_S / SAMPLE_INTERVAL_S
    on_a_tap = np.abs(taps - np.rint(taps)) < 0.05
    power = capture.frames().amplitude[on_a_tap, np.rint(taps[on_a_tap]).astype(int)] ** 2
    # A power of 100 and noise of 1 spread by 14; some 0.05 dB come from side lobes of the direct path.
    assert 10 * np.log10(np.mean(power) - 1) == pytest.approx(20, abs=0.05 + SIGMAS * 0.62 / np.sqrt(len(power)))


def test_a_pair_lies_as_far_apart_as_asked_and_inside_the_span() -> None:
    near, far = ranges(signal(scene="pair", snr_db=20, separation_ns=2.0, frames=500, max_range_m=3.0)).T
    assert_allclose(2 * (far - near) / SPEED_OF_LIGHT_M_S, 2e-9)
    assert near.min() >= 0.2
    assert far.max() <= 3.0


def test_noise_alone_has_nothing_to_find() -> None:
    capture = signal(scene="noise", snr_db=20, frames=10)
    assert capture.truth is not None
    assert capture.truth.objects == ()
    assert capture.truth.exhaustive


def test_the_same_seed_gives_the_same_samples() -> None:
    one, other = (signal(scene="echo", snr_db=20, frames=20) for _ in range(2))
    assert one.sha256 == other.sha256
    assert one.sha256 != signal(scene="echo", snr_db=20, frames=20, seed=seed() + 1).sha256


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"scene": "echo"}, "snr_db"),
        ({"scene": "pair", "snr_db": 20}, "separation_ns"),
        ({"scene": "echo", "snr_db": 20, "separation_ns": 2.0}, "separation_ns"),
        ({"scene": "echo", "snr_db": 20, "min_range_m": 3.0, "max_range_m": 2.0}, "max_range_m"),
    ],
)
def test_signals_that_make_no_sense_are_refused(params: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        open_dataset("limits", params, [])


@pytest.mark.slow
@pytest.mark.parametrize(("snr_db", "expected_cm"), [(20, 1.16), (25, 0.65), (30, 0.41)])
def test_subsample_ranges_reach_the_accuracy_of_the_log_parabola(snr_db: float, expected_cm: float) -> None:
    error_m = errors_m("paper-subsample", signal(scene="echo", snr_db=snr_db, frames=4000))
    assert len(error_m) > 2000
    assert 100 * np.sqrt(np.mean(error_m**2)) == pytest.approx(
        expected_cm, rel=0.05 + SIGMAS / np.sqrt(2 * len(error_m))
    )


def test_ranges_on_whole_taps_stay_at_the_error_of_their_grid() -> None:
    error_m = errors_m("paper-filtering", signal(scene="echo", snr_db=30, frames=4000))
    assert 100 * np.sqrt(np.mean(error_m**2)) == pytest.approx(4.42, rel=0.02 + SIGMAS / np.sqrt(2 * len(error_m)))


def test_several_runs_of_a_signal_have_draws_of_their_own_and_one_run_keeps_its_name() -> None:
    def dataset(**params):
        return open_dataset("limits", {"scene": "echo", "snr_db": 20, "frames": 9, **params}, ())

    several = dataset(runs=3)
    assert several.names() == ["echo-20db/1", "echo-20db/2", "echo-20db/3"]
    assert len({several.open(name).sha256 for name in several.names()}) == 3
    assert dataset().names() == ["echo-20db"]
