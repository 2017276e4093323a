"""Runs of mappers, and of another program's trajectories, in an experiment."""

import numpy as np
import pytest

from tests.fixtures.drives import APART
from uwbbench.run.folder.verify import verify
from uwbbench.tools.check.drives import usual_drive

pytestmark = pytest.mark.slow


@pytest.fixture
def found(mapped_run):
    return {entry.detector: mapped_run.detections(entry.unit) for entry in mapped_run.entries()}


def test_every_detector_of_runs_has_one_unit_a_run(mapped_run):
    units = [(entry.detector, entry.capture, entry.status) for entry in mapped_run.entries()]
    assert sorted(units) == [(name, "usual", "done") for name in ("grid", "other", "reckoning")]


def test_another_programs_trajectory_is_scored_in_a_frame_of_its_own_as_the_mapper_that_has_it(mapped_run, found):
    np.testing.assert_allclose(found["other"].mapped.poses.pose, usual_drive().odometry + APART, atol=1e-9)
    scores = mapped_run.scores()
    ate = scores[(scores.scoring == "pose") & (scores.table == "filtering")].set_index("detector")["ate_m"]
    assert ate["other"] == pytest.approx(ate["reckoning"], rel=1e-9)
    assert ate["other"] > 0


def test_the_run_says_that_the_trajectory_was_read_and_not_run(found):
    assert found["other"].notes[0].startswith("results file: read, not run")


def test_what_was_written_is_verified(mapped_run):
    assert verify(mapped_run).passed, verify(mapped_run).problems
