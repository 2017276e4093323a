"""Energy averaged along the taps."""

import numpy as np
import pytest

from uwbbench.api import ConfigError


def smoothed(make_radar, make_block, make_stage, run_stage, samples, radar=None, **params):
    radar = radar or make_radar(taps=samples.shape[1])
    return run_stage(make_stage("smooth.energy", **params), radar, make_block(samples)).frames.preamble


def test_each_sample_is_the_root_of_the_mean_energy_around_it(make_radar, make_block, make_stage, run_stage):
    parts = np.random.default_rng(0).normal(size=(2, 6, 40))
    samples = parts[0] + 1j * parts[1]
    found = smoothed(make_radar, make_block, make_stage, run_stage, samples, taps=5)
    expected = [
        [np.sqrt(np.mean(np.abs(frame[max(tap - 2, 0) : tap + 3]) ** 2)) for tap in range(40)] for frame in samples
    ]
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_one_tap_leaves_magnitudes_as_they_are(make_radar, make_block, make_stage, make_echoes, run_stage):
    samples = np.nan_to_num(make_echoes(30))
    found = smoothed(make_radar, make_block, make_stage, run_stage, samples, taps=1)
    np.testing.assert_allclose(found, np.abs(samples), rtol=1e-12)


@pytest.mark.parametrize(
    ("interval_s", "bandwidth_hz", "taps"), [(61.03515625e-12, 1.7e9, 7), (61.03515625e-12, 1.4e9, 9), (1e-9, 500e6, 1)]
)
def test_pulses_become_an_odd_number_of_taps_of_the_radar(interval_s, bandwidth_hz, taps, make_radar, make_stage):
    stage = make_stage("smooth.energy", pulses=0.8)
    assert stage.params.taps_for(make_radar(sample_interval_s=interval_s, bandwidth_hz=bandwidth_hz)) == taps


def test_an_average_longer_than_a_frame_is_refused(make_radar, make_stage):
    with pytest.raises(ConfigError, match="31 taps does not fit into 20 taps"):
        make_stage("smooth.energy", taps=31).open(make_radar(taps=20))


@pytest.mark.parametrize(("params", "words"), [({"taps": 4}, "must be odd"), ({"taps": 3, "pulses": 1.0}, "not both")])
def test_what_is_no_length_is_refused(params, words, make_stage):
    with pytest.raises(ValueError, match=words):
        make_stage("smooth.energy", **params)


def test_any_cut_into_blocks_gives_the_same_bits(make_radar, make_block, make_echoes, run_cut, one_by_one):
    run_cut("smooth.energy", {"taps": 9}, make_radar(), make_block(make_echoes(60)), one_by_one(60))
