"""Compiled prominences, widths and maxima beside those of SciPy."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from uwbbench_detectors.compiled.frame import find_maxima, root_mean_square
from uwbbench_detectors.compiled.shape import prominence_of, prominences_of, width_of
from uwbbench_detectors.peaks.noise import rms

heights = st.lists(st.integers(0, 6) | st.floats(0, 10, width=32), min_size=3, max_size=80)


def maxima(profile):
    room = np.empty(len(profile), np.uint8), np.empty(len(profile), np.int64)
    return room[1][: find_maxima(profile, *room)]


@settings(max_examples=400, deadline=None)
@given(heights)
def test_maxima_prominences_and_widths_are_those_of_scipy(values):
    profile = np.array(values, dtype=np.float64)
    expected, _ = signal.find_peaks(profile)
    peaks = maxima(profile)
    np.testing.assert_array_equal(peaks, expected)
    if not len(peaks):
        return
    bases = signal.peak_prominences(profile, peaks)
    widths, *_ = signal.peak_widths(profile, peaks, 0.5, prominence_data=bases)
    np.testing.assert_array_equal(prominences_of(profile, peaks), bases[0])
    for peak, prominence, width in zip(peaks, bases[0], widths, strict=True):
        assert prominence_of(profile, peak) == prominence
        np.testing.assert_allclose(width_of(profile, peak, prominence, 0.5), width, rtol=0, atol=1e-12)


def test_a_comb_has_the_prominences_of_scipy():
    profile = np.where(np.arange(2001) % 2, 1 + np.arange(2001) / 4e3, 0.1)
    peaks, _ = signal.find_peaks(profile)
    np.testing.assert_array_equal(prominences_of(profile, peaks), signal.peak_prominences(profile, peaks)[0])


@given(st.lists(st.floats(0, 1e300), min_size=1, max_size=128))
def test_the_root_mean_square_adds_up_as_numpy_does(values):
    amplitude = np.array(values)
    assert root_mean_square(amplitude, 0, len(amplitude)) == rms(amplitude[None])[0]
