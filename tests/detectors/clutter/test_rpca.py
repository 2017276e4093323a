"""Clutter removal by robust principal component analysis."""

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from uwbbench_detectors.clutter.rpca import robust_parts

PARAMS = {"window_frames": 24, "every": 8}


@pytest.fixture(autouse=True)
def one_thread():
    with threadpool_limits(1):  # threads only contend over matrices as small as these
        yield


def _complex(shape, seed=0):
    parts = np.random.default_rng(seed).normal(size=(2, *shape))
    return parts[0] + 1j * parts[1]


@pytest.mark.parametrize("shape", [(24, 40), (40, 24)])
def test_the_parts_add_up_to_the_window_to_one_in_ten_million(shape):
    window = 30 * _complex((shape[0], 1)) * _complex((1, shape[1]), 1) + _complex(shape, 2)
    low_rank, sparse = robust_parts(window)
    assert np.linalg.norm(low_rank + sparse - window) <= 1.01e-7 * np.linalg.norm(window)


def test_low_rank_and_sparse_parts_are_found_again():
    true_low = _complex((40, 2)) @ _complex((2, 40), 1)
    true_sparse = np.where(np.random.default_rng(2).uniform(size=(40, 40)) < 0.05, 10 * _complex((40, 40), 3), 0)
    low_rank, sparse = robust_parts(true_low + true_sparse)
    assert np.linalg.norm(low_rank - true_low) <= 1e-5 * np.linalg.norm(true_low)
    assert np.linalg.norm(sparse - true_sparse) <= 1e-5 * np.linalg.norm(true_sparse)


def test_parts_scale_with_the_window():
    window = _complex((16, 20)) + 5
    for factor in (1e-150, 1e150):
        np.testing.assert_allclose(robust_parts(window * factor)[1], robust_parts(window)[1] * factor, rtol=1e-9)


def test_frames_of_one_shape_become_exactly_zero(make_radar, make_block, make_stage, run_stage):
    samples = _complex((64, 1), 4) * _complex((1, 50), 5)
    cleaned = run_stage(make_stage("clutter.rpca"), make_radar(), make_block(samples)).frames.preamble
    assert not cleaned.any()


def test_of_a_scene_that_stands_still_less_than_a_hundredth_is_left(make_radar, make_block, make_stage, run_stage):
    tap = np.arange(50)
    scene = np.exp(-((tap - 7.2) ** 2) / 3) + 0.1j * np.exp(-((tap - 30) ** 2) / 3)
    samples = scene + 0.003 * _complex((64, 50), 6)
    cleaned = run_stage(make_stage("clutter.rpca"), make_radar(), make_block(samples)).frames.preamble
    assert 20 * np.log10(np.linalg.norm(cleaned) / np.linalg.norm(samples)) < -20


def test_what_moves_stays_even_where_it_outshines_the_clutter(make_radar, make_block, make_stage, run_stage):
    tap, place = np.arange(50), 15 + 0.3 * np.arange(80)[:, None]
    echo = 3 * np.exp(-((tap - place) ** 2) / 3) * np.exp(2j * place)
    samples = np.exp(-((tap - 7) ** 2) / 3) + echo + 1e-3 * _complex((80, 50), 7)
    cleaned = run_stage(make_stage("clutter.rpca"), make_radar(), make_block(samples)).frames.amplitude
    assert np.abs(cleaned.argmax(axis=1) - place[:, 0]).max() <= 1
    assert cleaned[:, 5:9].max() < 0.05


def test_any_cut_into_blocks_gives_the_same_bits(make_radar, make_block, make_echoes, run_cut, one_by_one):
    block = make_block(make_echoes(60))
    for cuts in (one_by_one(60), [7, 7, 50]):
        run_cut("clutter.rpca", PARAMS, make_radar(), block, cuts)


def test_frames_come_out_window_by_window(make_radar, make_block, make_stage, make_echoes):
    stage = make_stage("clutter.rpca", **PARAMS)
    stage.open(make_radar())
    block = make_block(np.nan_to_num(make_echoes(44)) + 1e-9)
    out = [len(stage.step(block.cut(k, k + 1)).frames) for k in range(44)]
    assert [(k, count) for k, count in enumerate(out) if count] == [(23, 24), (31, 8), (39, 8)]
    assert len(stage.flush().frames) == 4


def test_invalid_and_empty_frames_leave_no_trace(make_radar, make_block, make_stage, make_echoes, run_stage):
    samples = make_echoes(60)
    blank = ~np.isfinite(samples).all(axis=1) | ~samples.any(axis=1)
    with_gaps, without = (
        run_stage(make_stage("clutter.rpca", **PARAMS), make_radar(), make_block(given)).frames.preamble
        for given in (samples, samples[~blank])
    )
    np.testing.assert_array_equal(with_gaps[~blank], without)
    assert not with_gaps[blank].any()


def test_frames_without_a_signal_are_not_held_back(make_radar, make_block, make_stage):
    stage = make_stage("clutter.rpca")
    stage.open(make_radar())
    assert len(stage.step(make_block(np.zeros((30, 50)))).frames) == 30


@pytest.mark.parametrize(("frames", "note"), [(20, "20 usable frames for a window of 64"), (9, "they yield nothing")])
def test_a_window_longer_than_the_capture_is_said(frames, note, make_radar, make_block, make_stage, run_stage):
    stage = make_stage("clutter.rpca")
    cleaned = run_stage(stage, make_radar(), make_block(_complex((frames, 50)))).frames.preamble
    assert note in stage.notes[0]
    assert cleaned.any() == (frames >= 16)


def test_windows_must_overlap_or_touch(make_stage):
    with pytest.raises(ValueError, match="must hold all of them"):
        make_stage("clutter.rpca", window_frames=16, every=17)
