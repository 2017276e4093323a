"""A folder of results files as a detector of an experiment: run, resumed, verified, scored again and compared."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import uwbbench
from tests.fixtures.chance import seed
from uwbbench.api import ConfigError, ScoringError
from uwbbench.config.detector import DetectorConfig
from uwbbench.detect.results_folder import ResultsFolder
from uwbbench.results import Report
from uwbbench.results.comparison import compare
from uwbbench.run import Progress, rescore, run_experiment
from uwbbench.run.experiment import Experiment, read_experiment
from uwbbench.run.folder import RunFolder
from uwbbench.run.folder.scored import rules_of
from uwbbench.run.folder.verify import verify
from uwbbench.show.text.report import markdown

MakeExperiment = Callable[..., Experiment]
TWO = "[{use: approach, params: {speed_m_s: 3.0, runs: 2}}]"
CAPTURES = ("approach-ch9-metal-1", "approach-ch9-metal-2")


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    """Results of 'cfar-os' on two captures, as another program would write them."""
    folder = tmp_path / "mine"
    folder.mkdir()
    dataset, detector = (
        uwbbench.open_dataset("approach", {"speed_m_s": 3.0, "runs": 2, "seed": seed()}),
        uwbbench.load_detector("cfar-os"),
    )
    for name in CAPTURES:
        detector.run(dataset.open(name)).to_pandas().to_csv(folder / f"{name}.csv", index=False)
    return folder


@pytest.fixture
def experiment(make_experiment: MakeExperiment, mine: Path) -> Experiment:
    return make_experiment("[cfar-os, {results: mine}]", datasets=TWO, stability="true")


def reasons(folder: RunFolder) -> list[str]:
    return [entry.reason for entry in folder.entries() if entry.status == "failed"]


def test_results_read_from_files_score_as_those_of_the_detector_that_wrote_them(experiment, tmp_path):
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    assert reasons(folder) == []
    rows = folder.scores().set_index("detector").drop(columns=["capture", "dataset", "causes"])
    assert rows.loc["mine"].reset_index(drop=True).equals(rows.loc["cfar-os"].reset_index(drop=True))
    assert {e.detector for e in folder.entries() if e.kind == "stability"} == {"cfar-os"}
    assert verify(folder).passed, verify(folder).problems


def test_every_table_marks_them_and_the_notes_say_what_was_not_done(experiment, tmp_path):
    report = Report(run_experiment(experiment, tmp_path / "run", jobs=1))
    text = markdown(report)
    assert "| mine |" not in text
    assert text.count("| mine (results file) |") >= 4
    assert "mine: results file: read, not run; no time, and no hard cases (2 captures)" in text
    assert report.leaderboard.set_index("detector")["results_file"].to_dict() == {"mine": True, "cfar-os": False}


def test_only_what_has_changed_is_read_again(experiment, mine, tmp_path):
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    before = folder.manifest["detectors"]["mine"]
    with (mine / f"{CAPTURES[1]}.csv").open("a") as file:
        file.write("44,,3.0" + "," * 10 + "\n")
    seen: list[Progress] = []
    folder = run_experiment(experiment, tmp_path / "run", jobs=1, resume=True, progress=seen.append)
    assert [(step.entry.detector, step.entry.capture) for step in seen] == [("mine", CAPTURES[1])]
    assert folder.manifest["detectors"]["mine"] != before
    assert verify(folder).passed, verify(folder).problems


def test_a_missing_file_fails_its_unit_alone_and_can_be_added_later(experiment, mine, tmp_path):
    there = (mine / f"{CAPTURES[0]}.csv").rename(tmp_path / "away.csv")
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    assert [reason.split(": ", 2)[2] for reason in reasons(folder)] == [
        f"no results for capture '{CAPTURES[0]}' of 'approach': no {CAPTURES[0]}.csv or {CAPTURES[0]}.parquet. "
        f"Did you mean '{CAPTURES[1]}'?"
    ]
    there.rename(mine / f"{CAPTURES[0]}.csv")
    folder = run_experiment(experiment, tmp_path / "run", jobs=1, resume=True)
    assert reasons(folder) == []
    assert verify(folder).passed, verify(folder).problems


def test_another_hash_of_what_was_read_is_found_out(experiment, tmp_path):
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    journal = folder.path / "journal.jsonl"
    entries = [json.loads(line) for line in journal.read_text().splitlines()]
    for entry in entries:
        if "results_file" in entry["facts"]:
            entry["facts"]["results_file"]["sha256"] = "0" * 64
    journal.write_text("".join(json.dumps(entry) + "\n" for entry in entries))
    assert any("its identity is not that" in problem for problem in verify(RunFolder(folder.path)).problems)


def test_scores_can_be_made_again_without_the_files(experiment, mine, tmp_path):
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    for path in mine.iterdir():
        path.unlink()
    rescore(folder, rules_of({**folder.manifest["experiment"], "gate_m": 0.01}))
    f1 = folder.scores().groupby("detector")["f1"].mean()
    assert f1["mine"] == f1["cfar-os"] < 0.9
    assert verify(folder).passed


def test_the_folder_of_a_dataset_comes_first(make_experiment, mine, tmp_path):
    (mine / "second").mkdir()
    (mine / "second" / f"{CAPTURES[0]}.csv").write_text("frame,range_m\n")
    datasets = "[{use: approach, params: {speed_m_s: 3.0}}, {use: approach, name: second, params: {speed_m_s: 3.0}}]"
    folder = run_experiment(make_experiment("[{results: mine}]", datasets=datasets), tmp_path / "run", jobs=1)
    found = {entry.dataset: entry.facts["detections"] for entry in folder.entries()}
    assert found["second"] == 0 < found["approach"]


def test_reported_times_are_marked_and_kept(make_experiment, mine, tmp_path):
    lines = "".join(f"{frame},{10 + frame}\n" for frame in range(45))
    (mine / f"{CAPTURES[0]}.frames.csv").write_text(f"frame,time_us\n{lines}")
    made = make_experiment("[{results: mine}]", latency="true", stability="true")
    folder = run_experiment(made, tmp_path / "run", jobs=1)
    entry = folder.entries()[0]
    assert [(one.kind, one.status) for one in folder.entries()] == [("accuracy", "done")]
    np.testing.assert_array_equal(folder.times_us(entry.unit), np.arange(10.0, 55.0))
    assert entry.facts["reported_times"]["p50_us"] == 32
    assert "| 32.0 (as reported) |" in markdown(Report(folder))
    assert verify(folder).passed, verify(folder).problems
    entry.facts["reported_times"]["p50_us"] = 1.0
    folder.record(entry)
    assert any("p50_us 1.0, not 32.0" in problem for problem in verify(folder).problems)


def test_a_name_that_leads_out_of_the_folder_is_refused(mine, tmp_path):
    (tmp_path / "away.csv").write_text("frame,range_m\n")
    (mine / "link.csv").symlink_to(tmp_path / "away.csv")
    for name in ("../away", str(tmp_path / "away"), "link"):
        with pytest.raises(ScoringError, match="lies outside the folder of results"):
            ResultsFolder(DetectorConfig.of_results("mine", mine)).file_of("approach", name)


def test_a_file_in_both_formats_is_refused(make_experiment, mine, tmp_path):
    (mine / f"{CAPTURES[0]}.parquet").write_bytes(b"")
    folder = run_experiment(make_experiment("[{results: mine}]"), tmp_path / "run", jobs=1)
    assert [reason for reason in reasons(folder) if "lies beside it; keep one of them" in reason]


def test_other_results_under_the_same_name_are_a_difference_of_code(make_experiment, mine, tmp_path):
    made = make_experiment("[{results: mine}]")
    first = run_experiment(made, tmp_path / "first", jobs=1)
    (mine / f"{CAPTURES[0]}.csv").write_text("frame,range_m\n20,1.0\n")
    found = compare(first, run_experiment(made, tmp_path / "second", jobs=1))
    assert {change.where for change in found.changes if change.kind == "code"} == {
        "identity of detector mine",
        "sources of results of mine",
    }
    assert found.changed_scores
    assert found.label("mine") == "mine (results file)"


@pytest.mark.parametrize(
    ("item", "says"),
    [
        ("{results: nowhere}", r"tiny\.yaml:2: detectors\[0\]\.results: .*nowhere: no such folder"),
        (
            "{results: mine, nmae: own}",
            r"tiny\.yaml:2: detectors\[0\]\.nmae: unknown key 'nmae'. Did you mean 'name'\?",
        ),
        ("{results: mine, use: paper}", r"detectors\[0\]\.use: unknown key 'use'"),
        ("{results: [mine]}", r"detectors\[0\]\.results: Input should be a valid string"),
        ("{results: mine}, {results: mine}", r"detectors\[1\]: detector 'mine' appears twice"),
        ("{use: paper, nmae: own}", r"detectors\[0\]\.nmae: unknown key 'nmae'. Did you mean 'name'\?"),
        ("5", r"detectors\[0\]: Input should be a valid string, found 5"),
    ],
)
def test_a_mistake_in_the_experiment_is_one_message(make_experiment, mine, item, says):
    with pytest.raises(ConfigError, match=says) as refused:
        make_experiment(f"[{item}]")
    assert len(str(refused.value).splitlines()) == 1


def test_an_extended_experiment_keeps_the_folder_of_its_results(make_experiment, mine, tmp_path):
    make_experiment("[{results: mine, name: own}]")
    (tmp_path / "deeper").mkdir()
    (tmp_path / "deeper" / "child.yaml").write_text("extends: ../tiny.yaml\n")
    found = read_experiment(tmp_path / "deeper" / "child.yaml").detectors[0]
    assert (found.name, found.results) == ("own", mine)
