"""A mapper beside a plain detector in a run: judged as whole runs, stored, checked, compared and shown."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.fixtures.chance import reseeded
from tests.fixtures.shared import Once
from uwbbench.api import registry
from uwbbench.measure.accuracy.metrics.map import MAP_METRICS
from uwbbench.measure.accuracy.metrics.pose import POSE_METRICS
from uwbbench.measure.accuracy.scoring import column_of
from uwbbench.results.comparison.compare import compare
from uwbbench.results.leaderboard.ranking import rankings
from uwbbench.results.leaderboard.runs import read_runs
from uwbbench.results.leaderboard.suites import suites
from uwbbench.results.report import Report
from uwbbench.run import rescore, run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder import RunFolder
from uwbbench.run.folder.verify import verify
from uwbbench.show.text.report import markdown

pytestmark = pytest.mark.slow  # simulates two runs of two receivers

EXPERIMENT = """\
schema: 1
name: drives
detectors: [map-occupancy, paper-filtering]
datasets:
  - use: simulated
    captures: ["rods-loop-walls/drift-0.02/*"]
    params: {scenes: [rods-loop-walls], runs: 2, set: {trajectory.points_m: [[0.0, 0.0], [0.3, 0.0], [0.3, 0.2]]}}
scoring: [object, pose, map]
latency: {enabled: false}
stability: false
"""


@pytest.fixture(scope="module")
def made(once: Once) -> Path:
    """A mapper and a plain detector on two short runs of two receivers."""

    def make(folder: Path) -> None:
        (folder / "drives.yaml").write_text(reseeded(EXPERIMENT))
        run_experiment(read_experiment(folder / "drives.yaml"), folder / "run", jobs=1)

    return once("runs-of-mappers", make) / "run"


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> RunFolder:
    """A copy that may be changed."""
    shutil.copytree(made, tmp_path / "run")
    return RunFolder(tmp_path / "run")


def test_the_mapper_is_judged_on_runs_and_the_detector_on_captures(folder: RunFolder) -> None:
    table = folder.scores()
    scored = table[table["status"] == "scored"].groupby(["detector", "scoring"]).size().to_dict()
    assert scored == {("map-occupancy", "pose"): 2, ("map-occupancy", "map"): 2, ("paper-filtering", "object"): 4}
    reasons = table[table["status"] == "unscored"].groupby("detector")["reason"].first()
    assert "score it by 'pose' or 'map'" in reasons["map-occupancy"]
    assert "hands out no poses" in reasons["paper-filtering"]
    poses = table[table["scoring"] == "pose"].iloc[0]
    assert 0 < poses["ate_m"] < 0.1
    assert np.isnan(poses["tp"])


def test_every_registered_metric_of_runs_is_stored_by_its_name(folder: RunFolder) -> None:
    registered = set(registry.entries("metrics"))
    columns = set(folder.scores())
    for name, metric in (POSE_METRICS | MAP_METRICS).items():
        assert name in registered
        assert column_of(name, metric.unit) in columns


def test_a_stored_run_is_judged_again_and_checked(folder: RunFolder) -> None:
    before = folder.scores()
    assert not verify(folder).problems
    rescore(folder, folder.rules)
    assert folder.scores().equals(before)
    (folder.path / "maps" / next((folder.path / "maps").iterdir()).name).unlink()
    problems = " ".join(verify(RunFolder(folder.path)).problems)
    assert "maps/" in problems
    assert "is missing" in problems


def test_tables_have_columns_of_runs_and_say_how_many_there_are(folder: RunFolder) -> None:
    report = Report(folder)
    text = markdown(report)
    pose = text.split("pose scoring, as handed out on the way")[1].split("\n## ")[0]
    assert "ATE (cm)" in pose
    assert "precision" not in pose.split("\n* ")[0]
    assert "2 runs: no interval" in pose
    assert "ATE (cm) of each run, map-occupancy" in pose
    assert "chamfer (cm)" in text.split("map scoring, at the end")[1]
    mains = {board[2]: ranks.main for board, ranks in report.ranks.items()}
    assert mains == {"object": "f1", "pose": "ate", "map": "chamfer"}
    runs = {about["scoring"]: about["scenes"] for about, _ in report.estimates}
    assert (runs["pose"], runs["map"]) == (2, 2)


def test_runs_of_mappers_are_compared_and_stand_on_a_leaderboard(folder: RunFolder, made: Path) -> None:
    compared = compare(RunFolder(made), folder, "pose")
    assert {change.metric for change in compared.scores if change.board[2] == "pose"} >= {"ate", "end_error"}
    assert not compared.differs
    mains = {ranking.board[2]: ranking.main for ranking in rankings(suites(read_runs([made]))[0])}
    assert mains == {"object": "f1", "pose": "ate", "map": "chamfer"}
