"""Drives: receivers merged by time, and runs whose receivers cannot have been on one robot."""

import dataclasses
import re

import numpy as np
import pytest

from tests.api.written import capture_of
from uwbbench.api import CaptureError, Drive, Trajectory


def way(times):
    """Pose (n, 3) of a robot that goes ahead at 1 m/s and turns left on the spot after one second."""
    turned = times > 1.0
    x, y = np.minimum(times, 1.0), np.where(turned, times - 1.0, 0.0)
    return np.column_stack([x, y, np.where(turned, np.pi / 2, 0.0)])


def receiver(name, times, pose=None):
    """Capture of one receiver at given times, with odometry (n, 3); the true pose is a metre beside it."""
    pose = way(times) if pose is None else pose
    level = np.column_stack([pose[:, :2], np.zeros(len(times))])
    capture = capture_of(frames=len(times), receiver=name)
    return dataclasses.replace(
        capture,
        name=f"run/{name}",
        trajectory=Trajectory(times, level + 1.0, pose[:, 2]),
        odometry_position_m=level,
        odometry_yaw_rad=pose[:, 2],
    )


SECONDS = np.arange(21) / 10


def test_receivers_with_the_same_times_share_their_steps():
    drive = Drive("run", (receiver("a", SECONDS), receiver("b", SECONDS)))
    assert len(drive) == 21
    assert all(steps.tolist() == list(range(21)) for steps in drive.steps.values())
    assert np.array_equal(drive.odometry, way(SECONDS))
    assert np.array_equal(drive.trajectory.position_m[:, :2], way(SECONDS)[:, :2] + 1.0)


def test_motion_of_the_steps_adds_up_to_the_way():
    drive = Drive("run", (receiver("a", SECONDS), receiver("b", SECONDS + 0.03)))
    pose = np.zeros(3)
    for ahead, left, turn in drive.moved:
        pose[:2] += [np.cos(pose[2]) * ahead - np.sin(pose[2]) * left, np.sin(pose[2]) * ahead + np.cos(pose[2]) * left]
        pose[2] += turn
    assert pose == pytest.approx(way(SECONDS + 0.03)[-1])


@pytest.mark.parametrize("other", [SECONDS + 0.03, np.arange(61) / 30, np.arange(0, 2, 0.037), SECONDS[3:15:2]])
def test_receivers_of_other_times_and_rates_fit_whatever_the_robot_does_in_between(other):
    drive = Drive("run", (receiver("a", SECONDS), receiver("b", other)))
    assert drive.time_s.tolist() == sorted({*SECONDS.tolist(), *other.tolist()})
    assert drive.time_s[drive.steps["b"]].tolist() == other.tolist()
    assert np.array_equal(drive.odometry[drive.steps["b"]], way(other))
    assert len(Drive("run", (receiver("b", other), receiver("a", SECONDS)))) == len(drive)


def test_headings_a_whole_turn_apart_are_the_same():
    turned = way(SECONDS) + np.array([0, 0, 2 * np.pi])
    assert len(Drive("run", (receiver("a", SECONDS), receiver("b", SECONDS, turned)))) == 21


def jumped(index, by):
    pose = way(SECONDS)
    pose[index:] += by
    return pose


DISAGREEING = {
    "a place": (jumped(4, [0.02, 0, 0]), "2.0 cm and 0.0 degrees at 0.4 s"),
    "a heading": (jumped(7, [0, 0, 0.02]), "0.0 cm and 1.1 degrees at 0.7 s"),
    "all along": (way(SECONDS) + np.array([0, 0.5, 0]), "50.0 cm and 0.0 degrees at 0 s"),
}


@pytest.mark.parametrize("what", DISAGREEING)
def test_receivers_that_disagree_in_odometry_are_refused_with_where(what):
    pose, where = DISAGREEING[what]
    said = f"captures 'run/a' and 'run/b' are no receivers of one run: their odometry differs by {where}"
    with pytest.raises(CaptureError, match=re.escape(said)):
        Drive("run", (receiver("a", SECONDS), receiver("b", SECONDS, pose)))


@pytest.mark.parametrize("late", [0.15, 0.5])
def test_a_receiver_whose_clock_is_off_is_refused(late):
    with pytest.raises(CaptureError, match="no receivers of one run: their odometry differs by"):
        Drive("run", (receiver("a", SECONDS), receiver("b", SECONDS + late, way(SECONDS))))


def test_receivers_of_other_times_altogether_are_refused():
    with pytest.raises(CaptureError, match=r"their times, 0 to 2 s and 100 to 102 s, have nothing in common"):
        Drive("run", (receiver("a", SECONDS), receiver("b", SECONDS + 100, way(SECONDS))))


@pytest.mark.parametrize("place", [(0, 0), (9, 1), (20, 2)])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_odometry_that_is_not_finite_is_refused_with_its_frame(place, value):
    pose = way(SECONDS)
    pose[place] = value
    with pytest.raises(CaptureError, match=f"'run/b': odometry is not finite in frame {place[0]}$"):
        Drive("run", (receiver("a", SECONDS), receiver("b", SECONDS, pose)))


@pytest.mark.parametrize("missing", ["odometry_position_m", "odometry_yaw_rad"])
def test_a_receiver_without_odometry_is_refused(missing):
    bare = dataclasses.replace(receiver("b", SECONDS), **{missing: None})
    with pytest.raises(CaptureError, match="'run/b' has no odometry, which a mapper needs"):
        Drive("run", (receiver("a", SECONDS), bare))


def test_a_run_without_captures_frames_or_with_a_receiver_twice_is_refused():
    one = receiver("a", SECONDS)
    empty = receiver("b", np.zeros(0), np.zeros((0, 3)))
    for captures, said in (((), "no captures"), ((one, one), "two captures of the receiver 'a'")):
        with pytest.raises(CaptureError, match=f"run 'run' has {said}"):
            Drive("run", captures)
    with pytest.raises(CaptureError, match="'run/b' has no frames"):
        Drive("run", (one, empty))


def test_a_kidnapped_robot_is_a_run_like_any_other():
    """That its odometry jumps is for the mapper to notice: both receivers tell of it."""
    pose = jumped(10, [3.0, -2.0, 1.0])
    drive = Drive("run", (receiver("a", SECONDS, pose), receiver("b", SECONDS, pose)))
    assert np.hypot(*drive.moved[10, :2]) > 3
