"""Two ears in a room of 5 by 4 m whose ranges are those of the walls' image sources, with what is added to them."""

import numpy as np
import pytest

from uwbbench.api import ConfigError, Detections, Poses, Radar, Step, bistatic_range, wrap_angle
from uwbbench_detectors.mappers.landmark_table import AA, BB, HIGH, LOW, SUPPORT, WALL, A
from uwbbench_detectors.mappers.slam_particles import SlamParticles, SlamParticlesParams

WALLS = np.array([[2.5, 0.0], [2.0, np.pi / 2], [2.5, np.pi], [2.0, -np.pi / 2]])
CORNERS = np.array([[-1.3, -0.9], [1.3, -0.9], [1.3, 0.9], [-1.3, 0.9]])
NO_DRIFT = dict.fromkeys(
    ("along_sd_m", "across_sd_m", "heading_sd_deg", "turn_sd_deg", "distance_scale_sd", "turn_scale_sd"),
    0.0,
)


def ear(name, side):
    return Radar(
        model="made",
        receiver=name,
        channel=9,
        center_frequency_hz=7987.2e6,
        sample_interval_s=1.0016e-9,
        bandwidth_hz=499.2e6,
        frame_rate_hz=20.0,
        taps=50,
        mount_position_m=(0.0, 0.125 * side, 0.0),
        mount_yaw_rad=side * np.pi / 4,
        tx_position_m=(0.0, 0.0, 0.0),
    )


EARS = {"left": ear("left", 1), "right": ear("right", -1)}


def way(loops=2):
    """Poses (steps, 3) along a rectangle, which turn at its corners."""
    poses = []
    for leg in range(4 * loops):
        start, end = CORNERS[leg % 4], CORNERS[(leg + 1) % 4]
        for share in np.arange(0, 1, 0.05 / np.linalg.norm(end - start)):
            poses.append([*(start + share * (end - start)), leg * np.pi / 2])
        poses += [[*end, (leg + part / 12) * np.pi / 2] for part in range(12)]
    return np.array(poses)


def moves(poses, stretch=1.0, turning=1.0, heading_sd=0.0, rng=None):
    """What odometry makes of the way."""
    step, (cosine, sine) = np.diff(poses, axis=0), (np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2]))
    ahead, aside = cosine * step[:, 0] + sine * step[:, 1], cosine * step[:, 1] - sine * step[:, 0]
    turn = turning * step[:, 2]
    if heading_sd:
        turn = turn + heading_sd * np.sqrt(np.hypot(ahead, aside)) * rng.standard_normal(len(turn))
    return np.vstack([np.zeros(3), np.column_stack([stretch * ahead, stretch * aside, turn])])


def driven(start, moved):
    poses = [np.array(start, float)]
    for ahead, aside, turn in moved[1:]:
        x, y, yaw = poses[-1]
        cosine, sine = np.cos(yaw), np.sin(yaw)
        poses.append(np.array([x + cosine * ahead - sine * aside, y + sine * ahead + cosine * aside, yaw + turn]))
    return np.array(poses)


def ranges(radar, pose):
    """Range (walls,) as a front end makes it of the echo of each wall, NaN of those behind the ear."""
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    own = np.array([radar.mount_position_m[:2], radar.tx_position_m[:2]])
    place = pose[:2] + own @ np.array([[cosine, sine], [-sine, cosine]])
    normal = np.column_stack([np.cos(WALLS[:, 1]), np.sin(WALLS[:, 1])])
    image = place[1] + 2 * (WALLS[:, 0] - normal @ place[1])[:, None] * normal
    path = np.linalg.norm(image - place[0], axis=1)
    excess = path - radar.baseline_length_m
    found = bistatic_range(excess, np.tile([1.0, 0.0, 0.0], (4, 1)), radar.baseline_m)
    return np.where(np.abs(wrap_angle(WALLS[:, 1] - pose[2] - radar.mount_yaw_rad)) < np.radians(80), found, np.nan)


def heard(poses, sd_m=0.0, share=1.0, seed=0):
    """Tracks of both ears in each step, one a wall; with errors, and only a share of them."""
    rng, steps = np.random.default_rng(seed), []
    for index, pose in enumerate(poses):
        found = {}
        for name, radar in EARS.items():
            range_m = ranges(radar, pose) + sd_m * rng.standard_normal(4)
            kept = np.flatnonzero(np.isfinite(range_m) & (rng.random(4) < share))
            rows = {"range_m": range_m[kept], "track": kept.astype(float), "amplitude": np.ones(len(kept))}
            found[name] = Detections(np.full(len(kept), index), **rows)
        steps.append(found)
    return steps


def mapped(moved, found, start=(0.0, 0.0, 0.0), **params):
    """Poses, map and notes of a run."""
    mapper = SlamParticles(SlamParticlesParams.model_validate(params))
    mapper.open(EARS, Poses.of_one(0, np.array(start), np.zeros((3, 3))))
    poses = Poses.join(
        [
            mapper.step(Step(index, index / 20, step, rows))
            for index, (step, rows) in enumerate(zip(moved, found, strict=True))
        ]
    )
    return poses, mapper.finish()[1], mapper.notes


def rmse_m(poses, truth):
    return np.sqrt(np.mean(np.sum((poses[:, :2] - truth[:, :2]) ** 2, axis=1)))


def test_without_noise_poses_are_exact_and_walls_to_millimetres():
    truth = way(1)
    params = {"motion": NO_DRIFT, "range_sd_m": 0.01, "particles": 4, "resolution_m": 0.0}
    poses, learnt, _ = mapped(moves(truth), heard(truth), start=truth[0], **params)
    np.testing.assert_allclose(poses.pose[:, :2], truth[:, :2], atol=1e-9)
    lines = learnt.landmarks.of("line")
    assert len(lines) == 4
    for rho, alpha in WALLS:
        nearest = np.argmin(np.abs(wrap_angle(lines.b - alpha)))
        assert abs(lines.a[nearest] - rho) < 0.005
        assert abs(wrap_angle(lines.b[nearest] - alpha)) < 0.002


def drifting(seed=3):
    truth, rng = way(), np.random.default_rng(seed)
    return truth, moves(truth, stretch=1.02, turning=1.07, heading_sd=np.radians(1.0), rng=rng)


DRIFT = {"motion": {"distance_scale_sd": 0.02, "turn_scale_sd": 0.05}}


@pytest.mark.slow
def test_a_room_brings_a_robot_within_20_cm_whose_odometry_is_off_by_more_than_30():
    truth, moved = drifting()
    assert rmse_m(driven(truth[0], moved), truth) > 0.30
    poses, learnt, notes = mapped(moved, heard(truth, sd_m=0.03, share=0.8), start=truth[0], **DRIFT)
    assert rmse_m(poses.pose, truth) < 0.20
    assert len(learnt.landmarks.of("line")) == 4
    assert notes == []


@pytest.mark.parametrize(("range_m", "noted"), [(3.0, False), (2.2, True)])
def test_a_range_of_a_wrong_wall_is_noted(range_m, noted):
    mapper = SlamParticles(SlamParticlesParams.model_validate({"clutter": 0.001, "motion": {"along_sd_m": 0.3}}))
    mapper.open(EARS, Poses.of_one(0, np.zeros(3), np.zeros((3, 3))))
    wall = np.zeros((8, 150))
    wall[[A, AA, BB, LOW, HIGH, SUPPORT]] = np.array([4.0, 1e-6, 1e-6, -2.0, 2.0, 50.0])[:, None]
    mapper._known.add(WALL, wall)
    found = {"left": Detections(np.zeros(1, int), range_m=[range_m], track=[0.0], amplitude=[1.0])}
    mapper.step(Step(0, 0.0, np.array([1.0, 0.0, 0.0]), found))
    assert any("particles agree" in note for note in mapper.notes) == noted


def test_poses_move_with_the_start_pose():
    truth = way(1)
    moved, found = moves(truth, turning=1.03), heard(truth, sd_m=0.03)
    params = {"particles": 20, **DRIFT}
    turned = np.array([7.0, -3.0, 2.0])
    one, first, _ = mapped(moved, found, **params)
    two, second, _ = mapped(moved, found, start=turned, **params)
    cosine, sine = np.cos(turned[2]), np.sin(turned[2])
    turn = np.array([[cosine, sine], [-sine, cosine]])
    np.testing.assert_allclose(two.pose[:, :2], turned[:2] + one.pose[:, :2] @ turn, atol=1e-9)
    np.testing.assert_allclose(wrap_angle(two.pose[:, 2] - one.pose[:, 2] - turned[2]), 0, atol=1e-9)
    assert len(first.segments_m) > 0
    np.testing.assert_allclose(second.segments_m, turned[:2] + first.segments_m @ turn, atol=1e-9)


def test_draws_are_those_of_the_seed():
    truth = way(1)[:80]
    moved, found = moves(truth), heard(truth, sd_m=0.03)
    first, second, other = (mapped(moved, found, particles=10, seed=seed)[0].pose for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, second)
    assert not np.array_equal(first, other)


def test_without_echoes_poses_are_those_of_odometry():
    truth = way(1)
    none = [{name: Detections(np.zeros(0, int), range_m=[], track=[]) for name in EARS}] * len(truth)
    poses, learnt, notes = mapped(moves(truth), none, start=truth[0], motion=NO_DRIFT)
    np.testing.assert_allclose(poses.pose[:, :2], truth[:, :2], atol=1e-9)
    spread, _, _ = mapped(moves(truth), none, start=truth[0])
    off = np.linalg.norm(spread.pose[-1, :2] - truth[-1, :2])
    assert off < np.sqrt(np.trace(spread.covariance[-1, :2, :2]))
    assert len(learnt.landmarks) == 0
    assert notes == []


def test_a_robot_that_stands_stays_where_it_is_and_learns_nothing():
    truth = np.tile(way(1)[5], (60, 1))
    poses, learnt, _ = mapped(moves(truth), heard(truth, sd_m=0.03), start=truth[0])
    np.testing.assert_allclose(poses.pose, np.tile([*truth[0]], (60, 1)), atol=1e-12)
    assert np.abs(poses.covariance).max() < 1e-12
    assert len(learnt.landmarks) == 0


def test_ranges_that_are_no_numbers_are_no_ranges():
    truth = way(1)[:60]
    moved, found = moves(truth), heard(truth, sd_m=0.03)
    spoilt = [
        {
            name: Detections.join(
                [
                    rows,
                    Detections(
                        rows.frame[:1],
                        range_m=[np.nan] * len(rows.frame[:1]),
                        track=[9.0] * len(rows.frame[:1]),
                        amplitude=[1.0] * len(rows.frame[:1]),
                    ),
                ]
            )
            for name, rows in step.items()
        }
        for step in found
    ]
    clean, _, _ = mapped(moved, found, particles=10)
    poses, _, _ = mapped(moved, spoilt, particles=10)
    np.testing.assert_array_equal(poses.pose, clean.pose)


def test_a_jump_of_odometry_is_noted_and_doubted():
    truth = way(1)[:40]
    moved = moves(truth)
    moved[20] = [2.0, 0.0, 0.0]
    none = [{name: Detections(np.zeros(0, int), range_m=[], track=[]) for name in EARS}] * len(truth)
    poses, _, notes = mapped(moved, none)
    assert "jumps at step 20" in notes[0]
    assert np.sqrt(poses.covariance[20, 0, 0]) > 1.0 > np.sqrt(poses.covariance[19, 0, 0])


def test_more_ears_than_receivers_are_refused():
    mapper = SlamParticles(SlamParticlesParams.model_validate({"ears": 3}))
    with pytest.raises(ConfigError, match="'ears' is 3, but the run has 2 receivers"):
        mapper.open(EARS, Poses.of_one(0, np.zeros(3), np.zeros((3, 3))))


def test_two_receivers_are_needed():
    assert SlamParticles.receivers == 2
