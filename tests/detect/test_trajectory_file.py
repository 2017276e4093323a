"""Another program's trajectory, against the clock of the run that it is of."""

import numpy as np
import pytest

from uwbbench.api import ScoringError
from uwbbench.api.drive import Drive
from uwbbench.config.detector import DetectorConfig
from uwbbench.detect.results_folder import ResultsFolder
from uwbbench.detect.trajectory_file import read_trajectory
from uwbbench.detect.tum import tum_text
from uwbbench.tools.check.drives import usual_drive


@pytest.fixture(scope="module")
def drive() -> Drive:
    return usual_drive()


@pytest.fixture
def write(tmp_path):
    def write(time_s, pose, name="usual.tum"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(tum_text(np.asarray(time_s), np.asarray(pose)))
        return path

    return write


def test_every_step_has_the_pose_of_its_time(drive, write):
    found = read_trajectory(write(drive.time_s, drive.odometry), drive).detections
    np.testing.assert_array_equal(found.mapped.poses.index, np.arange(len(drive)))
    np.testing.assert_allclose(found.mapped.poses.pose, drive.odometry, atol=1e-12)
    assert (len(found), found.notes, found.mapped.poses.covariance) == (0, (), None)


def test_a_program_that_answers_at_some_steps_has_poses_at_these(drive, write):
    rows = np.arange(0, len(drive), 7)
    found = read_trajectory(write(drive.time_s[rows], drive.odometry[rows]), drive).detections
    assert found.processed.tolist() == rows.tolist()


def test_of_several_poses_of_a_step_the_nearest_in_time_counts_and_a_note_says_so(drive, write):
    tick_s = np.diff(drive.time_s).min()
    time_s = [drive.time_s[0] + 0.3 * tick_s, drive.time_s[0] + 0.1 * tick_s, drive.time_s[1], drive.time_s[-1] + 100]
    pose = np.zeros((4, 3))
    pose[:, 0] = np.arange(4)
    found = read_trajectory(write(time_s, pose), drive).detections
    assert found.mapped.poses.index.tolist() == [0, 1]
    assert found.mapped.poses.pose[:, 0].tolist() == [1.0, 2.0]
    assert found.notes == ("results file: 2 of 4 poses left out: no step is near, or another pose is nearer to it",)


def test_a_file_of_another_clock_is_refused_with_both_spans(drive, write):
    path = write(drive.time_s + 1.7e9, drive.odometry)
    with pytest.raises(
        ScoringError, match=r"usual.tum: no pose is of a time of run '.*': its clock goes from .* s, the"
    ):
        read_trajectory(path, drive)


def test_a_folder_of_trajectories_has_a_file_a_run(drive, write, tmp_path):
    folder = ResultsFolder(DetectorConfig.of_results("mine", tmp_path, trajectories=True))
    with pytest.raises(
        ScoringError, match=r"no results for run 'loop/1' of 'loop': no loop/1.tum. No TUM file is there"
    ):
        folder.file_of("loop", "loop/1")
    assert folder.content("loop", "loop/1") == ""
    write(drive.time_s, drive.odometry, "loop/1.tum")
    read = folder.read("loop", "loop/1", drive)
    assert len(read.detections.mapped.poses) == len(drive)
    assert read.sha256 == folder.content("loop", "loop/1")
