"""CFAR detectors: measured false-alarm rates, brute-force thresholds, strong neighbours and odd frames."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fixtures.chance import plausible
from uwbbench.api import ConfigError
from uwbbench.detect.pipeline import detector_from_yaml
from uwbbench_detectors.cfar.factors import TrainingWindow, filter_correlation, order_rank, threshold_factor

KINDS = ("ca", "go", "so", "os")
GUARD = 2
SAMPLE_INTERVAL_S = 1 / (2 * 499.2e6)


def complex_noise(shape, seed):
    rng = np.random.default_rng(seed)
    return (rng.normal(size=shape) + 1j * rng.normal(size=shape)) / np.sqrt(2)


def filtered_noise(shape, seed):
    """Noise with the correlation of a 500 MHz root-raised-cosine filter sampled at 1 ns."""
    place = np.arange(shape[1])
    value, vector = np.linalg.eigh(filter_correlation(place[:, None] - place, 0.5))
    return complex_noise(shape, seed) @ (vector * np.sqrt(np.maximum(value, 0)) @ vector.T)


def alarms(make_radar, make_block, make_stage, run_stage, samples, kind, **params):
    """Alarms at the first, the middle and the last tap: one cell of each sort in a frame, so trials are independent."""
    taps = samples.shape[1]
    radar = make_radar(taps, noise_taps=0, sample_interval_s=SAMPLE_INTERVAL_S)
    stage = make_stage(f"cfar.{kind}", cells="all", guard_taps=GUARD, **params)
    tap = run_stage(stage, radar, make_block(samples)).detections["tap"]
    return {"first": np.sum(tap == 0), "centre": np.sum(tap == taps // 2), "last": np.sum(tap == taps - 1)}


def assert_rate(counts, trials, rate):
    for place, count in counts.items():
        assert count in plausible(rate, trials), f"{place}: {count} alarms in {trials} trials"


@pytest.mark.parametrize(("rate", "trials"), [(1e-2, 40_000), (1e-3, 80_000)])
@pytest.mark.parametrize("training", [8, 12, 16])
@pytest.mark.parametrize("kind", KINDS)
def test_false_alarms_in_white_noise_come_at_the_rate_asked_for(
    make_radar, make_block, make_stage, run_stage, kind, training, rate, trials
):
    samples = complex_noise((trials, training + 2 * GUARD + 1), seed=training)
    params = {"training_taps": training, "false_alarm_rate": rate}
    assert_rate(alarms(make_radar, make_block, make_stage, run_stage, samples, kind, **params), trials, rate)


@pytest.mark.slow
@pytest.mark.parametrize("training", [8, 12, 16])
@pytest.mark.parametrize("kind", KINDS)
def test_false_alarms_in_filtered_noise_come_at_the_rate_asked_for(
    make_radar, make_block, make_stage, run_stage, kind, training
):
    trials = 80_000
    samples = filtered_noise((trials, training + 2 * GUARD + 1), seed=training)
    params = {"training_taps": training, "false_alarm_rate": 1e-3, "noise": "correlated"}
    assert_rate(alarms(make_radar, make_block, make_stage, run_stage, samples, kind, **params), trials, 1e-3)


@pytest.mark.slow
def test_factors_for_independent_cells_double_the_false_alarms_of_filtered_noise(
    make_radar, make_block, make_stage, run_stage
):
    trials = 300_000
    samples = filtered_noise((trials, 17), seed=5)
    counts = alarms(make_radar, make_block, make_stage, run_stage, samples, "ca", false_alarm_rate=1e-3)
    assert plausible(1e-3, trials)[-1] < plausible(1.9e-3, trials)[0]
    assert plausible(1.9e-3, trials)[0] <= counts["centre"] <= plausible(2.2e-3, trials)[-1]


def by_hand(power, kind, training, guard, rate, rank):
    """Noise estimate and factor of each cell of one frame, cell by cell."""
    half = training // 2
    noise, factor = np.zeros(len(power)), np.zeros(len(power))
    for cell in range(len(power)):
        left, right = power[: max(cell - guard, 0)][-half:], power[cell + guard + 1 :][:half]
        sides = [side for side in (left, right) if len(side) == half]
        cells = np.concatenate(sides)
        factor[cell] = threshold_factor(kind, TrainingWindow(half, len(sides), guard), rate, rank)
        if kind == "os":
            noise[cell] = sorted(cells)[order_rank(rank, len(cells)) - 1]
        else:
            means = [side.mean() for side in sides]
            noise[cell] = {"ca": np.mean(means), "go": max(means), "so": min(means)}[kind]
    return noise, factor


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=25, deadline=None)
@given(half=st.integers(1, 5), guard=st.integers(0, 3), extra=st.integers(0, 9), skip=st.integers(0, 3), data=st.data())
def test_detections_are_those_found_cell_by_cell(make_radar, make_block, run_cut, kind, half, guard, extra, skip, data):
    taps = 2 * (half + guard) + extra + skip
    seed = data.draw(st.integers(0, 2**16))
    samples = complex_noise((4, max(taps, 4)), seed) * 10.0 ** np.random.default_rng(seed).integers(
        -6, 6, (4, max(taps, 4))
    )
    cuts = data.draw(st.lists(st.integers(0, 4), max_size=2))
    params = {
        "training_taps": 2 * half,
        "guard_taps": guard,
        "false_alarm_rate": 0.05,
        "skip_taps": skip,
        "cells": "all",
    }
    block = make_block(samples, first=9)
    found = run_cut(f"cfar.{kind}", params, make_radar(samples.shape[1]), block, cuts).detections
    for frame in range(4):
        own = found.take(found.frame == frame + 9)
        amplitude = block.frames.amplitude[frame]
        power = amplitude[skip:] ** 2
        noise, factor = by_hand(power, kind, 2 * half, guard, 0.05, 0.75)
        expected = np.flatnonzero(power > factor * noise)
        np.testing.assert_array_equal(own["tap"], expected + skip)
        np.testing.assert_array_equal(own["amplitude"], amplitude[expected + skip])
        np.testing.assert_allclose(own["score_db"], 10 * np.log10(power / noise)[expected], atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_a_direct_path_120_db_above_the_noise_spoils_only_taps_that_train_on_it(
    make_radar, make_block, make_stage, run_stage, kind
):
    samples = complex_noise((50, 60), seed=2)
    strong = samples.copy()
    strong[:, 9] = 1e6
    stage = make_stage(f"cfar.{kind}", cells="all", false_alarm_rate=0.05)
    tables = []
    for frames in (samples, strong):
        found = run_stage(stage, make_radar(60), make_block(frames)).detections
        tables.append(found.take(found["tap"] > 9 + GUARD + 6))
    assert len(tables[0]) > 50
    for name, column in tables[0].columns.items():
        np.testing.assert_array_equal(tables[1][name], column)


def pulse(delay, height, taps=50, fwhm_ns=3.2):
    return height * np.exp(-4 * np.log(2) * ((np.arange(taps) - delay) / fwhm_ns) ** 2)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("delay", [20.0, 20.3, 20.5])
def test_a_pulse_is_one_detection_at_its_crest(make_radar, make_block, make_stage, run_stage, kind, delay):
    samples = 1e-3 * complex_noise((1, 50), seed=7) + pulse(delay, 1.0)
    params = {"guard_taps": 4, "false_alarm_rate": 1e-6}
    every = run_stage(make_stage(f"cfar.{kind}", cells="all", **params), make_radar(), make_block(samples)).detections
    one = run_stage(make_stage(f"cfar.{kind}", **params), make_radar(), make_block(samples)).detections
    assert len(every) > 1
    assert len(one) == 1
    assert one["tap"][0] == np.argmax(np.abs(samples))
    assert one["amplitude"][0] == pytest.approx(np.abs(samples).max())


def test_of_two_equal_taps_the_first_is_the_detection(make_radar, make_block, make_stage, run_stage):
    samples = np.ones((1, 40))
    samples[0, 20:22] = 100.0
    found = run_stage(make_stage("cfar.os"), make_radar(40), make_block(samples)).detections
    assert found["tap"].tolist() == [20]


def test_the_flank_of_something_larger_among_the_skipped_taps_is_no_detection(
    make_radar, make_block, make_stage, run_stage
):
    samples = 1e-4 * complex_noise((1, 50), seed=8) + pulse(3.0, 1.0)
    radar, block = make_radar(), make_block(samples)
    flank = run_stage(make_stage("cfar.os", skip_taps=4, cells="all"), radar, block).detections["tap"]
    assert len(flank) > 0
    assert len(run_stage(make_stage("cfar.os", skip_taps=4), radar, block).detections) == 0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("value", [0.0, 1.0])
@pytest.mark.parametrize("cells", ["maxima", "all"])
def test_constant_frames_have_no_detections_and_no_notes(
    make_radar, make_block, make_stage, run_stage, kind, value, cells
):
    stage = make_stage(f"cfar.{kind}", cells=cells)
    assert len(run_stage(stage, make_radar(), make_block(np.full((3, 50), value))).detections) == 0
    assert stage.notes == []


@pytest.mark.parametrize("kind", KINDS)
def test_taps_without_any_noise_around_them_are_noted_and_not_detected(
    make_radar, make_block, make_stage, run_stage, kind
):
    samples = np.zeros((1, 50))
    samples[0, 25] = 1.0
    stage = make_stage(f"cfar.{kind}")
    assert len(run_stage(stage, make_radar(), make_block(samples)).detections) == 0
    assert len(stage.notes) == 1


@pytest.mark.parametrize("kind", KINDS)
def test_cutting_the_stream_changes_nothing(make_radar, make_block, run_cut, make_echoes, one_by_one, kind):
    block = make_block(make_echoes(30))
    found = run_cut(f"cfar.{kind}", {}, make_radar(), block, one_by_one(30)).detections
    assert len(found) > 10
    assert not np.isin(found.frame, [5, 11]).any()  # an invalid frame and one of zeros


@pytest.mark.parametrize(
    ("params", "taps", "message"),
    [
        ({}, 19, r"cfar.ca: 12 training taps and 2 guard taps on each side need 16 taps, but 15 of the 19 taps"),
        ({"skip_taps": 50}, 50, "leaves nothing to search"),
    ],
)
def test_frames_too_short_for_the_window_are_refused_in_one_message(make_radar, make_stage, params, taps, message):
    with pytest.raises(ConfigError, match=message):
        make_stage("cfar.ca", **params).open(make_radar(taps))


def test_a_threshold_below_the_noise_is_refused(make_radar, make_stage):
    stage = make_stage("cfar.os", rank=1.0, training_taps=64, false_alarm_rate=0.1)
    with pytest.raises(ConfigError, match="below the noise estimate"):
        stage.open(make_radar(200))


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ("training_taps: 7", "must be even"),
        ("false_alarm_rate: 0", "greater than or equal"),
        ("rank: 0.5", "unknown key 'rank'"),
    ],
)
def test_wrong_parameters_are_refused_when_the_detector_is_loaded(params, message):
    with pytest.raises(ConfigError, match=message):
        detector_from_yaml(f"schema: 1\nname: test\npipeline: [{{use: cfar.ca, params: {{{params}}}}}]\n")


@pytest.mark.parametrize("kind", KINDS)
def test_a_window_in_pulse_lengths_is_that_of_taps_on_a_radar_sampled_twice_a_pulse(
    make_radar, make_block, make_stage, run_stage, kind
):
    radar = make_radar(50, noise_taps=0, sample_interval_s=SAMPLE_INTERVAL_S, bandwidth_hz=499.2e6)
    block = make_block(complex_noise((200, 50), seed=3))
    in_taps = run_stage(make_stage(f"cfar.{kind}", false_alarm_rate=1e-2), radar, block).detections
    in_pulses = make_stage(f"cfar.{kind}", training_pulses=6, guard_pulses=1, false_alarm_rate=1e-2)
    np.testing.assert_array_equal(run_stage(in_pulses, radar, block).detections["tap"], in_taps["tap"])
    finer = make_radar(200, noise_taps=0, sample_interval_s=61.035e-12, bandwidth_hz=1.7e9)
    assert in_pulses.params.window_for(finer) == (29, 10)


def test_a_window_in_taps_and_in_pulse_lengths_at_once_is_refused(make_stage):
    with pytest.raises(ValueError, match="guard_taps or guard_pulses, not both"):
        make_stage("cfar.ca", guard_taps=2, guard_pulses=1)
