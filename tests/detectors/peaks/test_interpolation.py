"""Sub-tap delays: exactness, limits, and the errors known for a raised-cosine pulse in filtered noise."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from uwbbench.api import Detections

CM_PER_TAP = 15.0
KNOWN_RMSE_CM = {15: (4.79, 2.06), 20: (4.51, 1.16), 25: (4.42, 0.65), 30: (4.42, 0.41)}
"""Root-mean-square range error by SNR in dB: on whole taps, and with the parabola through logarithms."""


def raised_cosine(time_ns):
    """Raised-cosine pulse of roll-off 0.5 and symbol time 2 ns."""
    x = np.asarray(time_ns) / 2.0
    pole = np.isclose(np.abs(x), 1.0)
    bottom = np.where(pole, 1.0, 1 - x**2)
    return np.where(pole, 0.0, np.sinc(x) * np.cos(np.pi * x / 2) / bottom)


def gaussian(time_ns):
    return np.exp(-4 * np.log(2) * (np.asarray(time_ns) / 3.2) ** 2)


@pytest.fixture
def interpolated(make_radar, make_block, make_stage, run_stage):
    """Fractional taps of the strongest tap of each frame."""

    def interpolated(samples, method, tap=None):
        tap = np.argmax(np.abs(samples), axis=1) if tap is None else tap
        found = Detections(np.arange(len(samples)), tap=tap)
        block = make_block(samples, detections=found)
        return run_stage(
            make_stage("interpolate", method=method), make_radar(samples.shape[1], noise_taps=0), block
        ).detections["tap"]

    return interpolated


@pytest.mark.parametrize("snr_db", KNOWN_RMSE_CM)
def test_errors_in_filtered_noise_are_the_known_ones(interpolated, snr_db):
    rng = np.random.default_rng(snr_db)
    taps, trials = 24, 20000
    place = np.arange(taps)
    covariance = raised_cosine(place[:, None] - place)
    value, vector = np.linalg.eigh(covariance)
    white = (rng.normal(size=(trials, taps)) + 1j * rng.normal(size=(trials, taps))) / np.sqrt(2)
    noise = white @ (vector * np.sqrt(np.maximum(value, 0)) @ vector.T)
    delay = 12 + rng.uniform(-0.5, 0.5, trials)
    phase = np.exp(2j * np.pi * rng.uniform(size=(trials, 1)))
    samples = 10 ** (snr_db / 20) * phase * raised_cosine(place - delay[:, None]) + noise
    whole = np.argmax(np.abs(samples), axis=1)
    for tap, known_cm in zip((whole, interpolated(samples, "log_parabola")), KNOWN_RMSE_CM[snr_db], strict=True):
        error_cm = CM_PER_TAP * np.sqrt(np.mean((tap - delay) ** 2))
        assert error_cm == pytest.approx(known_cm, rel=0.1)  # 14 standard errors of a normal one, 1 / sqrt(2 trials)


@pytest.mark.parametrize(("method", "known_cm"), [("parabola", 0.35), ("log_parabola", 0.20)])
def test_errors_without_noise_are_the_known_ones(interpolated, method, known_cm):
    delay = 12 + np.linspace(-0.499, 0.499, 999)
    samples = raised_cosine(np.arange(24) - delay[:, None])
    error_cm = CM_PER_TAP * np.sqrt(np.mean((interpolated(samples, method) - delay) ** 2))
    assert error_cm == pytest.approx(known_cm, rel=0.1)


def test_the_parabola_through_logarithms_is_exact_for_a_gaussian_pulse(interpolated):
    delay = 12 + np.linspace(-0.49, 0.49, 99)
    samples = 1e-3 * gaussian(np.arange(24) - delay[:, None])
    np.testing.assert_allclose(interpolated(samples, "log_parabola"), delay, atol=1e-12)


def test_the_parabola_is_exact_for_a_parabola(interpolated):
    delay = 2 + np.linspace(-0.49, 0.49, 99)
    samples = 100 - (np.arange(5) - delay[:, None]) ** 2
    np.testing.assert_allclose(interpolated(samples, "parabola"), delay, atol=1e-12)


@pytest.mark.parametrize("method", ["parabola", "log_parabola"])
@given(npst.arrays(float, (4, 6), elements=st.floats(0, 1e150)))
def test_no_magnitudes_move_a_maximum_by_more_than_half_a_tap(
    make_radar, make_block, make_stage, run_stage, method, samples
):
    tap = np.argmax(samples, axis=1)
    block = make_block(samples, detections=Detections(np.arange(4), tap=tap))
    moved = run_stage(make_stage("interpolate", method=method), make_radar(6), block).detections["tap"]
    assert (np.abs(moved - tap) <= 0.5).all()


def test_the_first_and_last_tap_stay(interpolated):
    samples = np.array([[3.0, 2, 1], [1, 2, 3]])
    assert interpolated(samples, "parabola").tolist() == [0, 2]


def test_a_tap_that_is_no_maximum_moves_at_most_half_a_tap_uphill(interpolated):
    samples = np.array([[1.0, 2.0, 2.5, 0.0], [5.0, 1.0, 5.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    assert interpolated(samples, "parabola", tap=np.array([1, 1, 1])).tolist() == [1.5, 1, 1]


def test_beside_a_zero_the_logarithm_gives_way_to_the_parabola(interpolated):
    samples = np.array([[0.0, 2.0, 1.0]])
    expected = interpolated(samples, "parabola")
    assert expected.tolist() == [1 + 0.5 * (0 - 1) / (0 - 4 + 1)]
    assert interpolated(samples, "log_parabola").tolist() == expected.tolist()


def test_amplitudes_stay_those_of_the_samples(make_radar, make_block, make_stage, run_stage):
    found = Detections([0], tap=[1], amplitude=[2.0])
    block = make_block(np.array([[1.0, 2.0, 1.5]]), detections=found)
    result = run_stage(make_stage("interpolate"), make_radar(3, noise_taps=0), block).detections
    assert result["amplitude"].tolist() == [2.0]
    assert found["tap"].tolist() == [1.0]
