"""``run``, ``report`` and ``rescore``, on captures of less than a second."""

import json
import os
import pty
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

EXPERIMENT = """\
schema: 1
name: small
detectors: [./simple.yaml, oracle, "null"]
datasets:
  - {use: capture, params: {files: ["*.h5"]}}
scoring: [frame, object]
latency: false
stability: false
intervals: {resamples: 100}
"""


@pytest.fixture
def experiment(tmp_path: Path, capture: Path, detector: Path) -> Path:
    """Three detectors on one capture."""
    (tmp_path / "small.yaml").write_text(EXPERIMENT)
    return tmp_path / "small.yaml"


def leaderboard(text: str) -> dict[tuple[str, str, str], dict]:
    rows = json.loads(text, parse_constant=pytest.fail)["leaderboard"]
    return {(row["scoring"], row["table"], row["detector"]): row for row in rows}


def test_run_prints_a_table_and_leaves_a_run_folder(uwbbench, experiment: Path, tmp_path: Path) -> None:
    text = uwbbench("run", experiment, "--out", "first", "--jobs", 1).stdout
    assert "capture, SIMULATED" in text
    assert all(name in text for name in ("simple", "oracle", "null"))
    assert "run folder: first" in text
    assert (tmp_path / "first" / "manifest.json").is_file()
    assert "# small" in (tmp_path / "first" / "report.md").read_text()


def test_run_json_is_one_object_with_nulls(uwbbench, experiment: Path) -> None:
    rows = leaderboard(uwbbench("run", "small.yaml", "--jobs", 1, "--out", "first", "--json").stdout)
    assert rows["frame", "filtering", "oracle"]["recall"]["value"] == 1.0
    assert rows["frame", "filtering", "null"]["precision"]["value"] is None
    assert ("object", "filtering", "simple") in rows


def test_report_and_rescore_work_without_captures_and_detectors(uwbbench, experiment, capture, detector) -> None:
    first = leaderboard(uwbbench("run", "small.yaml", "--jobs", 1, "--out", "first", "--json").stdout)
    capture.unlink()
    detector.unlink()
    assert leaderboard(uwbbench("report", "first", "--json").stdout) == first
    assert "By channel and material" in uwbbench("report", "first").stdout
    words = ("rescore", "first", "--scoring", "frame", "--gate-m", "0.0005", "--json")
    again = leaderboard(uwbbench(*words).stdout)
    assert {key[0] for key in again} == {"frame"}
    assert (
        again["frame", "filtering", "simple"]["precision"]["value"]
        < first["frame", "filtering", "simple"]["precision"]["value"]
    )
    assert leaderboard(uwbbench("report", "first", "--json").stdout) == again


def test_a_broken_capture_is_a_failed_row_and_exit_code_3(uwbbench, experiment: Path, tmp_path: Path) -> None:
    (tmp_path / "broken.h5").write_text("no HDF5")
    result = uwbbench("run", "small.yaml", "--jobs", 1, "--out", "first", code=3)
    assert "failed: accuracy: simple on broken" in result.stderr
    assert "3 units failed" in result.stderr
    assert "oracle" in result.stdout
    assert len(json.loads(uwbbench("report", "first", "--json").stdout)["failures"]) == 3


def test_a_capture_without_truth_is_not_scored_and_no_failure(uwbbench, experiment, capture_without_truth) -> None:
    (experiment.parent / "small.yaml").write_text(EXPERIMENT.replace("oracle, ", ""))
    assert "no ground truth" in uwbbench("run", "small.yaml", "--jobs", 1, "--out", "first").stderr


def test_set_changes_the_experiment(uwbbench, experiment: Path) -> None:
    words = ("run", "small.yaml", "--jobs", 1, "--out", "first", "--json", "--set", "scoring=object")
    assert {key[0] for key in leaderboard(uwbbench(*words).stdout)} == {"object"}


def test_data_dir_is_where_datasets_are_searched(uwbbench, experiment: Path, capture: Path, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    capture.rename(tmp_path / "elsewhere" / "run.h5")
    uwbbench("run", "small.yaml", "--jobs", 1, "--out", "a", code=3)
    uwbbench("run", "small.yaml", "--jobs", 1, "--out", "b", "--data-dir", "elsewhere")


def test_resume_repeats_only_what_failed(uwbbench, experiment: Path, capture: Path, tmp_path: Path) -> None:
    good = capture.read_bytes()
    (tmp_path / "second.h5").write_bytes(good[:5000])
    uwbbench("run", "small.yaml", "--jobs", 1, "--out", "first", code=3)
    (tmp_path / "second.h5").write_bytes(good)
    lines = len((tmp_path / "first/journal.jsonl").read_text().splitlines())
    uwbbench("run", "small.yaml", "--jobs", 1, "--resume", "first")
    assert len((tmp_path / "first/journal.jsonl").read_text().splitlines()) == lines + 3


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["run", "gone.yaml"], "gone.yaml: no such file"),
        (["run", "dmeo"], "no experiment named 'dmeo'"),
        (["run", "small.yaml", "--set", "gate=1"], "Did you mean 'gate_m'?"),
        (["run", "small.yaml", "--jobs", "0"], "--jobs"),
        (["run", "small.yaml", "--out", "a", "--resume", "b"], "give one of them"),
        (["run", "small.yaml", "--resume", "gone"], "gone"),
        (["run", "small.yaml", "--out", "."], "not empty"),
        (["report", "gone"], "gone: is not a run folder"),
        (["rescore", "."], "is not a run folder"),
    ],
)
def test_wrong_words_are_usage_errors(uwbbench, experiment: Path, words: list[str], says: str) -> None:
    result = uwbbench(*words, code=2)
    assert says in result.stderr
    assert result.stdout == ""


def test_rescoring_with_an_impossible_gate_is_a_usage_error(uwbbench, experiment: Path) -> None:
    uwbbench("run", "small.yaml", "--jobs", 1, "--out", "first")
    assert "gate_m must be positive" in uwbbench("rescore", "first", "--gate-m", 0, code=2).stderr


@pytest.mark.slow
def test_progress_is_shown_on_a_terminal_and_stdout_stays_pure(experiment: Path, tmp_path: Path) -> None:
    terminal, theirs = pty.openpty()
    command = [sys.executable, "-m", "uwbbench.cli", "run", "small.yaml", "--jobs", "1", "--out", "first", "--json"]
    printed = tmp_path / "printed.json"  # a pipe that nobody empties would hold the command up
    with printed.open("wb") as out, subprocess.Popen(command, cwd=tmp_path, stdout=out, stderr=theirs) as running:
        os.close(theirs)
        shown = b""
        try:
            while part := os.read(terminal, 4096):
                shown += part
        except OSError:  # Linux's way of saying that the other end is closed
            pass
    os.close(terminal)
    assert running.returncode == 0
    assert b"3/3" in shown
    assert leaderboard(printed.read_text())


@pytest.mark.slow
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_interrupting_a_run_keeps_what_is_finished(experiment: Path, capture: Path, tmp_path: Path, jobs: str) -> None:
    for copy in range(20):
        (tmp_path / f"copy-{copy}.h5").write_bytes(capture.read_bytes())
    command = [sys.executable, "-m", "uwbbench.cli", "run", "small.yaml", "--jobs", jobs, "--out", "first"]
    running = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    journal, deadline = tmp_path / "first/journal.jsonl", time.monotonic() + 180
    while not journal.exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    os.killpg(running.pid, signal.SIGINT)  # as Ctrl-C in a terminal does
    _, message = running.communicate(timeout=180)
    assert running.returncode == 130
    assert "continue with --resume first" in message
    assert "Traceback" not in message
    assert "Warning" not in message
    assert json.loads(journal.read_text().splitlines()[0])["status"] == "done"
