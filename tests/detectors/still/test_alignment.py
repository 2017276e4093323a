"""Aligned magnitudes: where each tap goes, what they are divided by, and what is refused."""

import dataclasses

import numpy as np
import pytest

from uwbbench.api import ConfigError

TAPS = 50
ALIGNMENTS = ("cir.icir", "cir.ucir", "cir.acir")


def pulses(first_path, gain=1.0, echo_tap=12.0):
    """Frames with a direct path of height 1 at the first path, and an echo of a quarter some taps behind it."""
    tap = np.arange(TAPS) - np.asarray(first_path)[:, None]
    shape = np.exp(-(tap**2) / 3) + 0.25 * np.exp(-((tap - echo_tap) ** 2) / 3)
    return shape * np.exp(1j * np.arange(len(tap)))[:, None] * np.reshape(gain, (-1, 1))


@pytest.fixture
def aligned(make_stage, make_radar, make_block, run_stage):
    def run(name, first_path, samples=None, **params):
        first_path = np.asarray(first_path, float)
        samples = pulses(first_path) if samples is None else samples
        block = make_block(samples, first_path=first_path)
        return run_stage(make_stage(name, **params), make_radar(), block).aligned

    return run


def test_integer_alignment_moves_the_tap_before_the_first_path_to_zero(aligned):
    samples = np.zeros((2, TAPS), complex)
    samples[0, [7, 20]] = 1, 0.5
    samples[1, [9, 22]] = 2, 1
    found = aligned("cir.icir", [7.9, 9.1], samples)
    assert found.bins.place[[4, 17]].tolist() == [0.0, 13.0]
    np.testing.assert_array_equal(found.magnitude[:, 17], [0.5, 0.5])
    np.testing.assert_array_equal(found.magnitude[0, 4:40], found.magnitude[1, 4:40])


@pytest.mark.parametrize(("method", "tolerance"), [("fft", 1e-3), ("quadratic", 0.015), ("linear", 0.09)])
def test_fractional_alignment_makes_frames_equal_whose_grids_differ(aligned, method, tolerance):
    first_path = [7.0, 7.3, 8.9, 6.55]
    found = aligned("cir.ucir", first_path, interpolation=method)
    taps = found.bins.place
    expected = np.exp(-(taps**2) / 3) + 0.25 * np.exp(-((taps - 12) ** 2) / 3)
    inside = (taps >= -4) & (taps < 40)
    np.testing.assert_allclose(found.magnitude[:, inside], np.tile(expected[inside], (4, 1)), atol=tolerance)


def test_merged_alignment_puts_each_tap_into_the_bin_nearest_to_it(aligned):
    found = aligned("cir.acir", [7.0, 7.26])
    taps = found.bins.place
    filled = np.isfinite(found.magnitude)
    assert filled.sum(axis=1).tolist() == [47, 46]  # taps less than four before the first path have no bin
    np.testing.assert_array_equal(taps[filled[0]] % 1, np.zeros(47))
    np.testing.assert_array_equal(taps[filled[1]] % 1, np.full(46, 0.75))
    places = np.arange(TAPS) - 7.26
    assert np.abs(taps[filled[1]] - places[places >= -4 - 1 / 16]).max() <= 1 / 16


@pytest.mark.parametrize("name", ALIGNMENTS)
@pytest.mark.parametrize("gain", [1e-200, 8.0, 1e6])
def test_gain_of_a_frame_changes_nothing(aligned, name, gain):
    first_path = [7.2, 7.6]
    one, other = aligned(name, first_path), aligned(name, first_path, pulses(first_path, gain))
    np.testing.assert_allclose(other.magnitude, one.magnitude, rtol=1e-12, atol=1e-50)


@pytest.mark.parametrize("name", ALIGNMENTS)
def test_direct_path_has_the_height_one_wherever_the_grid_falls(aligned, name):
    first_path = 7 + np.arange(80) / 80
    assert np.nanmax(aligned(name, first_path).magnitude) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("name", ALIGNMENTS)
@pytest.mark.parametrize("first_path", [np.nan, -30.0, 1e300, np.inf])
def test_frames_without_a_first_path_in_them_stay_empty(aligned, name, first_path):
    found = aligned(name, [7.2, first_path], pulses([7.2, 7.2]))
    assert np.isfinite(found.magnitude[0]).any()
    assert not np.isfinite(found.magnitude[1]).any()


@pytest.mark.parametrize("name", ALIGNMENTS)
def test_zero_and_invalid_frames_stay_empty(aligned, name):
    samples = pulses([7.2, 7.2, 7.2])
    samples[1] = 0
    samples[2, 8] = np.nan
    found = aligned(name, [7.2, 7.2, 7.2], samples)
    assert np.isfinite(found.magnitude).any(axis=1).tolist() == [True, False, False]


@pytest.mark.parametrize("name", ALIGNMENTS)
def test_radars_that_count_from_transmission_are_refused(make_stage, make_radar, name):
    radar = dataclasses.replace(make_radar(), first_tap_delay_s=2e-9)
    with pytest.raises(ConfigError, match=f"{name}: delays of this radar count from transmission"):
        make_stage(name).open(radar)


@pytest.mark.parametrize("name", ALIGNMENTS)
def test_any_cut_gives_the_same_bits(make_radar, make_block, make_echoes, run_cut, one_by_one, name):
    block = make_block(make_echoes(300), first_path=7 + np.linspace(0, 1, 300))
    run_cut(name, {}, make_radar(), block, [1, 1, 7, 299])
    run_cut(name, {}, make_radar(), block.cut(0, 20), one_by_one(20))
