import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fixtures.chance import SIGMAS
from uwbbench.api import Capture, Obstacle, Radar, Trajectory, Truth

TAPS = 4
PARTS = ("preamble", "sts1", "sts2", "first_path_index", "first_path_index_sts1", "first_path_index_sts2")


def recording(frames=400, rate_hz=50.0):
    """A capture in which every array tells the number of its frame."""
    number = np.arange(frames, dtype=float)
    samples = np.repeat(number[:, None], TAPS, axis=1) + 0j
    position = np.stack([number * 0.01, np.zeros(frames), np.zeros(frames)], axis=1)
    moving = Obstacle("moving", "metal", np.repeat(number[:, None, None], 2, axis=2))
    still = Obstacle("still", "metal", np.array([[5.0, 0.0]]))
    radar = Radar(
        model="test",
        center_frequency_hz=8e9,
        bandwidth_hz=5e8,
        sample_interval_s=1e-9,
        frame_rate_hz=rate_hz,
        taps=TAPS,
        has_sts=True,
        has_first_path=True,
    )
    return Capture(
        name="c",
        radar=radar,
        trajectory=Trajectory(number / rate_hz, position, number * 1e-3),
        truth=Truth((moving, still)),
        preamble=samples,
        sts1=samples,
        sts2=samples,
        first_path_index=number,
        first_path_index_sts1=number,
        first_path_index_sts2=number,
        odometry_position_m=position,
        odometry_yaw_rad=number * 1e-3,
    )


def numbers(capture):
    """Original frame numbers, after a check that all arrays agree on them."""
    frame = capture.preamble[:, 0].real
    for name in PARTS:
        part = getattr(capture, name)
        assert np.array_equal(part[:, 0].real if part.ndim == 2 else part, frame)
    for position in (capture.trajectory.position_m, capture.odometry_position_m):
        assert np.array_equal(position[:, 0], frame * 0.01)
    assert np.array_equal(capture.trajectory.yaw_rad, frame * 1e-3)
    assert np.array_equal(capture.truth.objects[0].outline_m[:, 0, 0], frame)
    assert capture.truth.objects[1].outline_m.shape == (1, 2)
    return frame.astype(int)


@given(st.floats(0, 0.95), st.floats(1, 20), st.integers(1, 300), st.integers(0, 99))
@settings(max_examples=40, deadline=None)
def test_frames_that_are_left_keep_their_place_time_and_truth(make_term, share, burst, frames, seed):
    whole = recording(frames)
    left = make_term("frames.lost", share=share, burst=burst).record(whole, np.random.default_rng(seed))
    frame = numbers(left)
    assert 1 <= len(frame) <= frames
    assert np.all(np.diff(frame) > 0)
    assert np.array_equal(left.trajectory.timestamp_s, whole.trajectory.timestamp_s[frame])


@pytest.mark.parametrize(("share", "burst"), [(0.05, 1.0), (0.05, 8.0), (0.5, 1.0), (0.9, 1.0), (0.3, 4.0)])
def test_share_and_length_of_losses_are_as_asked(make_term, rng, share, burst):
    frames = 200_000
    frame = numbers(make_term("frames.lost", share=share, burst=burst).record(recording(frames), rng))
    lengths = np.diff(frame) - 1
    lengths = lengths[lengths > 0]
    off = SIGMAS / np.sqrt(len(lengths))  # lengths spread by at most their mean, of losses and of what is between them
    longest = max(burst, share / (1 - share))  # single losses cannot make up more than half of the frames
    assert np.mean(lengths) == pytest.approx(longest, rel=off)
    assert 1 - len(frame) / frames == pytest.approx(share, rel=np.sqrt(2) * off)


def test_lossless_channel_changes_nothing(make_term, rng):
    assert len(make_term("frames.lost", share=0.0).record(recording(), rng)) == 400


def test_duplicates_follow_their_frame_with_the_same_time_and_pose(make_term, rng):
    whole = recording(5000)
    twice = make_term("frames.duplicated", share=0.1).record(whole, rng)
    frame = numbers(twice)
    assert set(np.diff(frame)) == {0, 1}
    assert np.bincount(frame).max() == 2
    assert len(frame) - 5000 == pytest.approx(500, abs=SIGMAS * np.sqrt(450))
    assert np.array_equal(twice.trajectory.timestamp_s, whole.trajectory.timestamp_s[frame])


@given(st.floats(0, 1), st.floats(1, 500), st.integers(0, 99))
@settings(max_examples=40, deadline=None)
def test_late_frames_wait_in_line_as_a_loop_over_them_says(make_term, share, delay_ms, seed):
    whole = recording(100)
    late = make_term("frames.late", share=share, delay_ms=delay_ms).record(whole, np.random.default_rng(seed))
    assert np.array_equal(numbers(late), np.arange(100))
    draws = np.random.default_rng(seed)
    held, unlucky = draws.exponential(delay_ms * 1e-3, 100), draws.random(100) < share
    free_s = 0.0
    for index, taken_s in enumerate(whole.trajectory.timestamp_s):
        free_s = max(free_s, taken_s + (held[index] if unlucky[index] else 0.0))
        assert late.trajectory.timestamp_s[index] == free_s


def test_late_frames_keep_the_pose_of_the_moment_they_were_taken(make_term, rng):
    whole = recording()
    late = make_term("frames.late", share=1.0).record(whole, rng)
    assert np.all(late.trajectory.timestamp_s > whole.trajectory.timestamp_s)
    assert np.array_equal(late.trajectory.position_m, whole.trajectory.position_m)


def test_scene_may_lose_repeat_and_hold_up_frames_at_once(run_scene):
    timing = [{"use": f"frames.{kind}", "params": {"share": 0.2}} for kind in ("lost", "duplicated", "late")]
    still = [{"use": "direct"}, {"use": "grid"}, {"use": "odometry"}]
    one, again = (run_scene([*still, *timing]) for _ in range(2))
    assert one.sha256 == again.sha256 != run_scene(still).sha256


STEPS = 2000


def driven(yaw_rad, speed=0.005):
    """A robot that drives ahead along a heading (frames,)."""
    whole = recording(len(yaw_rad))
    step = speed * np.stack([np.cos(yaw_rad), np.sin(yaw_rad), np.zeros(len(yaw_rad))], axis=1)
    position = np.array([3.0, -2.0, 0.1]) + np.concatenate([np.zeros((1, 3)), np.cumsum(step[:-1], axis=0)])
    trajectory = Trajectory(whole.trajectory.timestamp_s, position, yaw_rad)
    return Capture(**{**vars(whole), "trajectory": trajectory, "odometry_position_m": None, "odometry_yaw_rad": None})


WAYS = {"straight": np.full(STEPS, 0.7), "circles": np.linspace(0, 20, STEPS) % (2 * np.pi)}


@pytest.mark.parametrize("way", WAYS)
def test_odometry_without_error_is_the_true_pose(make_term, rng, way):
    capture = driven(WAYS[way])
    term = make_term("odometry", distance_error=0, rotation_error=0, heading_noise_deg=0)
    seen = term.record(capture, rng)
    assert seen.odometry_position_m == pytest.approx(capture.trajectory.position_m, abs=1e-9)
    turned = np.exp(1j * seen.odometry_yaw_rad)
    assert turned == pytest.approx(np.exp(1j * capture.trajectory.yaw_rad), abs=1e-9)


@pytest.mark.parametrize("way", WAYS)
def test_odometry_equals_dead_reckoning_step_by_step(make_term, way):
    capture = driven(WAYS[way])
    seen = make_term("odometry").record(capture, np.random.default_rng(5))
    draws = np.random.default_rng(5)
    stretch, turned = 1 + 0.02 * draws.standard_normal(), 1 + 0.02 * draws.standard_normal()
    slips = draws.standard_normal(STEPS - 1)
    track = capture.trajectory
    position, yaw = track.position_m[0].copy(), track.yaw_rad[0]
    for index in range(STEPS - 1):
        step = track.position_m[index + 1] - track.position_m[index]
        ahead = complex(step[0], step[1]) * np.exp(1j * (yaw - track.yaw_rad[index])) * stretch
        position += [ahead.real, ahead.imag, stretch * step[2]]
        turn = np.angle(np.exp(1j * (track.yaw_rad[index + 1] - track.yaw_rad[index])))
        yaw += turned * turn + np.radians(0.5) * np.sqrt(np.linalg.norm(step)) * slips[index]
    assert seen.odometry_position_m[-1] == pytest.approx(position, abs=1e-9)
    assert seen.odometry_yaw_rad[-1] == pytest.approx(yaw, abs=1e-9)


def test_distance_drifts_by_two_percent_and_heading_by_the_root_of_the_way(make_term):
    capture = driven(WAYS["straight"])
    length = 0.005 * (STEPS - 1)
    scale, heading = [], []
    for seed in range(400):
        straight = make_term("odometry", heading_noise_deg=0).record(capture, np.random.default_rng(seed))
        gone = np.linalg.norm(straight.odometry_position_m[-1] - straight.odometry_position_m[0])
        scale.append(gone / length - 1)
        walked = make_term("odometry").record(capture, np.random.default_rng(seed))
        heading.append(walked.odometry_yaw_rad[-1] - 0.7)
    off = SIGMAS / np.sqrt(2 * 400)  # of the spread of 400 normal draws, relative
    assert np.std(scale) == pytest.approx(0.02, rel=off)
    assert np.degrees(np.std(heading)) == pytest.approx(0.5 * np.sqrt(length), rel=off)


def test_odometry_of_one_frame_is_its_pose(make_term, rng):
    seen = make_term("odometry").record(driven(np.zeros(1)), rng)
    assert seen.odometry_position_m.tolist() == [[3.0, -2.0, 0.1]]
    assert seen.odometry_yaw_rad.tolist() == [0.0]


def test_one_number_of_drift_stands_for_all_three_errors(make_term):
    capture = driven(WAYS["circles"])
    one = make_term("odometry", drift=0.02).record(capture, np.random.default_rng(5))
    three = make_term("odometry", distance_error=0.02, rotation_error=0.02, heading_noise_deg=1.0)
    other = three.record(capture, np.random.default_rng(5))
    assert np.array_equal(one.odometry_position_m, other.odometry_position_m)
    assert np.array_equal(one.odometry_yaw_rad, other.odometry_yaw_rad)


def test_drift_beside_an_error_that_it_stands_for_is_refused(make_term):
    with pytest.raises(ValueError, match="drift stands for distance_error too"):
        make_term("odometry", drift=0.02, distance_error=0.01)
