"""Entropy of sliding windows, and the segments that it makes."""

import math

import numpy as np
import pytest
from scipy.stats import differential_entropy

from uwbbench.api import ConfigError
from uwbbench_detectors.segments import entropy_loops

FIRST_PATH = 7.0
RATE_OF_WHITE_NOISE = 0.031
RATE_OF_SHAPED_NOISE = 0.042


@pytest.fixture
def make_segments(run_stage, make_stage, make_radar, make_block):
    def found(samples, radar=None, **params):
        samples = np.asarray(samples, complex)
        radar = radar or make_radar(samples.shape[1])
        block = make_block(samples, first_path=np.full(len(samples), FIRST_PATH))
        stage = make_stage("segment.entropy", **params)
        return run_stage(stage, radar, block).detections.annotated(notes=stage.notes)

    return found


def complex_noise(shape, seed=0):
    rng = np.random.default_rng(seed)
    return (rng.normal(size=shape) + 1j * rng.normal(size=shape)) / np.sqrt(2)


def shaped_noise(shape, bandwidth=0.4992, rolloff=0.25):
    """Noise behind a root-raised-cosine filter; the bandwidth is in cycles a tap."""
    frames, taps = shape
    white = complex_noise((frames, 64), seed=1)
    off = np.abs(np.fft.fftfreq(64)) / bandwidth - (1 - rolloff) / 2
    power = np.where(off <= 0, 1.0, np.where(off <= rolloff, 0.5 * (1 + np.cos(np.pi / rolloff * off)), 0.0))
    return np.fft.ifft(white * np.sqrt(power), axis=1)[:, :taps]


def windows_of(amplitude, window, estimator="gauss", spacing=2):
    amplitude = np.asarray(amplitude, float)
    entropy = np.empty(len(amplitude) - window + 1)
    kind = getattr(entropy_loops, estimator.upper())
    entropy_loops.entropies(amplitude, window, spacing, kind, np.empty((4, len(amplitude))), entropy)
    return entropy


def echo(*taps, taps_of_frame=50, noise=1e-3):
    frame = noise * complex_noise((1, taps_of_frame))
    for tap in taps:
        frame[0] += np.exp(-((np.arange(taps_of_frame) - tap) ** 2) / 1.5)
    return frame


def test_long_windows_of_unit_complex_noise_have_the_entropy_of_the_complex_normal_distribution():
    window = 100_000
    [entropy] = windows_of(np.abs(complex_noise(window)), window)
    assert abs(entropy - (1 + math.log(math.pi))) < 3 / math.sqrt(window)


def test_the_spacing_estimate_is_that_of_scipy():
    amplitude = np.abs(complex_noise(40))
    expected = [
        differential_entropy(amplitude[first : first + 9], window_length=3, method="vasicek") for first in range(32)
    ]
    np.testing.assert_allclose(windows_of(amplitude, 9, "vasicek", 3), expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("estimator", ["gauss", "vasicek"])
def test_segments_are_those_of_a_plain_loop(make_segments, make_echoes, estimator):
    samples = make_echoes(60)
    found = make_segments(samples, estimator=estimator)
    expected = []
    for frame, row in enumerate(np.abs(np.nan_to_num(samples))):
        if not row.any():
            continue
        entropy = windows_of(row, 5, estimator)
        centre = np.median(entropy[-16:])
        spread = 1.4826 * np.median(np.abs(entropy[-16:] - centre))
        middle = np.arange(len(entropy)) + 2
        hot = middle[(entropy > centre + 5 * spread) & (middle - FIRST_PATH >= 3)]
        for run in np.split(hot, np.flatnonzero(np.diff(hot) > 2) + 1):
            if len(run) and run[-1] - run[0] >= 1:
                crest = run[0] + np.argmax(row[run[0] : run[-1] + 1])
                expected.append((frame, crest, run[0] - 0.5, run[-1] + 0.5))
    columns = [found[name].tolist() for name in ("frame", "tap", "start_tap", "stop_tap")]
    assert list(zip(*columns, strict=True)) == expected
    assert len(expected) > 40


@pytest.mark.parametrize(
    ("noise", "rate"),
    [(complex_noise, RATE_OF_WHITE_NOISE), (shaped_noise, RATE_OF_SHAPED_NOISE)],
    ids=["white", "shaped by the radar's filter"],
)
def test_frames_of_noise_have_segments_at_the_documented_rate(make_segments, noise, rate):
    samples = noise((20_000, 50))
    found = make_segments(samples)
    assert len(np.unique(found.frame)) / len(samples) == pytest.approx(rate, abs=0.003)


def test_no_frame_of_noise_reaches_a_threshold_out_of_reach(make_segments):
    assert len(make_segments(complex_noise((2000, 50)), sigmas=1e6)) == 0


@pytest.mark.parametrize("factor", [10.0, 1e-160, 1e140])
def test_segments_do_not_hang_on_the_units_of_the_samples(make_segments, factor):
    samples = echo(20, 35)
    one, other = make_segments(samples), make_segments(samples * factor)
    for name in ("tap", "start_tap", "stop_tap"):
        np.testing.assert_array_equal(one[name], other[name])
    np.testing.assert_allclose(one["score_db"], other["score_db"], rtol=1e-12)


def test_a_segment_covers_its_echo_and_names_its_strongest_sample(make_segments):
    found = make_segments(echo(22))
    assert found["tap"].tolist() == [22]
    assert found["amplitude"][0] == pytest.approx(1.0, abs=0.01)
    assert found["start_tap"][0] < 20 < 24 < found["stop_tap"][0]
    assert 45 < found["score_db"][0] < 65  # 60 dB above the noise, the pulse spread over a window


def test_echoes_apart_are_two_segments_and_echoes_within_a_window_one(make_segments):
    assert len(make_segments(echo(16, 29))) == 2
    assert len(make_segments(echo(20, 25))) == 1


def test_a_gap_is_bridged_up_to_the_length_asked_for(make_segments):
    samples = echo(16, 29)
    first, second = make_segments(samples)["stop_tap"][0], make_segments(samples)["start_tap"][1]
    gap = int(second - first)
    assert gap >= 1
    assert len(make_segments(samples, merge_taps=gap - 1)) == 2
    assert len(make_segments(samples, merge_taps=gap)) == 1


def test_segments_shorter_than_asked_for_are_dropped(make_segments):
    samples = echo(22)
    length = int(np.ptp([make_segments(samples)["start_tap"][0], make_segments(samples)["stop_tap"][0]]))
    assert len(make_segments(samples, minimum_taps=length)) == 1
    assert len(make_segments(samples, minimum_taps=length + 1)) == 0


def test_nothing_is_found_before_the_guard(make_segments):
    found = make_segments(echo(7, noise=1e-2), guard_taps=3)
    assert (found["start_tap"] >= FIRST_PATH + 2.5).all()
    assert len(make_segments(echo(7), guard_taps=12)) == 0


def test_a_frame_full_of_echoes_is_compared_with_all_of_its_windows_where_asked(make_segments):
    samples = echo(20, 40, 44)
    assert 20 not in make_segments(samples)["tap"]  # the tail is full, and its spread with it
    assert 20 in make_segments(samples, reference="frame", sigmas=2)["tap"]


def test_without_noise_there_is_no_threshold_and_a_note_says_so(make_segments):
    found = make_segments(np.eye(1, 50, 20))
    assert not len(found)
    assert "no spread" in found.notes[0]


def test_lengths_in_pulses_hold_for_radars_of_any_sampling(make_segments, make_radar):
    fine = make_radar(200, sample_interval_s=0.25e-9, noise_taps=0)
    lengths = {
        "window_pulses": 2.5,
        "tail_pulses": 8,
        "guard_pulses": 1.5,
        "merge_pulses": 0.5,
        "minimum_pulses": 1,
    }
    as_pulses = make_segments(echo(80, taps_of_frame=200), fine, **lengths)
    as_taps = make_segments(
        echo(80, taps_of_frame=200),
        fine,
        window_taps=20,
        tail_taps=64,
        guard_taps=12,
        merge_taps=4,
        minimum_taps=8,
    )
    for name in ("tap", "start_tap", "stop_tap", "score_db"):
        np.testing.assert_array_equal(as_pulses[name], as_taps[name])
    assert len(as_taps)


@pytest.mark.parametrize("estimator", ["gauss", "vasicek"])
def test_any_cut_of_the_frames_gives_the_same_segments(
    run_cut, make_radar, make_block, make_echoes, one_by_one, estimator
):
    block = make_block(make_echoes(40), first_path=np.linspace(6, 8, 40))
    assert len(run_cut("segment.entropy", {"estimator": estimator}, make_radar(), block, one_by_one(40)).detections)


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"tail_taps": 47}, "need 51 taps, but a frame has 50"),
        ({"window_taps": 48}, "need 63 taps"),
        ({"estimator": "vasicek", "spacing": 3}, "below half the window of 5"),
    ],
)
def test_windows_that_do_not_fit_are_refused(make_stage, make_radar, params, message):
    with pytest.raises(ConfigError, match=message):
        make_stage("segment.entropy", **params).open(make_radar())


def test_one_length_in_two_units_is_refused(make_stage):
    with pytest.raises(ValueError, match="window_taps or window_pulses"):
        make_stage("segment.entropy", window_taps=5, window_pulses=2)
    with pytest.raises(ValueError, match="no meaning with reference 'frame'"):
        make_stage("segment.entropy", reference="frame", tail_taps=8)
