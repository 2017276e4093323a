"""Mean, exponential and template clutter removal."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

FRAMES = 60
CONFIGS = [
    ("clutter.mean", {}),
    ("clutter.mean", {"window_frames": 7}),
    ("clutter.exponential", {}),
    ("clutter.exponential", {"adaptive": True}),
    ("clutter.template", {"frames": 12}),
    ("clutter.template", {"frames": 12, "span_ns": None}),
]
every_config = pytest.mark.parametrize(("name", "params"), CONFIGS)


def _one_frame():
    parts = np.random.default_rng(1).normal(size=(2, 50))
    return parts[0] + 1j * parts[1]


@every_config
@settings(max_examples=15, deadline=None)
@given(cuts=st.lists(st.integers(0, FRAMES), max_size=8))
def test_any_cut_into_blocks_gives_the_same_bits(name, params, cuts, make_radar, make_block, make_echoes, run_cut):
    run_cut(name, params, make_radar(), make_block(make_echoes(FRAMES)), cuts)


@every_config
@pytest.mark.parametrize("frames", [FRAMES, 800])  # numpy computes large arrays in other ways than small ones
def test_one_frame_a_block_gives_the_same_bits(
    name, params, frames, make_radar, make_block, make_echoes, run_cut, one_by_one
):
    run_cut(name, params, make_radar(), make_block(make_echoes(frames)), one_by_one(frames))


@every_config
def test_invalid_and_empty_frames_leave_no_trace(
    name, params, make_radar, make_block, make_stage, make_echoes, run_stage
):
    samples = make_echoes(FRAMES)
    blank = ~np.isfinite(samples).all(axis=1) | ~samples.any(axis=1)
    assert blank.sum() == 2
    with_gaps = run_stage(make_stage(name, **params), make_radar(), make_block(samples)).frames.preamble
    without = run_stage(make_stage(name, **params), make_radar(), make_block(samples[~blank])).frames.preamble
    np.testing.assert_array_equal(with_gaps[~blank], without)
    assert not with_gaps[blank].any()


@every_config
def test_frames_that_do_not_change_become_exactly_zero(name, params, make_radar, make_block, make_stage, run_stage):
    cleaned = run_stage(make_stage(name, **params), make_radar(), make_block(np.tile(_one_frame(), (40, 1))))
    assert not cleaned.frames.preamble.any()


@every_config
def test_a_capture_of_one_frame_becomes_zero(name, params, make_radar, make_block, make_stage, run_stage):
    cleaned = run_stage(make_stage(name, **params), make_radar(), make_block(_one_frame()[None]))
    assert cleaned.frames.preamble.shape == (1, 50)
    assert not cleaned.frames.preamble.any()


@every_config
def test_a_capture_without_frames_passes(name, params, make_radar, make_block, make_stage, run_stage):
    assert len(run_stage(make_stage(name, **params), make_radar(), make_block(np.zeros((0, 50)))).frames) == 0


@every_config
def test_input_is_left_as_it_was(name, params, make_radar, make_block, make_stage, make_echoes, run_stage):
    block = make_block(make_echoes(FRAMES))
    before = block.frames.preamble.copy()
    run_stage(make_stage(name, **params), make_radar(), block)
    np.testing.assert_array_equal(block.frames.preamble, before)


@settings(max_examples=30, deadline=None)
@given(window=st.one_of(st.none(), st.integers(2, 40)), frames=st.integers(1, 50), seed=st.integers(0, 1000))
def test_mean_equals_the_plain_mean_of_each_window(window, frames, seed, make_radar, make_block, make_stage, run_stage):
    rng = np.random.default_rng(seed)
    samples = rng.normal(size=(frames, 6)) + 1j * rng.normal(size=(frames, 6))
    stage = make_stage("clutter.mean", window_frames=window)
    cleaned = run_stage(stage, make_radar(taps=6), make_block(samples)).frames.preamble
    expected = [
        samples[k] - samples[0 if window is None else max(0, k - window + 1) : k + 1].mean(axis=0)
        for k in range(frames)
    ]
    np.testing.assert_allclose(cleaned, expected, rtol=0, atol=1e-12)


def test_windowed_mean_forgets_a_strong_frame_to_the_last_digit(
    make_radar, make_block, make_stage, make_echoes, run_stage
):
    samples = np.random.default_rng(0).normal(size=(300, 6)).astype(complex)
    spoiled = samples.copy()
    spoiled[20] = 1e12
    runs = [
        run_stage(make_stage("clutter.mean", window_frames=16), make_radar(taps=6), make_block(s)).frames.preamble
        for s in (samples, spoiled)
    ]
    np.testing.assert_array_equal(runs[0][36:], runs[1][36:])


def test_mean_keeps_a_moving_echo_and_drops_the_direct_path(make_radar, make_block, make_stage, run_stage):
    tap = np.arange(50)
    place = np.linspace(15, 45, 100)
    echo = 0.1 * np.exp(-((tap - place[:, None]) ** 2) / 3)
    direct = np.exp(-((tap - 7) ** 2) / 3)
    cleaned = run_stage(make_stage("clutter.mean"), make_radar(), make_block(direct + echo)).frames.amplitude
    assert cleaned[50:, 5:10].max() < 1e-3
    np.testing.assert_allclose(cleaned[50:].max(axis=1), 0.1, rtol=0.2)


@pytest.mark.parametrize("memory", [0.5, 0.97])
def test_exponential_equals_scipys_recursive_filter(memory, make_radar, make_block, make_stage, make_echoes, run_stage):
    samples = np.random.default_rng(3).normal(size=(200, 50)) + 1j
    background, _ = lfilter([1 - memory], [1, -memory], samples, axis=0, zi=memory * samples[:1])
    cleaned = run_stage(make_stage("clutter.exponential", memory=memory), make_radar(), make_block(samples))
    np.testing.assert_allclose(cleaned.frames.preamble[1:], samples[1:] - background[:-1], atol=1e-13)


def test_exponential_leaves_no_rounding_errors_of_a_tap_that_stays(make_radar, make_block, make_stage, run_stage):
    rng = np.random.default_rng(4)
    samples = rng.normal(size=(200, 6)) + 1j * rng.normal(size=(200, 6))
    samples[:, 3] = 1 + rng.integers(-1, 2, 200) * np.finfo(float).eps
    cleaned = run_stage(make_stage("clutter.exponential"), make_radar(taps=6), make_block(samples)).frames.preamble
    assert not cleaned[:, 3].any()
    assert np.delete(cleaned, 3, axis=1)[1:].all()


def _arrival(rng):
    """Fixed clutter and noise; from frame 100 on an echo stands at tap 30."""
    samples = 1 + 0.01 * (rng.normal(size=(400, 50)) + 1j * rng.normal(size=(400, 50)))
    samples[100:, 30] += 0.2
    return samples


def test_plain_exponential_learns_an_echo_that_stays_and_adaptive_does_not(
    make_radar, make_block, make_stage, run_stage
):
    samples = _arrival(np.random.default_rng(0))
    left = {
        adaptive: run_stage(make_stage("clutter.exponential", adaptive=adaptive), make_radar(), make_block(samples))
        .frames.amplitude[350:, 30]
        .mean()
        for adaptive in (False, True)
    }
    assert left[False] < 0.05
    assert left[True] == pytest.approx(0.2, abs=0.02)


def test_adaptive_exponential_updates_nearly_all_taps_of_white_noise(make_radar, make_block, make_stage, run_stage):
    rng = np.random.default_rng(2)
    drift = np.linspace(0, 0.05, 2000)[:, None]  # slower than the noise: followed only if taps keep being updated
    samples = 1 + drift + 0.01 * (rng.normal(size=(2000, 50)) + 1j * rng.normal(size=(2000, 50)))
    stage = make_stage("clutter.exponential", adaptive=True)
    residue = run_stage(stage, make_radar(), make_block(samples)).frames.preamble[1900:]
    assert np.abs(residue.mean(axis=0)).max() < 0.01


@settings(max_examples=20, deadline=None)
@given(gain=st.floats(1e-3, 1e3), phase=st.floats(-np.pi, np.pi))
def test_template_removes_any_gain_and_phase_of_the_direct_path(
    gain, phase, make_radar, make_block, make_stage, run_stage
):
    tap = np.arange(50)
    direct = np.exp(-((tap - 7) ** 2) / 3) * (1 + 0.5j)
    echo = 0.1 * np.exp(-((tap - 30) ** 2) / 3)
    scene = np.concatenate([np.tile(direct, (5, 1)), [gain * np.exp(1j * phase) * direct + echo]])
    cleaned = run_stage(make_stage("clutter.template", frames=5), make_radar(), make_block(scene)).frames.preamble
    np.testing.assert_allclose(cleaned[5], echo, atol=1e-12 * max(gain, 1))


def test_template_gain_is_the_least_squares_one_over_the_span(make_radar, make_block, make_stage, run_stage):
    rng = np.random.default_rng(4)
    samples = rng.normal(size=(8, 50)) + 1j * rng.normal(size=(8, 50))
    samples[:5, 20] += 10
    template = samples[:5].mean(axis=0)
    cleaned = run_stage(make_stage("clutter.template", frames=5), make_radar(), make_block(samples)).frames.preamble
    for row in (5, 6, 7):
        near = slice(17, 24)
        gain = np.linalg.lstsq(template[near, None], samples[row, near], rcond=None)[0]
        np.testing.assert_allclose(cleaned[row], samples[row] - gain * template, atol=1e-12)


def test_template_yields_zeros_until_it_is_complete_and_says_so(
    make_radar, make_block, make_stage, make_echoes, run_stage
):
    stage = make_stage("clutter.template", frames=10)
    cleaned = run_stage(stage, make_radar(), make_block(make_echoes(20))).frames.preamble
    assert not cleaned[:10].any()
    assert cleaned[10:].any(axis=1).all()
    assert stage.notes == ["clutter.template: the first 10 frames make the template and yield nothing"]


def test_template_says_when_the_capture_is_too_short(make_radar, make_block, make_stage, make_echoes, run_stage):
    stage = make_stage("clutter.template", frames=100)
    run_stage(stage, make_radar(), make_block(make_echoes(20)))
    assert "clutter.template: the capture has only 20 usable frames of 100" in stage.notes


def test_template_that_averages_out_subtracts_nothing(make_radar, make_block, make_stage, run_stage):
    frame = _one_frame()
    samples = np.stack([frame, -frame, frame])
    cleaned = run_stage(make_stage("clutter.template", frames=2), make_radar(), make_block(samples)).frames.preamble
    np.testing.assert_array_equal(cleaned[2], frame)


@every_config
@pytest.mark.parametrize("scale", [1e-150, 1e150])
def test_extreme_amplitudes_scale_the_result(
    name, params, scale, make_radar, make_block, make_stage, make_echoes, run_stage
):
    samples = make_echoes(20)
    plain, scaled = (
        run_stage(make_stage(name, **params), make_radar(), make_block(s)).frames.preamble
        for s in (samples, samples * scale)
    )
    np.testing.assert_allclose(scaled / scale, plain, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "seconds", "frames", "rate_hz"),
    [
        ("clutter.mean", {"window_s": 0.5}, {"window_frames": 24}, 48.0),
        ("clutter.mean", {"window_s": 0.5}, {"window_frames": 16}, 2.0),  # no background of a few frames
        ("clutter.exponential", {"memory_s": 0.5}, {"memory": np.exp(-1 / 24)}, 48.0),
        ("clutter.exponential", {"memory_s": 0.5}, {"memory": np.exp(-1 / 16)}, 2.0),
        ("clutter.svd", {"window_s": 0.5}, {"window_frames": 24}, 48.0),
        ("clutter.svd", {"window_s": 0.5}, {"window_frames": 16}, 2.0),
        ("clutter.svd", {"window_s": 0.5}, {"window_frames": 64}, 1000.0),  # the time of a frame grows with it
        ("clutter.mean", {"window_s": 0.5, "window_frames": 7}, {"window_frames": 7}, 48.0),
        ("clutter.exponential", {"memory_s": 0.5, "memory": 0.9}, {"memory": 0.9}, 48.0),
        ("clutter.svd", {"window_s": 0.5, "window_frames": 7}, {"window_frames": 7}, 48.0),
    ],
)
def test_seconds_become_frames_at_the_rate_of_the_radar(
    name, seconds, frames, rate_hz, make_radar, make_block, make_stage, make_echoes, run_stage
):
    radar = make_radar(frame_rate_hz=rate_hz)
    one, other = (
        run_stage(make_stage(name, **params), radar, make_block(make_echoes(FRAMES))).frames.preamble
        for params in (seconds, frames)
    )
    np.testing.assert_allclose(one, other, atol=1e-14)


def background(make_stage, make_radar, make_block, samples, cut=None):
    """A stage that was shown a background, whole or in two blocks."""
    stage = make_stage("clutter.template", source="background")
    stage.open(make_radar())
    block = make_block(samples)
    stage.show_background(iter([block] if cut is None else [block.cut(0, cut), block.cut(cut, len(samples))]))
    return stage


def test_template_of_a_background_cleans_from_the_first_frame_and_keeps_what_stands_still(
    make_radar, make_block, make_stage
):
    tap = np.arange(50)
    direct, obstacle = np.exp(-((tap - 7.0) ** 2) / 3), 0.1 * np.exp(-((tap - 30.0) ** 2) / 3)
    stage = background(make_stage, make_radar, make_block, np.tile(direct, (20, 1)))
    cleaned = stage.step(make_block(np.tile(2j * direct + obstacle, (5, 1)))).frames.preamble
    np.testing.assert_allclose(cleaned, np.tile(obstacle, (5, 1)), atol=1e-9)
    assert stage.notes == []


def test_background_gives_the_same_bits_however_it_is_cut(make_radar, make_block, make_stage, make_echoes):
    samples, frames = make_echoes(FRAMES), make_block(make_echoes(30, seed=2))
    stages = [background(make_stage, make_radar, make_block, samples, cut) for cut in (None, 1, 33)]
    one, *others = [stage.step(frames).frames.preamble for stage in stages]
    for other in others:
        np.testing.assert_array_equal(one, other)


def test_a_background_without_a_usable_frame_takes_nothing_away_and_is_noted(make_radar, make_block, make_stage):
    stage = background(make_stage, make_radar, make_block, np.full((4, 50), np.nan))
    samples = np.tile(_one_frame(), (3, 1))
    np.testing.assert_array_equal(stage.step(make_block(samples)).frames.preamble, samples)
    assert stage.notes == ["clutter.template: the background has no usable frame, so that nothing is taken away"]


def test_only_a_template_of_a_background_needs_one(make_stage):
    for source, needs in (("frames", set()), ("background", {"background"})):
        stage = make_stage("clutter.template", source=source)
        assert stage.needs_with(stage.params) == needs


def test_frames_of_a_template_that_is_made_of_a_background_are_refused(make_stage):
    with pytest.raises(ValueError, match="'frames' has no meaning"):
        make_stage("clutter.template", source="background", frames=20)
