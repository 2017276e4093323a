"""Statistics of windows: the numbers, which frames count, when there are none, and what is handed out when."""

import numpy as np
import pytest

from uwbbench.api import AlignedProfile, Bins, ConfigError

RATE = 48.0
LENGTH = 48
BINS = Bins(-4, 1, 30)


def magnitudes(frames, seed=0):
    rng = np.random.default_rng(seed)
    return 0.2 + 0.1 * rng.random((frames, BINS.count))


@pytest.fixture
def windows(make_stage, make_radar, make_block, run_stage):
    """What a statistic of one second makes of given magnitudes: (stage, block)."""

    def run(values, name="statistic.sd", minimum_filled=0.0, first_path=None, params=None, radar=None, **frames):
        stage = make_stage(name, **{"window_s": 1.0, **(params or {})})
        block = make_block(
            np.ones((len(values), 50)),
            first_path=np.full(len(values), 7.2) if first_path is None else first_path,
            aligned=AlignedProfile(BINS, values, minimum_filled),
            **frames,
        )
        return stage, run_stage(stage, radar or make_radar(), block)

    return run


def test_each_window_has_its_own_mean_and_deviation_for_all_of_its_frames(windows):
    values = magnitudes(2 * LENGTH)
    _, block = windows(values)
    for row in range(2):
        part = values[row * LENGTH : (row + 1) * LENGTH]
        np.testing.assert_allclose(block.window_mean.value[row], part.mean(axis=0), rtol=1e-14)
        np.testing.assert_allclose(block.window_sd.value[row], part.std(axis=0, ddof=1), rtol=1e-13)
    assert block.window_sd.row.tolist() == [0] * LENGTH + [1] * LENGTH
    assert block.window_sd.stop.tolist() == [LENGTH, 2 * LENGTH]
    assert (block.window_sd.count == LENGTH).all()


def test_deviation_keeps_its_digits_beside_a_mean_a_hundred_million_times_as_large(windows):
    small = magnitudes(LENGTH)
    _, block = windows(1e7 + np.round(small * 2**26) / 2**26)
    exact = (np.round(small * 2**26) / 2**26).std(axis=0, ddof=1)
    np.testing.assert_allclose(block.window_sd.value[0], exact, rtol=1e-7)


def test_the_mean_alone_says_nothing_of_the_deviation(windows):
    _, block = windows(magnitudes(LENGTH), name="statistic.mean")
    assert block.window_sd is None
    assert block.window_mean.value.shape == (1, BINS.count)


def test_frames_are_held_back_until_their_window_is_full(make_stage, make_radar, make_block):
    stage = make_stage("statistic.mean", window_s=1.0)
    stage.open(make_radar())
    block = make_block(
        np.ones((LENGTH, 50)), first_path=np.full(LENGTH, 7.2), aligned=AlignedProfile(BINS, magnitudes(LENGTH))
    )
    yielded = [stage.step(block.cut(frame, frame + 1)) for frame in range(LENGTH)]
    assert [len(part.frames) for part in yielded] == [0] * (LENGTH - 1) + [LENGTH]
    assert stage.flush() is None


@pytest.mark.parametrize(
    ("index", "change"),
    [("power", 2.0), ("power", 0.5), ("first path", 11.0), ("first path", -11.0), ("first path", np.nan)],
)
def test_frames_far_from_the_median_are_left_out(windows, index, change):
    values, first_path = magnitudes(LENGTH), np.full(LENGTH, 7.2)
    rest = np.delete(values, [5, 17], axis=0)
    if index == "power":
        values[[5, 17]] *= change
    else:
        values[[5, 17]] = 0.9 * values[[5, 17]]
        first_path[[5, 17]] += change
        if np.isnan(change):
            values[[5, 17]] = np.nan  # as the alignment leaves frames without a first path
    stage, block = windows(values, first_path=first_path)
    np.testing.assert_allclose(block.window_mean.value[0], rest.mean(axis=0), rtol=1e-14)
    assert (block.window_mean.count == LENGTH - 2).all()
    left_out = [note for note in stage.notes if "far from their window's median are left out" in note]
    assert bool(left_out) != np.isnan(change)
    assert np.flatnonzero(block.window_mean.row < 0).tolist() == [5, 17]  # no answer holds for them


def test_a_window_with_fewer_than_half_of_its_frames_fit_for_use_gives_nothing(windows):
    values = magnitudes(2 * LENGTH)
    values[: LENGTH // 2 + 1] = np.nan
    stage, block = windows(values)
    assert block.window_mean.row.tolist() == [-1] * LENGTH + [0] * LENGTH
    assert any("fewer than half of the frames" in note for note in stage.notes)


def sparse(frames, phases):
    """Magnitudes of which frame k fills every eighth bin, from ``phases[k]`` on."""
    values = np.full((frames, BINS.count), np.nan)
    for frame, phase in enumerate(phases):
        values[frame, phase::8] = 0.5
    return values


def test_bins_that_are_not_filled_are_refused(windows):
    stage, block = windows(sparse(LENGTH, np.zeros(LENGTH, int)), minimum_filled=0.9)
    assert not len(block.window_mean.stop)
    assert any("bins are not filled: 16% of them instead of 90%" in note for note in stage.notes)
    assert block.window_mean.refused


def test_the_few_empty_bins_are_filled_from_both_sides(windows):
    phases = np.arange(LENGTH) % 8
    values = sparse(LENGTH, phases) * np.arange(BINS.count)
    values[:, 11] = np.nan
    _, block = windows(values, minimum_filled=0.9)
    np.testing.assert_allclose(block.window_mean.value[0], 0.5 * np.arange(BINS.count), rtol=1e-14)
    assert (block.window_mean.count[0] == LENGTH // 8).all()


def moved(frames, distance_m):
    position_m = np.zeros((frames, 3))
    position_m[:, 0] = np.linspace(0, distance_m, frames)
    return {"odometry_position_m": position_m, "odometry_yaw_rad": np.zeros(frames)}


def test_a_window_in_which_the_robot_moves_gives_nothing_and_says_so(windows):
    stage, block = windows(magnitudes(LENGTH), **moved(LENGTH, 0.0101))
    assert (block.window_mean.row == -1).all()
    assert any("odometry moves more than 1 cm" in note for note in stage.notes)


def test_a_robot_that_turns_on_the_spot_moves_its_antennas(make_radar, windows):
    motion = {**moved(LENGTH, 0.0), "odometry_yaw_rad": np.linspace(0, 0.1, LENGTH)}
    _, block = windows(magnitudes(LENGTH), radar=make_radar(tx_position_m=(0.0, -0.25, 0.0)), **motion)
    assert not len(block.window_mean.stop)
    _, block = windows(magnitudes(LENGTH), radar=make_radar(tx_position_m=(0.0, -0.05, 0.0)), **motion)
    assert len(block.window_mean.stop) == 1


def test_a_window_within_the_allowed_movement_counts(windows):
    stage, block = windows(magnitudes(LENGTH), **moved(LENGTH, 0.0099))
    assert len(block.window_mean.stop) == 1
    assert not stage.notes


def test_without_odometry_standing_still_is_taken_on_trust_and_the_results_say_so(windows):
    stage, _ = windows(magnitudes(LENGTH))
    assert any("no odometry" in note for note in stage.notes)


@pytest.mark.parametrize(("frames", "answered"), [(LENGTH + 23, LENGTH), (LENGTH + 24, LENGTH + 24), (23, 0)])
def test_the_last_window_may_be_shorter_down_to_a_half(windows, frames, answered):
    stage, block = windows(magnitudes(frames))
    assert np.count_nonzero(block.window_mean.row >= 0) == answered
    assert len(block.frames) == frames
    short = f"no answer for a capture of {frames} frames, less than half a window of 1 s"
    assert any(short in note for note in stage.notes) == (answered == 0)


def test_a_window_shorter_than_two_frames_is_refused(make_stage, make_radar):
    with pytest.raises(ConfigError, match=r"window_s is 0.02, less than two frames at 48 a second"):
        make_stage("statistic.sd", window_s=0.02).open(make_radar())


def test_any_cut_gives_the_same_bits(make_radar, make_block, run_cut, one_by_one):
    values = magnitudes(130)
    values[20:60] = np.nan
    block = make_block(
        np.ones((130, 50)), first_path=7 + np.linspace(0, 1, 130), aligned=AlignedProfile(BINS, values), **moved(130, 0)
    )
    for cuts in ([47, 48, 49], [1, 1, 95, 97], one_by_one(130)):
        run_cut("statistic.sd", {"window_s": 1.0}, make_radar(), block, cuts)
