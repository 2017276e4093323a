"""The six still detectors as wholes, on simulated scenes: what the source says of them, and what they refuse."""

import dataclasses

import numpy as np
import pytest
import yaml

from uwbbench import load_detector
from uwbbench.api import AlignedProfile, Bins, Capture, ConfigError
from uwbbench.config.source import open_dataset

ALIGNMENTS = ("icir", "ucir", "acir")
DISTANCES_M = (1.2, 1.7, 2.2, 2.7, 3.2)
TERMS = [
    {"use": "direct", "params": {"isolation_db": 6.0}},
    {"use": "ringing", "params": {"level_db": -12.0, "decay_ns": 1.5}},
    {"use": "echo.plate"},
    {"use": "echo.cylinder"},
    {"use": "echo.wall"},
    {"use": "grid"},
    {"use": "frame_gain"},
    {"use": "noise", "params": {"snr_db": 45.0}},
]
BOX = {"shape": "box", "yaw_deg": 180, "width_m": 0.5, "depth_m": 0.3, "height_m": 0.8, "material": "metal"}
SWAY = {"kind": "sway", "amplitude_m": 0.0075, "rate_hz": 0.25, "drift_m": 0.02}
PERSON = {"shape": "person", "yaw_deg": 180, "radius_m": 0.2, "material": "person", "motion": SWAY}
WALL = {"id": "wall", "shape": "wall", "yaw_deg": 180, "width_m": 5.0, "material": "plasterboard"}
STILL = {"kind": "static", "duration_s": 4.98}  # 240 frames, a window
MOVING = {"kind": "straight", "start_m": [0.0, 0.0], "end_m": [1.5, 0.0], "speed_m_s": 0.3}


@pytest.fixture
def seen(tmp_path):
    """Capture of an object whose face stands at some distance, with its background."""

    def capture(thing=BOX, distance_m=2.2, trajectory=STILL, terms=TERMS, seed=1) -> Capture:
        half_m = thing.get("radius_m") or thing["depth_m"] / 2
        scene = {
            "schema": 1,
            "seed": seed,
            "robot_seed": 7,
            "receivers": {"front": {"mount_position_m": [0.0, 0.25], "tx_position_m": [0.0, -0.25]}},
            "trajectory": trajectory,
            "objects": [
                {"id": "thing", **thing, "center_m": [distance_m + half_m, 0.0]},
                {**WALL, "center_m": [4.0, 0.0], "thickness_m": 0.0125},
            ],
            "terms": terms,
        }
        (tmp_path / "still.yaml").write_text(yaml.safe_dump(scene))
        return open_dataset("simulated", {"scenes": ["still.yaml"], "background": True}, [tmp_path]).open("still/1")

    return capture


def error_m(name, capture, **changes):
    """Mean error of a detector's answers in range; infinite where it has none."""
    found = load_detector(name, changes=changes).run(capture)
    true_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[:, 0]
    return float(np.mean(found.range_m - true_m[found.frame])) if len(found) else np.inf


@pytest.mark.slow
def test_a_static_metal_box_is_placed_by_means_and_misplaced_by_deviations(seen):
    captures = [seen(distance_m=distance_m) for distance_m in DISTANCES_M]
    for alignment in ALIGNMENTS:
        by_mean = np.array([error_m(f"{alignment}-bma", capture) for capture in captures])
        by_deviation = np.array([error_m(f"{alignment}-bsda", capture) for capture in captures])
        assert by_mean.std(ddof=1) <= (0.01 if alignment == "ucir" else 0.02)
        assert np.abs(by_mean).mean() < 0.07  # the ringing draws the crest of the direct path some 4 cm back
        assert np.abs(by_deviation).mean() > 3 * np.abs(by_mean).mean()


@pytest.mark.slow
def test_deviations_place_a_person_whose_echo_fades_better_than_a_smooth_body_that_sways(seen):
    def mean_error_m(name, thing):
        return np.mean([abs(error_m(name, seen(thing, far_m, seed=seed))) for seed, far_m in enumerate(DISTANCES_M)])

    fading = {**PERSON, "fading": {"sd_db": 4.0, "length_m": 0.01}}
    for name in ("ucir-bsda", "acir-bsda"):
        assert mean_error_m(name, fading) < 0.7 * mean_error_m(name, PERSON)


def test_ten_times_the_signal_gives_the_same_answers(seen):
    capture = seen()
    louder = dataclasses.replace(
        capture,
        preamble=10 * np.asarray(capture.preamble),
        background=dataclasses.replace(capture.background, preamble=10 * np.asarray(capture.background.preamble)),
    )
    for name in ("icir-bsda", "ucir-bma", "acir-bma"):
        one, other = (load_detector(name).run(this) for this in (capture, louder))
        assert len(one) == len(capture)
        np.testing.assert_allclose(other.range_m, one.range_m, atol=1e-9)


def test_a_robot_that_drives_gets_no_answer_and_is_told_why(seen):
    drift = {"use": "odometry"}
    capture = seen(distance_m=3.0, trajectory=MOVING, terms=[*TERMS, drift])
    background = dataclasses.replace(seen().background, odometry_position_m=None, odometry_yaw_rad=None)
    found = load_detector("ucir-bma").run(dataclasses.replace(capture, background=background))
    assert not len(found)
    assert len(found.processed) == len(capture)
    assert any("odometry moves more than 1 cm" in note for note in found.notes)


def test_without_odometry_the_error_grows_with_the_window(seen):
    capture = seen(distance_m=3.0, trajectory=MOVING)
    spread = []
    for window_s in (0.5, 2.5, 5.0):
        found = load_detector("ucir-bma", changes={"pipeline.statistic.mean.params.window_s": window_s}).run(capture)
        true_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[found.frame, 0]
        spread.append(np.std(found.range_m - true_m))
    assert spread[0] < spread[1] < spread[2]


@pytest.mark.slow
def test_answers_are_handed_out_at_the_end_of_their_window(seen):
    capture = seen(trajectory={**STILL, "duration_s": 9.98})
    found = load_detector("ucir-bma").run(capture, handed_out=True)
    length = len(capture) // 2
    np.testing.assert_array_equal(found["handed_out"], (found.frame // length + 1) * length - 1)
    np.testing.assert_array_equal(found.answered, found["handed_out"])


def with_fraction(capture, fraction):
    """Capture whose reported first paths all have one fraction of a tap."""
    return dataclasses.replace(capture, first_path_index=np.floor(capture.first_path_index) + fraction)


def test_first_paths_of_one_fraction_are_refused_where_frames_are_merged(seen):
    capture = seen()
    alike = dataclasses.replace(with_fraction(capture, 0.25), background=with_fraction(capture.background, 0.25))
    with pytest.raises(ConfigError, match=r"background gives no window.*not filled: 1[23]% of them instead of 85%"):
        load_detector("acir-bma").run(alike)
    found = load_detector("acir-bma").run(with_fraction(capture, 0.25))
    assert not len(found)
    assert any("not filled" in note for note in found.notes)


def test_a_window_longer_than_the_capture_is_refused_or_gives_no_answer(seen):
    capture = seen()
    longer = load_detector("ucir-bma", changes={"pipeline.statistic.mean.params.window_s": 11.0})
    with pytest.raises(
        ConfigError, match=r"capture of 240 frames, less than half a window of 11 s; use a longer capture or a"
    ):
        longer.run(capture)
    background = seen(trajectory={**STILL, "duration_s": 11.98}).background
    found = longer.run(dataclasses.replace(capture, background=background))
    assert not len(found)
    assert any("less than half a window of 11 s" in note for note in found.notes)


def test_a_capture_without_background_or_first_path_is_refused(seen):
    capture = seen()
    with pytest.raises(ConfigError, match="has no background"):
        load_detector("icir-bsda").run(dataclasses.replace(capture, background=None))

    def bare(capture, **parts):
        radar = dataclasses.replace(capture.radar, has_first_path=False)
        return dataclasses.replace(capture, radar=radar, first_path_index=None, **parts)

    with pytest.raises(ConfigError, match="has no reported first path"):
        load_detector("icir-bsda").run(bare(capture, background=bare(capture.background)))


@pytest.mark.slow
def test_alarms_of_noise_against_a_background_of_noise_are_as_frequent_as_asked(make_stage, make_radar, make_block):
    """Rayleigh magnitudes, at a rate of 1 in 100: 278 of 20 000 bins on average, within 7 standard deviations."""
    rng, bins, radar = np.random.default_rng(4), Bins(-4, 1, 4000), make_radar()

    def behind(statistic):
        noise = AlignedProfile(bins, np.sqrt(rng.standard_exponential((5 * 240, bins.count))))
        block = make_block(np.ones((5 * 240, 50)), first_path=np.full(5 * 240, 7.2), aligned=noise)
        return statistic.step(block)

    statistic, stage = make_stage("statistic.sd"), make_stage("detect.bsda", false_alarm_rate=0.01)
    for one in (statistic, stage):
        one.open(radar)
    backgrounds, windows = behind(statistic), behind(statistic).window_sd
    alarms = 0
    for row in range(5):
        stage.show_background([backgrounds.cut(240 * row, 240 * row + 240)])
        difference, threshold = stage.difference(windows, row)
        alarms += np.count_nonzero(difference > threshold)
    assert 0.5 * 200 <= alarms <= 2 * 200
