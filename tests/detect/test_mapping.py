"""A detector with a mapper at work on a run."""

import dataclasses

import numpy as np
import pytest

from tests.fixtures.mappers import FRONT, LATE, LATE_FRAMES, NAME, Reckoning, reckoning
from uwbbench.api import CaptureError, ConfigError, Detections, PluginError, Trajectory
from uwbbench.api.drive import Drive, relative
from uwbbench.config.detector import detector_from_text
from uwbbench.detect.pipeline import Pipeline
from uwbbench.tools.check.drives import usual_drive


@pytest.fixture(scope="module")
def drive() -> Drive:
    return usual_drive()


@pytest.fixture(scope="module")
def found(drive: Drive) -> Detections:
    return reckoning().run(drive, handed_out=True)


def test_every_step_has_a_pose_that_is_where_odometry_is(drive: Drive, found: Detections):
    assert np.array_equal(found.mapped.poses.index, np.arange(len(drive)))
    assert np.allclose(found.mapped.poses.pose, drive.odometry, atol=1e-12)


def test_rows_are_those_of_each_front_end_at_the_steps_of_its_frames(drive: Drive, found: Detections):
    for place, capture in enumerate(drive.captures):
        alone = Pipeline(detector_from_text(FRONT)).run(capture)
        rows = found.take(found["receiver"] == place)
        steps = drive.steps[capture.radar.receiver]
        assert np.array_equal(rows.frame, steps[alone.frame])
        assert np.array_equal(rows.range_m, alone.range_m)


def test_poses_of_a_front_end_that_answers_at_once_are_handed_out_at_once(found: Detections):
    assert np.array_equal(found.answered, found.processed)


def test_a_front_end_that_holds_frames_back_delays_the_poses_and_changes_none(drive: Drive, found: Detections):
    late = f"  - {{use: {LATE}}}\n"
    held = reckoning(FRONT.replace("  - {use: align}\n", late + "  - {use: align}\n")).run(drive, handed_out=True)
    assert np.array_equal(held.mapped.poses.pose, found.mapped.poses.pose)
    assert np.array_equal(held.mapped.map.points_m, found.mapped.map.points_m, equal_nan=True)
    valid = drive.captures[0].frames().valid[:-LATE_FRAMES]
    waited = held.answered - held.processed
    assert np.all(waited[: len(valid)][valid] == LATE_FRAMES)
    assert np.all(held.answered[-LATE_FRAMES:] == len(drive))


def test_frames_of_the_front_ends_carry_odometry_and_never_the_true_pose(drive: Drive, monkeypatch: pytest.MonkeyPatch):
    from uwbbench.detect.stream import Stream

    seen = []
    step = Stream.step
    monkeypatch.setattr(Stream, "step", lambda self, frames: (seen.append(frames), step(self, frames))[1])
    reckoning().run(drive)
    assert len(seen) == len(drive.captures)
    for frames, capture in zip(seen, drive.captures, strict=True):
        assert np.array_equal(frames.position_m, capture.odometry_position_m)
        assert not np.array_equal(frames.position_m, capture.trajectory.position_m)


def test_a_receiver_with_frames_of_its_own_gets_steps_of_its_own(drive: Drive):
    first, second = drive.captures
    every_other = np.arange(0, len(second), 2)
    track = second.trajectory
    slow = dataclasses.replace(
        second,
        preamble=np.asarray(second.preamble)[every_other],
        sts1=np.asarray(second.sts1)[every_other],
        sts2=np.asarray(second.sts2)[every_other],
        trajectory=Trajectory(
            track.timestamp_s[every_other], track.position_m[every_other], track.yaw_rad[every_other]
        ),
        **{
            name: getattr(second, name)[every_other]
            for name in (
                "first_path_index",
                "first_path_index_sts1",
                "first_path_index_sts2",
                "odometry_position_m",
                "odometry_yaw_rad",
            )
        },
        background=None,
    )
    both = Drive("uneven", (dataclasses.replace(first, background=None), slow))
    pipeline = reckoning()
    loop = pipeline.open(both)
    for frames in both.blocks(5):
        loop.step(frames)
    loop.flush()
    assert isinstance(loop.mapper, Reckoning)
    assert [len(step.found) for step in loop.mapper.steps[:4]] == [2, 1, 2, 1]


def test_messages_reach_the_mapper_at_the_step_of_their_frame(drive: Drive):
    loop = reckoning().open(drive)
    loop.step(drive.frames())
    loop.flush()
    heard = [step.index for step in loop.mapper.steps if step.messages]
    assert heard == [20]
    assert loop.mapper.steps[20].messages["side"].anchor.tolist() == [7]


def test_motion_of_a_step_leads_from_pose_to_pose(drive: Drive):
    assert np.allclose(drive.moved[1:], relative(drive.odometry[:-1], drive.odometry[1:]))
    assert not drive.moved[0].any()


def test_a_front_end_may_differ_by_receiver(drive: Drive):
    changed = f"mapper: {{use: {NAME}, front: {{side: {{range.params.includes_baseline: false}}}}}}\n"
    usual, other = reckoning().run(drive), reckoning(mapper=changed).run(drive)
    for place, same in ((0, True), (1, False)):
        ranges = [rows.range_m[rows["receiver"] == place] for rows in (usual, other)]
        assert np.array_equal(*ranges, equal_nan=True) is same


def test_what_a_receiver_changes_is_part_of_the_identity():
    changed = f"mapper: {{use: {NAME}, front: {{side: {{range.params.includes_baseline: false}}}}}}\n"
    assert reckoning().identity == reckoning().identity
    assert reckoning().identity != reckoning(mapper=changed).identity


@pytest.mark.parametrize(
    ("mapper", "message"),
    [
        ("mapper: {use: test.reckonin}\n", "mapper.use: no mapper named 'test.reckonin' is installed"),
        (f"mapper: {{use: {NAME}, params: {{speed: 1}}}}\n", "mapper.params.speed: unknown key 'speed'"),
        (
            f"mapper: {{use: {NAME}, front: {{side: {{peeks.params.x: 1}}}}}}\n",
            "mapper.front.side: 'pipeline.peeks.params.x'",
        ),
    ],
)
def test_a_mistake_in_the_file_is_named_by_its_place(mapper: str, message: str):
    with pytest.raises((ConfigError, PluginError)) as error:
        reckoning(mapper=mapper)
    assert message in str(error.value)


def test_a_front_end_without_what_the_mapper_needs_is_refused():
    bare = FRONT.replace("  - {use: pdoa}\n  - {use: azimuth}\n", "")
    with pytest.raises(ConfigError, match=r"mapper 'test.reckoning' needs 'azimuth_rad', which no step"):
        reckoning(bare)


def test_a_run_without_odometry_is_refused(drive: Drive):
    bare = dataclasses.replace(drive.captures[0], odometry_position_m=None, odometry_yaw_rad=None)
    with pytest.raises(CaptureError, match="'usual/front' has no odometry, which a mapper needs"):
        Drive("bare", (bare,))


def test_a_single_capture_is_refused_with_what_runs_it(drive: Drive):
    config = reckoning().config
    with pytest.raises(ConfigError, match="answers for a run with poses and a map"):
        Pipeline(config).run(drive.captures[0])
