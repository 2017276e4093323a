"""What runs keep of when detections were handed out, and scores of the latest answers made of it."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from uwbbench.api import Detections
from uwbbench.measure.accuracy.scoring import ScoringRules, score
from uwbbench.results import Report
from uwbbench.run import rescore, run_experiment
from uwbbench.run.experiment import Experiment
from uwbbench.run.folder import RunFolder
from uwbbench.run.folder.tables import read_detections, write_detections
from uwbbench.run.folder.verify import verify
from uwbbench.show.text.report import markdown

MakeExperiment = Callable[..., Experiment]


@pytest.fixture
def run(make_experiment: MakeExperiment, tmp_path: Path) -> RunFolder:
    """A detector that answers at once and one that waits for its clusters, on a robot that drives 0.3 m/s."""
    datasets = "[{use: approach, params: {speed_m_s: 0.3}}]"
    experiment = make_experiment("[paper-filtering, paper]", datasets=datasets, scoring="[frame, latest]")
    return run_experiment(experiment, tmp_path / "run", jobs=1)


def test_latest_is_frame_for_a_detector_that_answers_at_once_and_worse_for_one_that_waits(run: RunFolder) -> None:
    scores = run.scores().set_index(["detector", "table", "scoring"]).sort_index()
    at_once, waits = (scores.loc[name, "filtering"] for name in ("paper-filtering", "paper"))
    same = [name for name in at_once if name not in ("status", "reason", "causes")]
    assert at_once.loc["latest", same].equals(at_once.loc["frame", same])
    assert waits.loc["latest", "f1"] < waits.loc["frame", "f1"] - 0.1
    rows = Report(run).leaderboard
    assert set(rows["scoring"]) == {"frame", "latest"}
    assert "latest scoring" in markdown(Report(run))
    assert verify(run).problems == ()


def test_a_run_can_be_scored_by_its_latest_answers_later(run: RunFolder) -> None:
    before = run.scores()
    rescore(run, [ScoringRules("frame")])
    rescore(run, [ScoringRules("frame"), ScoringRules("latest")])
    assert run.scores().equals(before)


def test_scores_of_the_latest_answers_follow_from_what_is_stored(run: RunFolder) -> None:
    (entry,) = [entry for entry in run.entries() if entry.detector == "paper"]
    stored = run.detections(entry.unit)
    assert stored.answered is not None
    assert np.array_equal(stored.answered, stored.processed)
    assert stored["handed_out"].dtype == np.int64
    header = run.header(entry.capture_id)
    found = score(stored, header, "latest").filtering
    row = run.scores().query("detector == 'paper' and scoring == 'latest' and table == 'filtering'").iloc[0]
    assert (row["tp"], row["fp"], row["fn"]) == (found.tp, found.fp, found.fn)


def test_detections_of_earlier_versions_are_not_scored_by_latest_with_the_reason(
    run: RunFolder, tmp_path: Path
) -> None:
    earlier = RunFolder(shutil.copytree(run.path, tmp_path / "earlier"))
    for path in (earlier.path / "detections").iterdir():
        table = pq.read_table(path).drop_columns(["handed_out"])
        facts = json.loads(table.schema.metadata[b"uwbbench"])
        del facts["answered"]
        pq.write_table(table.replace_schema_metadata({b"uwbbench": json.dumps(facts)}), path)
    rescore(earlier)
    rows = earlier.scores().to_dict("records")
    assert {row["status"] for row in rows if row["scoring"] == "frame"} == {"scored"}
    reasons = [row["reason"] for row in rows if row["scoring"] == "latest" and row["status"] == "unscored"]
    assert len(reasons) == 2
    assert all("it is not known when these detections were handed out" in reason for reason in reasons)


def test_a_wait_of_whole_frames_is_stored_and_read(tmp_path: Path) -> None:
    found = Detections([0, 2], range_m=[1.0, 2.0], processed=[0, 1, 2]).with_hand_outs([2, 3], [2, 3, 3])
    write_detections(tmp_path / "a.parquet", found)
    again = read_detections(tmp_path / "a.parquet")
    assert again["handed_out"].tolist() == [2, 3]
    assert again.answered is not None
    assert again.answered.tolist() == [2, 3, 3]
