"""A run scored by tracks, beside a scoring of detections: stored, judged again, checked, compared and shown."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import uwbbench
from uwbbench.api import ConfigError
from uwbbench.results.comparison.compare import compare
from uwbbench.results.leaderboard.ranking import rankings
from uwbbench.results.leaderboard.runs import read_runs
from uwbbench.results.leaderboard.suites import suites
from uwbbench.results.report import Report
from uwbbench.run import rescore, run_experiment
from uwbbench.run.folder import RunFolder
from uwbbench.run.folder.verify import verify
from uwbbench.show.page import Content, page
from uwbbench.show.text.formats import as_json, write_csv
from uwbbench.show.text.report import markdown

FOLLOWER = '''
import numpy as np
from uwbbench.api import Params, Stage, ports

class FollowerParams(Params):
    jump_m: float = 0.3

class Follower(Stage[FollowerParams]):
    """Every detection is of the track that was last within a jump, else of a new one."""
    consumes = ports("detections", "range_m")
    produces = ports("detections", "track")
    def open(self, radar):
        super().open(radar)
        self._last = {}
    def step(self, block):
        numbers = []
        for range_m in block.detections.range_m.tolist():
            near = [n for n, at in self._last.items() if abs(at - range_m) < self.params.jump_m]
            number = near[0] if near else len(self._last)
            self._last[number] = range_m
            numbers.append(number)
        return block.replace(detections=block.detections.with_columns(track=np.array(numbers, np.int64)))
'''


@pytest.fixture
def make(install_plugin, make_experiment, tmp_path: Path):
    """Run of a detector without tracks and one with them."""
    install_plugin("follower", {"stages": {"track.follower": "follower:Follower"}}, {"follower.py": FOLLOWER})
    base = uwbbench.load_detector("paper-filtering").config.to_dict()
    step = "{use: track.follower, params: {jump_m: 0.3}}"

    def made(name: str = "run", **keys: Any) -> RunFolder:
        followed = tmp_path / "followed.yaml"
        steps = [f"  - {json.dumps(one)}" for one in base["pipeline"]]
        followed.write_text("\n".join(["schema: 1", "name: followed", "pipeline:", *steps, f"  - {step}"]) + "\n")
        keys = {"scoring": "[object, track]", "gate_m": 0.5, **keys}
        return run_experiment(make_experiment("[paper-filtering, followed.yaml]", **keys), tmp_path / name, jobs=1)

    return made


def test_each_scoring_has_its_own_columns_and_ranks_by_its_own_metric(make):
    folder = make()
    report = Report(folder)
    table = report.leaderboard.set_index(["scoring", "detector"])
    assert np.isfinite(table.loc[("track", "followed"), "gospa"])
    assert np.isnan(table.loc["object"]["gospa"]).all()
    assert {board[2]: ranks.main for board, ranks in report.ranks.items()} == {"object": "f1", "track": "gospa"}
    text = markdown(report)
    track, single = text.split("track scoring")[1], text.split("object scoring")[1].split("track scoring")[0]
    assert "GOSPA (cm)" in track
    assert "GOSPA" not in single
    ((entry, scoring, reason),) = report.unscored
    assert (entry.detector, scoring) == ("paper-filtering", "track")
    assert "no column 'track'" in reason


def test_a_stored_run_is_judged_again_and_checked(make):
    folder = make()
    before = folder.scores()
    row = before[(before["scoring"] == "track") & (before["status"] == "scored")].iloc[0]
    assert np.isfinite(row["gospa_m"])
    assert np.isnan(before[before["scoring"] == "object"]["gospa_m"]).all()
    assert not verify(folder).problems
    rescore(folder, folder.rules)
    assert folder.scores().equals(before)


@pytest.mark.slow  # draws every chart
def test_tables_and_page_of_a_run_hold_the_metrics_of_tracks(make, tmp_path):
    report = Report(make())
    assert [("gospa" in row, row["scoring"]) for row in as_json(report)["leaderboard"]].count((True, "track")) == 1
    write_csv(report, tmp_path / "tables")
    assert "gospa" in (tmp_path / "tables" / "leaderboard.csv").read_text()
    assert "GOSPA (cm)" in page(Content(report))


def test_a_metric_that_has_no_meaning_in_a_scoring_is_passed_over_there(make):
    report = Report(make(metrics="[confirmation_delay, track_rmse]"))
    assert {board[2]: ranks.main for board, ranks in report.ranks.items()} == {
        "object": "f1",
        "track": "confirmation_delay",
    }
    stored = report.folder.scores()
    assert "confirmation_delay" in stored
    assert not verify(report.folder).problems


def test_a_metric_that_has_a_meaning_in_no_scoring_of_the_experiment_is_refused(make):
    with pytest.raises(ConfigError, match=r"metric 'gospa' has no meaning in the scoring object.*it is for 'track'"):
        make(scoring="[object]", metrics="[gospa]")


def test_runs_scored_by_tracks_are_compared_and_ranked(make):
    first, second = make("first"), make("second", gate_m=0.5)
    compared = compare(first, second, "track")
    assert {change.metric for change in compared.scores if change.board[2] == "track"} >= {"gospa", "track_rmse", "f1"}
    assert not {change.metric for change in compared.scores if change.board[2] == "object"} & {"gospa", "track_rmse"}
    assert not compared.changed_scores
    runs = read_runs([first.path])
    mains = {ranking.board[2]: ranking.main for ranking in rankings(suites(runs)[0])}
    assert mains == {"object": "f1", "track": "gospa"}
