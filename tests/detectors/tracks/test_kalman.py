"""Tracks of ranges: one step by hand, and what a track does over time."""

import datetime
import itertools

import numpy as np
import pytest

from uwbbench.api import Block, Detections

RATE_HZ = 48.0


def given(frames, rows, **parts):
    """Detections of frames; ``rows`` are frame and range, or frame, range and amplitude."""
    table = np.array([(*row, 1.0)[:3] for row in rows], float).reshape(-1, 3)
    found = Detections(table[:, 0].astype(int), range_m=table[:, 1], amplitude=table[:, 2])
    return {"samples": np.ones((frames, 4)), "detections": found} | parts


@pytest.fixture
def follow(make_radar, make_block, make_stage, run_stage):
    def run(frames, rows, radar=None, parts=None, **params):
        block = make_block(**given(frames, rows, **(parts or {})))
        return run_stage(make_stage("track.kalman", **params), radar or make_radar(taps=4), block).detections

    return run


def by_hand(times_s, ranges_m, q=0.5, r=0.045, start_rate=1.0):
    """Range, rate and covariance behind each measurement, in matrices."""
    x, p = np.array([ranges_m[0], 0.0]), np.diag([r**2, start_rate**2])
    states = [(x, p)]
    for t, z in zip(np.diff(times_s), ranges_m[1:], strict=True):
        f = np.array([[1, t], [0, 1]])
        x, p = f @ x, f @ p @ f.T + q**2 * np.array([[t**4 / 4, t**3 / 2], [t**3 / 2, t**2]])
        gain = p[:, 0] / (p[0, 0] + r**2)
        x, p = x + gain * (z - x[0]), p - np.outer(gain, p[0])
        states.append((x, p))
    return states


def test_each_step_is_the_closed_form_with_the_true_time_between_frames(follow):
    times_s, ranges_m = np.array([0.0, 0.02, 0.07, 0.08, 0.2]), [2.0, 2.02, 2.06, 2.05, 2.18]
    found = follow(5, list(enumerate(ranges_m)), parts={"timestamp_s": times_s}, confirm=[1, 1])
    states = by_hand(times_s, ranges_m)
    np.testing.assert_allclose(found.range_m, [x[0] for x, _ in states], rtol=1e-12)
    np.testing.assert_allclose(found["range_rate_m_s"], [x[1] for x, _ in states], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found["range_sd_m"], [np.sqrt(p[0, 0]) for _, p in states], rtol=1e-12)


GOLDEN = [  # Stone Soup 1.9.1, as the test below runs it: range, rate, variance of the range
    (2.0448578634194363, 0.31803579111557917, 0.0018167434684871787),
    (2.080905422052995, 0.30058346893080456, 0.001627483614157407),
    (2.174893114368577, 0.4969883658724005, 0.0014013442356803178),
    (2.2267330878980918, 0.4678110570797376, 0.0012237556364523736),
]
TIMES_S, MEASURED_M = np.arange(5) * 0.125, (2.0, 2.05, 2.08, 2.20, 2.22)


def test_steps_are_those_that_stone_soup_gave(follow):
    found = follow(5, list(enumerate(MEASURED_M)), parts={"timestamp_s": TIMES_S}, confirm=[1, 1])
    values = np.stack([found.range_m, found["range_rate_m_s"], found["range_sd_m"] ** 2], axis=1)
    np.testing.assert_allclose(values[1:], GOLDEN, rtol=1e-12)


@pytest.mark.slow  # importing it takes seconds
def test_stone_soup_still_gives_these_steps():
    soup = pytest.importorskip("stonesoup.types.state")
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.updater.kalman import KalmanUpdater

    t = TIMES_S[1]
    moves = LinearGaussianTimeInvariantTransitionModel(
        transition_matrix=np.array([[1, t], [0, 1]]),
        covariance_matrix=0.25 * np.array([[t**4 / 4, t**3 / 2], [t**3 / 2, t**2]]),
    )
    measures = LinearGaussian(2, [0], np.array([[0.045**2]]))
    now = datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)
    state = soup.GaussianState(np.array([[MEASURED_M[0]], [0.0]]), np.diag([0.045**2, 1.0]), timestamp=now)
    for measured_m, expected in zip(MEASURED_M[1:], GOLDEN, strict=True):
        now += datetime.timedelta(seconds=t)
        predicted = KalmanPredictor(moves).predict(state, timestamp=now)
        measured = Detection(np.array([[measured_m]]), timestamp=now, measurement_model=measures)
        state = KalmanUpdater(measures).update(SingleHypothesis(predicted, measured))
        found = state.state_vector[0], state.state_vector[1], state.covar[0, 0]
        np.testing.assert_allclose(np.array(found, float), expected, rtol=1e-12)


def walk(frames, rate_m_s=0.3, sd_m=0.03, seed=0, rate_hz=RATE_HZ):
    """True ranges, and rows with noise on them."""
    true_m = 2 + rate_m_s * np.arange(frames) / rate_hz
    noisy_m = true_m + sd_m * np.random.default_rng(seed).normal(size=frames)
    return true_m, list(enumerate(noisy_m))


def test_a_steady_track_has_at_most_six_tenths_of_the_error_of_its_detections(follow):
    true_m, rows = walk(600)
    found = follow(600, rows)
    settled = found.take(found.frame > 60)
    raw_m = np.array([range_m for _, range_m in rows])[settled.frame] - true_m[settled.frame]
    error_m = settled.range_m - true_m[settled.frame]
    assert np.std(error_m) <= 0.6 * np.std(raw_m)
    assert abs(error_m.mean()) < 0.01


def test_five_lost_frames_are_bridged_to_within_ten_centimetres(follow):
    true_m, rows = walk(200, sd_m=0.02)
    found = follow(200, [row for row in rows if not 150 <= row[0] < 155])
    lost = found.take((found.frame >= 150) & (found.frame < 155))
    assert len(lost) == 5
    assert np.isnan(lost["amplitude"]).all()
    assert np.abs(lost.range_m - true_m[lost.frame]).max() < 0.1
    assert set(found["track"].tolist()) == {0}


@pytest.mark.parametrize("rate_hz", [96.0, 48.0, 24.0])
def test_a_track_ends_after_the_same_time_at_any_frame_rate(rate_hz, follow, make_radar):
    frames = int(2 * rate_hz)
    _, rows = walk(frames, rate_hz=rate_hz)
    times_s = np.arange(frames) / rate_hz
    found = follow(
        frames,
        [row for row in rows if times_s[row[0]] <= 1.0],
        make_radar(taps=4, frame_rate_hz=rate_hz),
        {"timestamp_s": times_s},
    )
    assert times_s[found.frame[-1]] == pytest.approx(1.25, abs=1e-9)


def test_a_radar_slower_than_the_time_to_drop_still_keeps_its_tracks(follow, make_radar):
    times_s = np.arange(20) / 2.0
    found = follow(20, [(k, 2.0) for k in range(20)], make_radar(taps=4, frame_rate_hz=2.0), {"timestamp_s": times_s})
    assert found.frame.tolist() == list(range(2, 20))


def test_a_minute_of_false_alarms_makes_one_track_at_most(follow):
    rng = np.random.default_rng(4)
    frames = int(60 * RATE_HZ)
    rows = [(k, rng.uniform(0.3, 7.0)) for k in range(frames) for _ in range(rng.poisson(0.05))]
    for tracks in ("one", "many"):
        assert len(set(follow(frames, rows, tracks=tracks)["track"].tolist())) <= 1


def test_a_track_is_confirmed_by_three_detections_within_five_frames(follow):
    assert follow(8, [(0, 2.0), (2, 2.0), (4, 2.0)]).frame[0] == 4
    assert len(follow(8, [(0, 2.0), (1, 2.0), (5, 2.0)])) == 0


def test_tentative_tracks_come_out_where_all_are_asked_for(follow):
    found = follow(4, [(k, 2.0) for k in range(4)], emit="all")
    assert found["track"].tolist() == [-1, -1, 0, 0]


def test_numbers_of_tracks_never_return(follow):
    rows = [(k, 2.0) for k in range(20)] + [(k, 2.0) for k in range(60, 80)]
    found = follow(100, rows)
    assert found["track"][found.frame < 40].tolist() == [0] * len(found.take(found.frame < 40))
    assert set(found["track"][found.frame > 50].tolist()) == {1}


def test_of_many_tracks_each_keeps_its_object_and_its_number(follow):
    one, other = walk(200, 0.3, seed=1), walk(200, -0.2, seed=2)
    rows = sorted([*one[1], *((k, range_m + 1.5) for k, range_m in other[1])])
    found = follow(200, rows, tracks="many")
    for number, true_m in ((0, one[0]), (1, other[0] + 1.5)):
        mine = found.take(found["track"] == number)
        assert len(mine) == 198
        assert np.abs(mine.range_m - true_m[mine.frame]).max() < 0.1


def test_detections_go_to_tracks_so_that_the_sum_of_distances_is_least(follow):
    rows = [(k, range_m) for k in range(40) for range_m in (2.0, 2.2)]
    swapped = [*rows, (40, 2.11), (40, 2.30)]  # the nearest pair alone would leave the other track without
    found = follow(41, swapped, tracks="many")
    last = found.take(found.frame == 40)
    assert np.isfinite(last["amplitude"]).all()


@pytest.mark.parametrize(("start", "range_m"), [("nearest", 2.0), ("strongest", 3.0)])
def test_the_one_track_starts_from_the_nearest_or_the_strongest(start, range_m, follow):
    rows = [row for k in range(30) for row in ((k, 2.0, 1.0), (k, 3.0, 5.0))]
    found = follow(30, rows, start=start)
    assert set(found["track"].tolist()) == {0}
    np.testing.assert_allclose(found.range_m, range_m)


def test_frames_that_are_not_valid_are_time_and_nothing_else(follow):
    valid = np.ones(60, bool)
    valid[30:35] = False
    rows = [(k, 2.0) for k in range(60) if valid[k]]
    found = follow(60, rows, parts={"valid": valid})
    assert set(found["track"].tolist()) == {0}
    assert not np.isin(found.frame, np.arange(30, 35)).any()
    early = np.zeros(5, bool)
    early[[0, 3, 4]] = True
    assert follow(5, [(0, 2.0), (3, 2.0), (4, 2.0)], parts={"valid": early}).frame.tolist() == [4]


def test_frames_of_zeros_are_no_misses_unless_something_was_found_in_them(make_radar, make_block, make_stage, run_cut):
    samples = np.ones((40, 4))
    samples[10:30] = 0
    rows = [(k, 2.0) for k in range(40) if not 12 <= k < 18]
    block = make_block(**given(40, rows, samples=samples))
    found = run_cut("track.kalman", {}, make_radar(taps=4), block, list(range(1, 40))).detections
    assert found.frame.tolist() == [*range(2, 12), *range(18, 40)]


def test_odometry_takes_the_robots_own_motion_out_of_the_prediction(follow, make_radar):
    """A robot that stops dead before a wall: without odometry the track runs on."""
    times_s = np.arange(96) / RATE_HZ
    driven_m = np.minimum(times_s, 1.0) * 1.5
    place_m = np.stack([np.zeros(96), driven_m, np.zeros(96)], axis=1)
    parts = {
        "timestamp_s": times_s,
        "odometry_position_m": place_m,
        "odometry_yaw_rad": np.full(96, np.pi / 2),
    }
    rows = [(k, 4.0 - driven_m[k]) for k in range(96)]
    knowing, guessing = (follow(96, rows, make_radar(taps=4), parts, odometry=on) for on in (True, False))
    off_m = [np.abs(found.range_m - (4.0 - driven_m[found.frame])).max() for found in (knowing, guessing)]
    assert off_m[0] < 1e-9
    assert off_m[1] > 0.02
    np.testing.assert_allclose(knowing["range_rate_m_s"][10:40], -1.5, atol=1e-9)


def test_an_object_abeam_is_not_thought_to_come_nearer(follow, make_radar):
    times_s = np.arange(48) / RATE_HZ
    place_m = np.stack([times_s, np.zeros(48), np.zeros(48)], axis=1)
    odometry = {"odometry_position_m": place_m, "odometry_yaw_rad": np.zeros(48)}
    found = Detections(
        np.arange(48), range_m=np.full(48, 3.0), amplitude=np.ones(48), azimuth_rad=np.full(48, np.pi / 2)
    )
    tracked = follow(48, [], make_radar(taps=4), {"detections": found, "timestamp_s": times_s, **odometry})
    np.testing.assert_allclose(tracked.range_m, 3.0, atol=1e-9)


ROWS = [(k, 2 + 0.005 * k + 0.03 * np.sin(7 * k), 1 + k % 3) for k in range(90) if k % 7]
ROWS += [(k, 3 - 0.004 * k, 2.0) for k in range(0, 90, 2)] + [(k, 1 + k % 5, 0.5) for k in range(0, 90, 3)]


@pytest.mark.parametrize("params", [{}, {"tracks": "many", "emit": "all"}, {"start": "strongest"}])
def test_any_cut_into_blocks_gives_the_same_bits(params, make_radar, make_block, run_cut, one_by_one):
    rng = np.random.default_rng(0)
    place_m = np.cumsum(0.01 * rng.normal(size=(90, 3)), axis=0)
    odometry = {"odometry_position_m": place_m, "odometry_yaw_rad": place_m[:, 0]}
    block: Block = make_block(**given(90, sorted(ROWS), **odometry))
    for cuts in (one_by_one(90), [7, 7, 50], [1]):
        found = run_cut("track.kalman", params, make_radar(taps=4), block, cuts)
        assert len(found.detections) > 80


def test_rows_without_a_range_belong_to_no_track(follow):
    rows = [(k, range_m) for k in range(20) for range_m in (np.nan, 2.0)]
    found = follow(20, rows, tracks="many", emit="all")
    assert np.isfinite(found.range_m).all()
    assert set(found["track"].tolist()) == {-1, 0}


def test_more_tracks_than_there_was_room_for(follow):
    rows = [(k, 1.0 + number) for k, number in itertools.product(range(10), range(40))]
    found = follow(10, rows, tracks="many")
    assert sorted(found["track"][found.frame == 9].tolist()) == list(range(40))


@pytest.mark.parametrize("confirm", [[4, 3], [0, 5]])
def test_a_trial_that_cannot_be_passed_is_refused(confirm, make_stage):
    with pytest.raises(ValueError, match="1 <= m <= n"):
        make_stage("track.kalman", confirm=confirm)
