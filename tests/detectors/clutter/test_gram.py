"""Dominant shapes from the small matrix of products: the same as of the window itself, or refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench_detectors.clutter.gram import enter_frame, refine
from uwbbench_detectors.clutter.svd import TOLERANCE

FRAMES, TAPS = 20, 30
ANGLE = TOLERANCE / np.sqrt(TAPS)


def entered(window, order=None):
    """Window, its transpose and its products, as entering the rows in some order leaves them."""
    frames, taps = window.shape
    parts = (np.zeros((frames, taps), complex), np.zeros((taps, frames), complex), np.zeros((frames, frames), complex))
    for slot in range(frames) if order is None else order:
        enter_frame(np.ascontiguousarray(window[slot], dtype=complex), slot, *parts)
    return parts


def unitary(rng, rows, columns):
    return np.linalg.qr(rng.normal(size=(rows, columns)) + 1j * rng.normal(size=(rows, columns)))[0]


def window_with(singular, seed=0):
    """A window of given singular values, and its right singular vectors as rows (conjugated, as in a basis)."""
    rng = np.random.default_rng(seed)
    left, right = unitary(rng, FRAMES, len(singular)), unitary(rng, TAPS, len(singular))
    return (left * singular) @ right.conj().T, np.ascontiguousarray(right.T)


def angle_between(one, other):
    """Sine of the largest angle between the spans of orthonormal rows."""
    rest = one - (one @ other.conj().T) @ other
    return np.linalg.norm(rest, 2)


def near(shapes, distance, seed=1):
    """Orthonormal rows at about this distance from the given ones."""
    rng = np.random.default_rng(seed)
    off = rng.normal(size=shapes.shape) + 1j * rng.normal(size=shapes.shape)
    return np.ascontiguousarray(np.linalg.qr((shapes + distance * off / np.linalg.norm(off)).T)[0].T)


def test_replacing_rows_leaves_no_trace_of_earlier_ones_in_the_products():
    rng = np.random.default_rng(0)
    window = rng.normal(size=(FRAMES, TAPS)) + 1j * rng.normal(size=(FRAMES, TAPS))
    expected = entered(window)
    used = entered(1e12 * window[::-1])
    for slot in rng.permutation(FRAMES):
        enter_frame(window[slot], slot, *used)
    for fresh, renewed in zip(expected, used, strict=True):
        np.testing.assert_array_equal(renewed, fresh)
    np.testing.assert_allclose(expected[2], window @ window.conj().T, rtol=1e-12, atol=1e-12)


@settings(max_examples=150, deadline=None)
@given(
    rank=st.integers(1, 3),
    decades=st.lists(st.floats(-6, 0), min_size=6, max_size=6),
    floor=st.floats(-12, -1),
    scale=st.floats(-60, 60),
    distance=st.floats(-12, 0),
    seed=st.integers(0, 1000),
)
def test_shapes_that_are_accepted_are_the_dominant_ones(rank, decades, floor, scale, distance, seed):
    strong = np.sort(10.0 ** np.array(decades))[::-1]
    singular = np.concatenate([strong, np.full(8, 10.0**floor * strong[0])])
    window, right = window_with(np.sort(singular)[::-1] * 10.0**scale, seed)
    true = np.ascontiguousarray(np.linalg.svd(window, full_matrices=False)[2][:rank].conj())
    shapes = near(right[:rank], 10.0**distance, seed)
    before = shapes.copy()
    x, turned, gram = entered(window)
    if refine(gram, x, turned, shapes, ANGLE):
        assert angle_between(shapes, true) <= ANGLE
        np.testing.assert_allclose(shapes @ shapes.conj().T, np.eye(rank), atol=1e-14)
    else:
        np.testing.assert_array_equal(shapes, before)


@pytest.mark.parametrize("distance", [1e-6, 1e-2, 0.5])
@pytest.mark.parametrize(
    "singular", [[1.0], [1.0, 0.3], [1.0, 0.6, 0.1], [1.0] + [0.05] * 15, [1.0, 1e-9, 1e-12], [1e-30, 1e-32]]
)
def test_a_shape_that_stands_out_is_found(singular, distance):
    window, right = window_with(singular)
    shapes = near(right[:1], distance)
    x, turned, gram = entered(window)
    assert refine(gram, x, turned, shapes, ANGLE)
    assert angle_between(shapes, right[:1]) <= ANGLE


def test_three_shapes_of_like_height_are_found_together():
    window, right = window_with([1.0, 0.99, 0.9, 0.02, 0.01])
    shapes = near(right[:3], 0.1)
    x, turned, gram = entered(window)
    assert refine(gram, x, turned, shapes, ANGLE)
    assert angle_between(shapes, right[:3]) <= ANGLE


@pytest.mark.parametrize(
    ("singular", "rank"),
    [
        ([1.0, 1.0], 1),
        ([1.0, 1.0 - 1e-9, 0.1], 1),
        ([1.0, 0.5, 0.5], 2),
        ([1.0, 1e-7, 1e-9], 2),
        ([1.0], 2),
        ([1e-160, 1e-161], 1),
        ([1e160, 1e159], 1),
        ([0.0], 1),
    ],
)
def test_shapes_that_the_products_cannot_tell_are_refused(singular, rank):
    window, _ = window_with(singular)
    shapes = near(unitary(np.random.default_rng(2), TAPS, rank).T, 0)
    with np.errstate(over="ignore", invalid="ignore"):
        x, turned, gram = entered(window)
    assert not refine(gram, x, turned, shapes, ANGLE)


def test_a_lesser_shape_is_not_taken_for_the_dominant_one():
    window, right = window_with([1.0, 0.8, 0.1])
    shapes = right[1:2].copy()  # where the iteration stands still with no residual at all
    x, turned, gram = entered(window)
    assert not refine(gram, x, turned, shapes, ANGLE)


def by_definition(samples, frames, rank):
    """Each frame less its projection on the leading right singular vectors of numpy's SVD of its window."""
    out = np.zeros_like(samples)
    for k in range(rank, len(samples)):
        shapes = np.linalg.svd(samples[max(0, k - frames + 1) : k + 1], full_matrices=False)[2][:rank]
        out[k] = samples[k] - samples[k] @ shapes.conj().T @ shapes
    return out


@pytest.mark.parametrize("rank", [1, 2, 3])
@pytest.mark.parametrize("kind", ["echoes", "bursts", "noise", "overtaking"])
def test_cleaned_frames_are_those_of_the_full_decomposition(
    kind, rank, make_radar, make_block, make_stage, make_echoes, run_stage
):
    rng = np.random.default_rng(3)
    samples = make_echoes(120)
    samples = samples[np.isfinite(samples).all(axis=1) & samples.any(axis=1)]
    if kind == "bursts":
        samples *= 10.0 ** rng.integers(-3, 4, (len(samples), 1))
    if kind == "noise":
        samples = rng.normal(size=samples.shape) + 1j * rng.normal(size=samples.shape)
    if kind == "overtaking":  # an echo grows and becomes the first shape itself
        echo = np.exp(-((np.arange(50) - 30) ** 2) / 3)
        samples += np.outer(np.linspace(0, 3, len(samples)) * np.exp(1j * rng.normal(size=len(samples))), echo)
    stage = make_stage("clutter.svd", window_frames=32, rank=rank)
    cleaned = run_stage(stage, make_radar(), make_block(samples)).frames.preamble
    error = np.abs(cleaned - by_definition(samples, 32, rank)).max(axis=1)
    assert (error <= TOLERANCE * np.abs(samples).max(axis=1)).all()


def test_frames_of_a_radar_that_moves_are_decomposed_through_the_products(
    make_radar, make_block, make_stage, make_echoes, run_stage, monkeypatch
):
    decomposed = []
    import uwbbench_detectors.clutter.svd as module

    full = module.dominant_shapes
    monkeypatch.setattr(module, "dominant_shapes", lambda *given: decomposed.append(1) or full(*given))
    run_stage(make_stage("clutter.svd"), make_radar(), make_block(make_echoes(200)))
    assert len(decomposed) <= 5
