"""Local maxima, prominence and width against SciPy, frame by frame."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from scipy import signal

COLUMNS = ("tap", "amplitude", "prominence", "width_taps")


def comb(taps: int) -> np.ndarray:
    return np.where(np.arange(taps) % 2, 1.0 + np.arange(taps), 0.0)


def mountain(taps: int) -> np.ndarray:
    return -np.abs(np.arange(taps) - taps / 3) + np.where(np.arange(taps) % 2, 0.1, 0.0)


def odd_rows(taps: int) -> np.ndarray:
    """Combs, slopes, a constant, flat tops at the edges, the smallest and the largest numbers."""
    step = np.arange(taps, dtype=float)
    tiny = np.nextafter(0.0, 1.0)
    rows = [
        comb(taps),
        comb(taps)[::-1],
        mountain(taps),
        step,
        -step,
        np.full(taps, 3.0),
        step * tiny,
        comb(taps) * tiny,
    ]
    rows += [
        np.minimum(step, 2),
        np.maximum(step, taps - 3),
        (step // 3) % 2,
        comb(taps) * 1e300,
        np.where(step % 3, 1, 1 + 2**-52),
    ]
    return np.array(rows)


def curves() -> st.SearchStrategy[np.ndarray]:
    """Frames (n, taps): few levels for plateaus and ties, any floats, or odd shapes in any order."""
    shape = st.tuples(st.integers(0, 5), st.integers(1, 30))
    levels = shape.flatmap(lambda s: npst.arrays(float, s, elements=st.integers(-2, 3).map(float)))
    floats = shape.flatmap(lambda s: npst.arrays(float, s, elements=st.floats(-1e9, 1e9, allow_subnormal=True)))
    odd = st.tuples(st.permutations(range(13)), st.integers(1, 40)).map(lambda p: odd_rows(p[1])[list(p[0])])
    return st.one_of(levels, floats, odd)


def by_scipy(row: np.ndarray, relative_height: float, window: int | None) -> tuple[np.ndarray, ...]:
    peak, _ = signal.find_peaks(row)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # prominence or width 0
        data = signal.peak_prominences(row, peak, wlen=window)
        width = signal.peak_widths(row, peak, relative_height, prominence_data=data)[0]
    return peak, data[0], width


@settings(max_examples=150, deadline=None)
@given(curves(), st.sampled_from([0.5, 0.25, 1.0]), st.sampled_from([None, None, 2, 3, 6, 11]), st.data())
def test_peaks_prominences_and_widths_are_those_of_scipy_for_each_frame(
    make_radar, make_block, run_cut, profile, relative_height, window, data
):
    cuts = data.draw(st.lists(st.integers(0, len(profile)), max_size=3))
    block = make_block(np.ones(profile.shape), profile=profile)
    params = {"relative_height": relative_height, "window_taps": window}
    found = run_cut("peaks", params, make_radar(max(profile.shape[1], 4)), block, cuts).detections
    for frame, row in enumerate(profile):
        own = found.take(found.frame == frame)
        peak, prominence, width = by_scipy(row, relative_height, window)
        np.testing.assert_array_equal(own["tap"], peak)
        np.testing.assert_allclose(own["prominence"], prominence, rtol=1e-12, atol=0)
        np.testing.assert_allclose(own["width_taps"], width, rtol=1e-12, atol=1e-12)


def test_widths_do_not_lose_digits_in_a_long_recording(make_radar, make_block, make_stage, run_stage):
    few = np.random.default_rng(1).normal(size=(100, 8))
    few[0] = [0, 0.5 + 1e-11, 1, 0.5 + 1e-11, 0, 0, 0, 0]  # crosses so near a tap that a long array rounds to it
    stage = make_stage("peaks")
    short = run_stage(stage, make_radar(8), make_block(few, profile=few)).detections
    many = np.tile(few, (3000, 1))
    long = run_stage(stage, make_radar(8), make_block(many, profile=many)).detections
    for name in ("tap", "prominence", "width_taps"):
        np.testing.assert_array_equal(long[name].reshape(3000, -1), np.tile(short[name], (3000, 1)))


@settings(max_examples=50, deadline=None)
@given(npst.arrays(float, (3, 25), elements=st.floats(0, 1, width=16)))
def test_no_width_at_half_prominence_is_below_half_a_tap(make_radar, make_block, make_stage, run_stage, profile):
    found = run_stage(make_stage("peaks"), make_radar(25), make_block(profile, profile=profile)).detections
    assert (found["width_taps"] >= 0.5).all()


def test_taps_and_amplitudes_are_those_of_the_frame_although_the_profile_starts_later(
    make_radar, make_block, make_stage, run_stage
):
    samples = np.zeros((2, 10), complex)
    samples[0, 6], samples[1, 8] = 3 + 4j, 2j
    profile = np.abs(samples[:, 4:]) / 5
    block = make_block(samples, first=70, profile=profile, profile_start=4)
    found = run_stage(make_stage("peaks"), make_radar(10), block).detections
    assert found.frame.tolist() == [70, 71]
    assert found["tap"].tolist() == [6, 8]
    assert found["amplitude"].tolist() == [5, 2]
    assert found["prominence"].tolist() == [1, 0.4]


def test_a_crest_on_the_first_tap_of_the_profile_is_no_peak(make_radar, make_block, make_stage, run_stage):
    profile = np.array([[9.0, 1, 2, 1, 9]])
    found = run_stage(make_stage("peaks"), make_radar(5), make_block(profile, profile=profile)).detections
    assert found["tap"].tolist() == [2]


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_constant_frames_have_no_peaks_but_all_columns(value, make_radar, make_block, make_stage, run_stage):
    flat = np.full((3, 20), value)
    found = run_stage(make_stage("peaks"), make_radar(20), make_block(flat, profile=flat)).detections
    assert len(found) == 0
    assert set(COLUMNS) <= set(found.columns)
