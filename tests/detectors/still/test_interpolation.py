"""Values between taps: against SciPy, and against a response whose values are known everywhere."""

import numpy as np
import pytest
from scipy import interpolate, ndimage

from uwbbench.api import Bins
from uwbbench_detectors.still.interpolation import between_taps

TAPS = 50
BINS = Bins(-4, 8, 8 * TAPS)
METHODS = ("quadratic", "fft", "linear")


def noise(frames, taps=TAPS):
    rng = np.random.default_rng(1)
    return rng.normal(size=(frames, taps)) + 1j * rng.normal(size=(frames, taps))


def periodic_sinc(place, taps):
    """Trigonometric polynomial through a 1 at place 0 and zeros at the other taps (odd number of taps)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        value = np.sin(np.pi * place) / (taps * np.sin(np.pi * place / taps))
    return np.where(np.mod(place, taps) == 0, 1.0, value)


@pytest.mark.parametrize("first_path", [6.0, 6.3, 7.984375])
def test_fft_is_the_exact_shift_of_a_periodic_sinc(first_path):
    taps, crest = 51, 11.37
    bins = Bins(-4, 8, 8 * taps)
    samples = periodic_sinc(np.arange(taps) - crest, taps)[None] * np.exp(0.7j)
    place = first_path + bins.place
    inside = (place >= 0) & (place <= taps - 1)
    found = between_taps(samples, np.array([first_path]), bins, "fft")[0]
    exact = periodic_sinc(place - crest, taps) * np.exp(0.7j)
    np.testing.assert_allclose(found[inside], exact[inside], atol=1e-13)
    assert np.isnan(found[~inside]).all()


def test_quadratic_is_the_spline_of_scipy_ndimage():
    samples = noise(3)
    first_path = np.array([5.2, 7.0, 8.71])
    found = between_taps(samples, first_path, BINS, "quadratic")
    for row in range(3):
        place = first_path[row] + BINS.place
        inside = (place >= 0) & (place <= TAPS - 1)
        parts = [
            ndimage.map_coordinates(part, place[None, inside], order=2, mode="mirror")
            for part in (samples[row].real, samples[row].imag)
        ]
        np.testing.assert_allclose(found[row, inside], parts[0] + 1j * parts[1], atol=1e-12)


def test_quadratic_is_the_interpolating_spline_of_scipy_away_from_the_ends():
    samples = noise(1)
    found = between_taps(samples, np.array([7.3]), BINS, "quadratic")[0]
    place = 7.3 + BINS.place
    inner = (place > 18) & (place < TAPS - 19)  # what is done at the ends dies away by 0.17 a tap
    spline = interpolate.make_interp_spline(np.arange(TAPS), samples[0], k=2)
    np.testing.assert_allclose(found[inner], spline(place[inner]), atol=1e-11)


def test_linear_is_the_straight_line_of_numpy():
    samples = noise(1)
    found = between_taps(samples, np.array([7.3]), BINS, "linear")[0]
    place = 7.3 + BINS.place
    inside = (place >= 0) & (place <= TAPS - 1)
    np.testing.assert_allclose(found[inside], np.interp(place[inside], np.arange(TAPS), samples[0]), atol=1e-14)


@pytest.mark.parametrize("method", METHODS)
def test_samples_are_kept_at_the_taps(method):
    samples = noise(1)
    found = between_taps(samples, np.array([4.0]), BINS, method)[0]
    np.testing.assert_allclose(found[::8], samples[0], atol=1e-13)


@pytest.mark.parametrize("method", METHODS)
def test_a_frame_alone_and_among_others_has_the_same_bits(method):
    samples, first_path = noise(9), np.linspace(5, 9, 9)
    together = between_taps(samples, first_path, BINS, method)
    alone = [between_taps(samples[row : row + 1], first_path[row : row + 1], BINS, method) for row in range(9)]
    np.testing.assert_array_equal(together, np.concatenate(alone))


@pytest.mark.parametrize("method", METHODS)
def test_a_first_path_that_is_not_known_gives_nothing(method):
    assert np.isnan(between_taps(noise(1), np.array([np.nan]), BINS, method)).all()
