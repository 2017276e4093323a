"""Low-rank clutter removal."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from uwbbench.api import ConfigError
from uwbbench_detectors.clutter.svd import dominant_shapes

FRAMES = 40
CONFIGS = [
    {"window_frames": 8},
    {"window_frames": 60},
    {"window_frames": 8, "rank": 3, "every": 5},
    {"window_frames": 12, "rank": None, "energy": 0.9, "every": 3},
]
every_config = pytest.mark.parametrize("params", CONFIGS)


@every_config
@settings(max_examples=10, deadline=None)
@given(cuts=st.lists(st.integers(0, FRAMES), max_size=8))
def test_any_cut_into_blocks_gives_the_same_bits(params, cuts, make_radar, make_block, make_echoes, run_cut):
    run_cut("clutter.svd", params, make_radar(), make_block(make_echoes(FRAMES)), cuts)


@every_config
def test_one_frame_a_block_gives_the_same_bits(params, make_radar, make_block, make_echoes, run_cut, one_by_one):
    run_cut("clutter.svd", params, make_radar(), make_block(make_echoes(FRAMES)), one_by_one(FRAMES))


def _by_definition(samples, window, rank):
    """Each frame less its projection on the leading right singular vectors of numpy's SVD of its window."""
    out = np.zeros_like(samples)
    for k in range(rank, len(samples)):
        part = samples[max(0, k - window + 1) : k + 1]
        shapes = np.linalg.svd(part, full_matrices=False)[2][:rank]
        out[k] = samples[k] - samples[k] @ shapes.conj().T @ shapes
    return out


@settings(max_examples=25, deadline=None)
@given(window=st.integers(4, 30), rank=st.integers(1, 3), taps=st.integers(5, 25), seed=st.integers(0, 1000))
def test_output_is_the_frame_less_its_projection(
    window, rank, taps, seed, make_radar, make_block, make_stage, run_stage
):
    rng = np.random.default_rng(seed)
    samples = rng.normal(size=(35, taps)) + 1j * rng.normal(size=(35, taps))
    samples += np.outer(rng.normal(size=35), 5 * rng.normal(size=taps))
    stage = make_stage("clutter.svd", window_frames=window, rank=rank)
    cleaned = run_stage(stage, make_radar(taps=taps), make_block(samples)).frames.preamble
    np.testing.assert_allclose(cleaned, _by_definition(samples, window, rank), atol=1e-9)


@pytest.mark.parametrize("shape", [(12, 40), (40, 12), (20, 20)])
def test_singular_values_survive_below_the_square_root_of_the_rounding_error(shape):
    rng = np.random.default_rng(0)
    smaller = min(shape)
    left = np.linalg.qr(rng.normal(size=(shape[0], smaller)) + 1j * rng.normal(size=(shape[0], smaller)))[0]
    right = np.linalg.qr(rng.normal(size=(shape[1], smaller)) + 1j * rng.normal(size=(shape[1], smaller)))[0]
    wanted = 10.0 ** -np.arange(smaller)  # a Gram matrix loses all below 1e-8
    singular, shapes = dominant_shapes((left * wanted) @ right.conj().T, 10)
    np.testing.assert_allclose(singular[:11] / singular[0], wanted[:11], rtol=1e-4)
    np.testing.assert_allclose(shapes.conj().T @ shapes, np.eye(10), atol=1e-12)
    np.testing.assert_allclose(np.abs(np.sum(right[:, :10].conj() * shapes, axis=0)), 1, atol=1e-6)


def test_vectors_of_the_null_space_are_left_out():
    window = np.outer(np.arange(1, 9), np.arange(1, 6) + 1j)
    for part in (window, window.conj().T):
        assert dominant_shapes(part, 3)[1].shape[1] == 1


def test_rank_by_energy_takes_the_fewest_shapes_that_hold_it(make_radar, make_block, make_stage, run_stage):
    rng = np.random.default_rng(5)
    scene = sum(
        weight * np.outer(rng.normal(size=64) + 1j * rng.normal(size=64), np.eye(10)[tap])
        for weight, tap in ((10, 0), (8, 1), (1, 2))
    )
    radar, block = make_radar(taps=10), make_block(scene)
    results = {}
    for name, params in {
        "energy": {"rank": None, "energy": 0.95, "maximum_rank": 3},
        "capped": {"rank": None, "energy": 0.95, "maximum_rank": 1},
        "one": {"rank": 1},
        "two": {"rank": 2},
    }.items():
        stage = make_stage("clutter.svd", window_frames=64, **params)
        results[name] = run_stage(stage, radar, block).frames.preamble[-1]
    np.testing.assert_allclose(results["energy"], results["two"], atol=1e-12)
    np.testing.assert_allclose(results["capped"], results["one"], atol=1e-12)


def test_gain_and_phase_that_change_every_frame_are_followed(make_radar, make_block, make_stage, run_stage):
    rng = np.random.default_rng(6)
    tap = np.arange(50)
    direct = np.exp(-((tap - 7) ** 2) / 3) * np.exp(0.3j * tap)
    samples = rng.uniform(0.5, 2, (50, 1)) * np.exp(2j * np.pi * rng.uniform(size=(50, 1))) * direct
    cleaned = run_stage(make_stage("clutter.svd"), make_radar(), make_block(samples)).frames
    assert not cleaned.preamble.any()


def test_a_static_scene_drops_by_more_than_20_db(make_radar, make_block, make_stage, run_stage):
    rng = np.random.default_rng(7)
    scene = rng.normal(size=50) + 1j * rng.normal(size=50)
    noise = 0.01 * (rng.normal(size=(100, 50)) + 1j * rng.normal(size=(100, 50)))
    cleaned = run_stage(make_stage("clutter.svd"), make_radar(), make_block(scene + noise)).frames.preamble
    assert np.mean(np.abs(cleaned) ** 2) < 0.01 * np.mean(np.abs(scene) ** 2)


@pytest.mark.parametrize("params", [{"rank": 3}, {"rank": None, "energy": 0.5, "maximum_rank": 3}])
def test_frames_are_zero_until_the_window_exceeds_the_rank(
    params, make_radar, make_block, make_stage, make_echoes, run_stage
):
    stage = make_stage("clutter.svd", **params)
    cleaned = run_stage(stage, make_radar(), make_block(make_echoes(10))).frames.preamble
    assert not cleaned[:3].any()
    assert cleaned[3:].any(axis=1).all()


def test_basis_is_renewed_by_frame_index_not_by_block(make_radar, make_block, make_stage, make_echoes, run_stage):
    samples = make_echoes(20)
    stage = make_stage("clutter.svd", window_frames=6, every=4)
    cleaned = run_stage(stage, make_radar(), make_block(samples, first=102)).frames.preamble
    # Frames 104 to 107 (rows 2 to 5) share the basis that row 2 found.
    window = samples[:3]
    shape = np.linalg.svd(window, full_matrices=False)[2][:1]
    np.testing.assert_allclose(cleaned[4], samples[4] - samples[4] @ shape.conj().T @ shape, atol=1e-12)


@every_config
def test_invalid_and_empty_frames_leave_no_trace(params, make_radar, make_block, make_stage, make_echoes, run_stage):
    if params.get("every", 1) > 1:
        params = {**params, "every": 1}  # the schedule counts all frames of the capture
    samples = make_echoes(FRAMES)
    blank = ~np.isfinite(samples).all(axis=1) | ~samples.any(axis=1)
    with_gaps = run_stage(make_stage("clutter.svd", **params), make_radar(), make_block(samples)).frames.preamble
    without = run_stage(make_stage("clutter.svd", **params), make_radar(), make_block(samples[~blank])).frames
    np.testing.assert_array_equal(with_gaps[~blank], without.preamble)
    assert not with_gaps[blank].any()


@every_config
@pytest.mark.parametrize("scene", [np.zeros((30, 20)), np.ones((30, 20)), np.eye(1, 20).repeat(30, axis=0)])
def test_zero_and_rank_deficient_windows_become_zero(params, scene, make_radar, make_block, make_stage, run_stage):
    cleaned = run_stage(make_stage("clutter.svd", **params), make_radar(taps=20), make_block(scene))
    assert not cleaned.frames.preamble.any()


@pytest.mark.parametrize("frames", [0, 1])
def test_captures_of_no_frame_and_of_one_pass(frames, make_radar, make_block, make_stage, make_echoes, run_stage):
    block = make_block(make_echoes(1)[:frames])
    cleaned = run_stage(make_stage("clutter.svd"), make_radar(), block).frames.preamble
    assert cleaned.shape == (frames, 50)
    assert not cleaned.any()


@pytest.mark.parametrize("scale", [1e-150, 1e150])
def test_extreme_amplitudes_scale_the_result(scale, make_radar, make_block, make_stage, make_echoes, run_stage):
    samples = make_echoes(20)
    plain, scaled = (
        run_stage(make_stage("clutter.svd", rank=2), make_radar(), make_block(s)).frames.preamble
        for s in (samples, samples * scale)
    )
    np.testing.assert_allclose(scaled / scale, plain, atol=1e-12)


def test_a_rank_that_fills_the_window_is_refused(make_stage):
    with pytest.raises(ValidationError, match="must be smaller than 'window_frames'"):
        make_stage("clutter.svd", window_frames=4, rank=4)


def test_a_rank_that_fills_the_frame_is_refused(make_radar, make_stage):
    with pytest.raises(ConfigError, match="leaves nothing of frames of 5 taps"):
        make_stage("clutter.svd", rank=5).open(make_radar(taps=5))
