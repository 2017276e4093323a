"""``export``, and ``plot`` of what mappers made of a run."""

import csv

import numpy as np
import pytest

from uwbbench.detect.tum import read_tum
from uwbbench.tools.check.drives import usual_drive

pytestmark = pytest.mark.slow


def test_a_trajectory_and_the_true_one_are_tum_files_of_the_same_times(uwbbench, mapped_run, tmp_path):
    result = uwbbench("export", "trajectory", mapped_run.path, "-d", "reckoning", "-o", "mine.tum")
    assert result.stderr == "trajectory of reckoning on SIMULATED run 'usual' written to mine.tum\n"
    uwbbench("export", "truth", mapped_run.path, "-d", "reckoning", "-o", "true.tum")
    drive = usual_drive()
    for name, pose in (("mine.tum", drive.odometry[:, :2]), ("true.tum", drive.trajectory.position_m[:, :2])):
        time_s, found = read_tum(tmp_path / name, (tmp_path / name).read_bytes())
        np.testing.assert_array_equal(time_s, drive.time_s)
        np.testing.assert_allclose(found[:, :2], pose, atol=1e-9)


def test_a_map_is_a_table_or_points(uwbbench, mapped_run, tmp_path):
    uwbbench("export", "map", mapped_run.path, "-d", "grid", "-o", "map.csv")
    with (tmp_path / "map.csv").open() as file:
        kinds = {row["kind"] for row in csv.DictReader(file)}
    assert kinds == {"cell"}
    uwbbench("export", "map", mapped_run.path, "-d", "reckoning", "-o", "map.ply")
    assert (tmp_path / "map.ply").read_text().startswith("ply\n")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["trajectory", "RUN", "-o", "x.tum"], "choose one with --detector: reckoning, grid, other"),
        (["trajectory", "RUN", "-d", "grit", "-o", "x.tum"], "has no detector 'grit'. Did you mean 'grid'?"),
        (["trajectory", "RUN", "-d", "grid", "-o", "x.csv"], "x.csv: the suffix decides the format; expected .tum"),
        (["map", "RUN", "-d", "grid", "-o", "x.pcd"], "expected .ply or .csv"),
        (["trajectory", "RUN", "-d", "grid", "--table", "mapping", "-o", "x.tum"], "'grid' does not look back"),
        (["trajectory", ".", "-o", "x.tum"], "is not a run folder"),
    ],
)
def test_a_mistake_is_one_message(uwbbench, mapped_run, words, message):
    words = [str(mapped_run.path) if word == "RUN" else word for word in words]
    assert message in uwbbench("export", *words, code=2).stderr


def test_maps_and_trajectories_are_drawn(uwbbench, mapped_run, tmp_path):
    uwbbench("plot", "map", mapped_run.path, "-d", "grid", "-o", "map.svg")
    uwbbench("plot", "trajectory", mapped_run.path, "--aligned", "-o", "all.svg")
    assert "SIMULATED run usual" in (tmp_path / "map.svg").read_text()
    assert "turned and shifted" in (tmp_path / "all.svg").read_text()
