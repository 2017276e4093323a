"""Captures in memory: validity marks, analytic samples, blocks and the checks on construction."""

import dataclasses

import numpy as np
import pytest
import scipy.signal
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api import Capture, CaptureError, Obstacle, Radar, Trajectory, Truth, analytic, magnitude
from uwbbench.api.frames import Frames


def capture_of(preamble, samples="iq", **parts) -> Capture:
    frames = len(preamble)
    radar = Radar("test", 8e9, 5e8, 1e-9, 50.0, taps=preamble.shape[1], samples=samples, has_sts="sts1" in parts)
    track = Trajectory(np.arange(frames) / 50.0, np.zeros((frames, 3)), np.zeros(frames))
    return Capture(**{"name": "run", "radar": radar, "trajectory": track, "preamble": preamble, **parts})


def noise(frames, taps, seed=0):
    rng = np.random.default_rng(seed)
    return (rng.normal(size=(frames, taps)) + 1j * rng.normal(size=(frames, taps))).astype(np.complex64)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, complex(0, np.nan), complex(0, np.inf)])
@pytest.mark.parametrize("where", ["preamble", "sts1", "sts2"])
def test_a_frame_with_a_sample_that_is_not_finite_is_marked_invalid(where, bad):
    parts = {name: noise(5, 8) for name in ("preamble", "sts1", "sts2")}
    parts[where][2, 3] = bad
    frames = capture_of(**parts).frames()
    assert frames.valid.tolist() == [True, True, False, True, True]


def test_without_sts_validity_judges_the_preamble_alone():
    parts = {name: noise(5, 8) for name in ("preamble", "sts1", "sts2")}
    parts["preamble"][1, 0] = parts["sts1"][3, 0] = np.nan
    frames = capture_of(**parts).frames(sts=False)
    assert (frames.sts1, frames.sts2) == (None, None)
    assert frames.valid.tolist() == [True, False, True, True, True]


def test_blocks_without_sts_leave_it_unread():
    class Unread:
        shape = (5, 8)

        def __getitem__(self, key, /):
            raise AssertionError("read")

    capture = capture_of(noise(5, 8), sts1=Unread(), sts2=Unread())
    assert [frames.sts1 for frames in capture.blocks(2, sts=False)] == [None, None, None]
    with pytest.raises(AssertionError, match="read"):
        next(capture.blocks(2))


@settings(max_examples=50, deadline=None)
@given(st.data())
def test_the_validity_marks_are_those_of_isfinite(data):
    samples = noise(6, 7).astype(data.draw(st.sampled_from([np.complex64, np.complex128])))
    for _ in range(data.draw(st.integers(0, 3))):
        row, tap = data.draw(st.integers(0, 5)), data.draw(st.integers(0, 6))
        samples[row, tap] = data.draw(st.sampled_from([np.nan, np.inf, complex(0, -np.inf), 3e38, 0]))
    frames = capture_of(samples).frames()
    np.testing.assert_array_equal(frames.valid, np.isfinite(samples).all(axis=1))


@pytest.mark.parametrize("samples", [noise(12, 8)[::2], noise(8, 12).T, noise(6, 16)[:, ::2]])
def test_samples_of_any_layout_come_as_frames_in_one_piece(samples):
    found = capture_of(samples).frames(1, 5).preamble
    assert found.flags.c_contiguous
    np.testing.assert_array_equal(found, samples[1:5])


def test_samples_in_memory_are_not_copied():
    samples = noise(6, 8)
    assert np.shares_memory(capture_of(samples).frames(2, 4).preamble, samples)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_bad_rf_sample_marks_its_frame_alone(bad):
    real = noise(4, 16).real.copy()
    expected = capture_of(real, "rf").frames().preamble
    real[1, 5] = bad
    frames = capture_of(real, "rf").frames()
    assert frames.valid.tolist() == [True, False, True, True]
    np.testing.assert_array_equal(frames.preamble[[0, 2, 3]], expected[[0, 2, 3]])


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 70), st.integers(0, 2**31))
def test_rf_samples_become_the_analytic_signal_of_scipy(taps, seed):
    real = np.random.default_rng(seed).normal(size=(3, taps))
    np.testing.assert_allclose(analytic(real), scipy.signal.hilbert(real, axis=-1), atol=1e-12)


def test_frames_of_rf_are_complex_and_keep_the_samples_as_real_part():
    real = noise(3, 33).real
    frames = capture_of(real, "rf").frames()
    np.testing.assert_allclose(frames.preamble.real, real, atol=1e-6)
    np.testing.assert_allclose(frames.preamble, scipy.signal.hilbert(real.astype(float), axis=1), atol=1e-6)


@pytest.mark.parametrize("size", [1, 3, 7, 100])
def test_blocks_of_any_size_join_to_the_whole(size):
    capture = capture_of(noise(10, 4))
    joined = Frames.join(list(capture.blocks(size)))
    np.testing.assert_array_equal(joined.preamble, capture.preamble)
    np.testing.assert_array_equal(joined.index, np.arange(10))


def test_an_empty_capture_has_no_blocks_and_no_duration():
    capture = capture_of(noise(0, 4))
    assert list(capture.blocks(5)) == []
    assert (len(capture), capture.duration_s, len(capture.frames())) == (0, 0.0, 0)


def test_a_block_of_no_frames_is_refused():
    with pytest.raises(ValueError, match="at least one frame"):
        next(capture_of(noise(1, 4)).blocks(0))


def test_a_part_of_frames_knows_where_it_came_from():
    part = capture_of(noise(10, 4)).frames(2, 9).part(1, 3)
    assert part.index.tolist() == [3, 4]


def test_the_magnitude_of_equal_powers_is_equal():
    """3^2 + 4^2 = 5^2 + 0^2, and the like, for every pair of integers."""
    i, q = np.meshgrid(np.arange(120), np.arange(120))
    power = i * i + q * q
    found = magnitude((i + 1j * q).astype(np.complex64))
    for value in np.unique(power):
        assert len(np.unique(found[power == value])) == 1


def test_the_hash_changes_with_samples_poses_radar_and_truth_and_not_with_the_name():
    capture = capture_of(noise(4, 4))
    other = capture.preamble.copy()
    other[1, 1] += 1
    turned = dataclasses.replace(capture.trajectory, yaw_rad=np.ones(4))
    truth = Truth((Obstacle("a", "metal", np.zeros((1, 2))),))
    variants = [
        capture,
        dataclasses.replace(capture, preamble=other),
        dataclasses.replace(capture, trajectory=turned),
        dataclasses.replace(capture, radar=dataclasses.replace(capture.radar, channel=9)),
        dataclasses.replace(capture, truth=truth),
        dataclasses.replace(capture, truth=dataclasses.replace(truth, exhaustive=False)),
    ]
    assert len({variant.sha256 for variant in variants}) == len(variants)
    assert dataclasses.replace(capture, name="other").sha256 == capture.sha256


def bad(message, **parts):
    return pytest.param(parts, message, id=message)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        bad(r"samples have shape \(frames, taps\)", preamble=np.zeros(4, np.complex64)),
        bad("frames have 5 taps, the radar says 4", preamble=noise(6, 5)),
        bad("one STS response without the other", sts1=noise(6, 4)),
        bad("sts1 has shape", sts1=noise(6, 3), sts2=noise(6, 4)),
        bad("has_sts disagrees", sts1=noise(6, 4), sts2=noise(6, 4)),
        bad("has_first_path disagrees", first_path_index=np.zeros(6)),
        bad("'odometry_yaw_rad': 5", odometry_yaw_rad=np.zeros(5)),
        bad("'position_m': 5", trajectory=Trajectory(np.arange(6.0), np.zeros((5, 3)), np.zeros(6))),
        bad(
            "frame 3 breaks that",
            trajectory=Trajectory(np.array([0, 1, 2, 1, 3, 4.0]), np.zeros((6, 3)), np.zeros(6)),
        ),
        bad("outline of 'a'", truth=Truth((Obstacle("a", "m", np.zeros((5, 1, 2))),))),
    ],
)
def test_parts_that_do_not_fit_together_are_refused(parts, message):
    with pytest.raises(CaptureError, match=message):
        dataclasses.replace(capture_of(noise(6, 4)), **parts)


@pytest.mark.parametrize(
    ("name", "value"),
    [("sample_interval_s", 0.0), ("bandwidth_hz", -1.0), ("frame_rate_hz", np.inf), ("taps", 0), ("noise_taps", 9)],
)
def test_a_radar_that_cannot_be_is_refused(name, value):
    with pytest.raises(CaptureError, match=name if name != "taps" else "at least one tap"):
        dataclasses.replace(Radar("test", 8e9, 5e8, 1e-9, 50.0, taps=8), **{name: value})
