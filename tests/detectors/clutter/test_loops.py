"""Compiled backgrounds against the same recursions in numpy: equal to the last bit."""

import math

import numpy as np
import pytest

EPSILON = np.finfo(float).eps
TAPS = 23


def without_rounding(residue, samples, operations):
    """Residue with what is rounding error alone set to zero."""
    bound = operations * EPSILON * np.abs(samples).max(axis=1)
    return np.where(np.abs(residue) > bound[:, None], residue, 0)


def less_mean(samples, window):
    """Sums put together from the current stretch of frames and from partial sums of the stretch before it."""
    frames = len(samples)
    stretch = window or frames
    total = np.empty_like(samples)
    for start in range(0, frames, stretch):
        stop = min(start + stretch, frames)
        total[start:stop] = np.cumsum(np.concatenate([np.zeros((1, TAPS)), samples[start:stop]]), axis=0)[1:]
        if start:
            older = np.cumsum(samples[start - stretch : start][::-1], axis=0)[::-1][1:][: stop - start]
            total[start : start + len(older)] += older
    count = np.minimum(np.arange(1, frames + 1), stretch)
    return without_rounding(samples - total / count[:, None], samples, 2 * count)


def less_exponential(samples, memory):
    gain = 1 - memory
    residue, background = np.empty_like(samples), samples[0]
    for row, frame in enumerate(samples):
        residue[row] = frame - background
        background = background + gain * residue[row]
    return without_rounding(residue, samples, math.ceil(4 / gain))


def less_selective(samples, memory, spread_memory, gate_sigmas):
    gain, share = 1 - memory, 1 - spread_memory
    residue, background, variance = np.empty_like(samples), samples[0], np.zeros(TAPS)
    for row, frame in enumerate(samples):
        residue[row] = frame - background
        power = residue[row].real ** 2 + residue[row].imag ** 2
        learns = (power <= gate_sigmas**2 * variance) | (row < math.ceil(1 / share))
        background = background + np.where(learns, gain * residue[row], 0)
        change = max(1 / (row + 1), share) * (power - variance)
        variance = np.where(learns, variance + change, variance)
    return without_rounding(residue, samples, math.ceil(4 / gain))


def scene(kind, seed):
    rng = np.random.default_rng(seed)
    samples = 1 + 0.05 * (rng.normal(size=(150, TAPS)) + 1j * rng.normal(size=(150, TAPS)))
    if kind == "wide":
        return samples * 10.0 ** rng.integers(-8, 9, samples.shape)
    if kind == "whole":
        return np.round(10 * samples)
    if kind == "nearly constant":  # within and just beyond the rounding error
        return 1 + (samples - 1) * 10.0 ** rng.uniform(-15, -11, (1, TAPS))
    return samples * 10.0 ** {"huge": 140, "tiny": -140}.get(kind, 0)


kinds = pytest.mark.parametrize("kind", ["noise", "wide", "whole", "nearly constant", "huge", "tiny"])


@kinds
@pytest.mark.parametrize("window", [None, 2, 7, 64, 150, 300])
def test_running_mean_equals_numpys_bit_by_bit(kind, window, make_radar, make_block, make_stage, run_stage):
    samples = scene(kind, seed=window or 0)
    stage = make_stage("clutter.mean", window_frames=window)
    cleaned = run_stage(stage, make_radar(TAPS), make_block(samples)).frames.preamble
    np.testing.assert_array_equal(cleaned, less_mean(samples, window))


@kinds
@pytest.mark.parametrize("memory", [0.5, 0.97])
def test_exponential_average_equals_numpys_bit_by_bit(kind, memory, make_radar, make_block, make_stage, run_stage):
    samples = scene(kind, seed=1)
    stage = make_stage("clutter.exponential", memory=memory)
    cleaned = run_stage(stage, make_radar(TAPS), make_block(samples)).frames.preamble
    np.testing.assert_array_equal(cleaned, less_exponential(samples, memory))


@kinds
@pytest.mark.parametrize("spread_memory", [0.5, 0.9])
def test_selective_average_equals_numpys_bit_by_bit(kind, spread_memory, make_radar, make_block, make_stage, run_stage):
    samples = scene(kind, seed=2)
    stage = make_stage("clutter.exponential", adaptive=True, spread_memory=spread_memory, gate_sigmas=2.0)
    cleaned = run_stage(stage, make_radar(TAPS), make_block(samples)).frames.preamble
    np.testing.assert_array_equal(cleaned, less_selective(samples, 0.97, spread_memory, 2.0))


def test_frames_in_single_precision_and_in_any_layout_give_the_same(make_radar, make_block, make_stage):
    samples = scene("noise", seed=3).astype(np.complex64)
    results = []
    for given in (samples, np.asfortranarray(samples), samples.astype(complex)):
        block = make_block(samples)
        stage = make_stage("clutter.exponential")
        stage.open(make_radar(TAPS))
        results.append(stage.step(block.replace(frames=block.frames.with_preamble(given))).frames.preamble)
    np.testing.assert_array_equal(results[0], results[1])
    np.testing.assert_array_equal(results[0], results[2])
