"""What recording a capture is of, and which recordings leak into each other."""

import dataclasses

import pytest

from tests.api.written import capture_of
from uwbbench.api import CaptureError, leak_key, leaks, open_capture, simulated_recording, write_capture
from uwbbench.config.source import open_dataset


def test_the_recording_is_the_name_without_the_receiver_if_nothing_else_is_said():
    assert capture_of(name="monday/front", recording="").recording == "monday"
    assert capture_of(name="monday", recording="").recording == "monday"
    assert capture_of(name="monday/front", recording="walk").recording == "walk"


def test_a_capture_that_is_renamed_stays_of_its_recording():
    assert dataclasses.replace(capture_of(name="monday/front"), name="mine").recording == "monday"


def test_measured_recordings_leak_into_themselves_alone():
    assert leaks("monday", "monday")
    assert not leaks("monday", "tuesday")
    assert leak_key("monday") == "monday"


def test_simulated_recordings_leak_where_their_draws_are_the_same_whatever_the_scene():
    first, second = (simulated_recording(name, "scene seed 1, run 2") for name in ("room/2", "walker/2"))
    assert leaks(first, second)
    assert not leaks(first, simulated_recording("room/2", "scene seed 3, run 2"))
    assert not leaks(first, simulated_recording("room/3", "scene seed 1, run 3"))
    assert not leaks(first, "room/2")


def test_receivers_of_a_simulated_run_are_one_recording_and_runs_are_several():
    changes = {"trajectory.end_m": [0.01, 0.0], "radar.channel": 9}
    dataset = open_dataset("simulated", {"scenes": ["two-plates"], "set": changes, "runs": 2}, [])
    recordings = [dataset.open(name).recording for name in dataset.names()[:4]]
    assert recordings[0] == recordings[1] != recordings[2] == recordings[3]
    assert recordings[0].endswith("/1 [draws 30aa4635cc15e65a]")


def test_scenes_with_one_seed_leak_and_the_seed_of_a_dataset_tells_them_apart():
    names = ("approach-metal", "approach-concrete")
    short = {"trajectory.end_m": [0.01, 0.0], "radar.channel": 9}

    def keys(seed):
        captures = []
        for name in names:
            dataset = open_dataset("simulated", {"scenes": [name], "set": short, "runs": 1, "seed": seed}, [])
            captures += [dataset.open(each) for each in dataset.names()]
        return {leak_key(capture.recording) for capture in captures}

    assert len(keys(None)) == 1
    assert len(keys(5)) == 2


def test_recording_and_robot_survive_a_capture_file(tmp_path):
    written = capture_of(recording="walk [scene seed 1, run 2]", robot="twin, seed 7")
    write_capture(tmp_path / "run.h5", written)
    read = open_capture(tmp_path / "run.h5")
    assert (read.recording, read.robot) == ("walk [scene seed 1, run 2]", "twin, seed 7")


@pytest.mark.parametrize("name", ["recording", "robot"])
def test_receivers_of_two_recordings_or_robots_share_no_file(tmp_path, name):
    captures = [capture_of(receiver=receiver, **{name: receiver}) for receiver in "ab"]
    with pytest.raises(CaptureError, match=f"they differ in {name}"):
        write_capture(tmp_path / "run.h5", *captures)


def test_a_background_of_another_robot_is_refused_where_both_are_known():
    background = capture_of(frames=4, robot="twin, seed 2")
    capture = capture_of(robot="twin, seed 1")
    with pytest.raises(CaptureError, match="it is of another robot, 'twin, seed 2' instead of 'twin, seed 1'"):
        dataclasses.replace(capture, background=background)
    unknown = dataclasses.replace(background, robot="")
    assert dataclasses.replace(capture, background=unknown).background is unknown
