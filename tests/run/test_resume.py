"""Continuing a run that was stopped, killed or damaged."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import psutil
import pytest

from uwbbench.api import StoreError, write_capture
from uwbbench.run import Interrupted, Progress, run_experiment
from uwbbench.run.experiment import Experiment
from uwbbench.run.folder import RunFolder

MakeExperiment = Callable[..., Experiment]
DetectorFile = Callable[..., Path]

SCRIPT = """\
import sys
from pathlib import Path
from uwbbench.run.experiment import read_experiment
from uwbbench.run import Interrupted, run_experiment
if __name__ == "__main__":
    try:
        run_experiment(read_experiment(sys.argv[1]), Path(sys.argv[2]), jobs=int(sys.argv[3]))
    except Interrupted as stop:
        sys.exit(str(stop))
"""
THREE = "[{use: approach, params: {speed_m_s: 3.0, runs: 3}}]"


def units_run(seen: list[Progress]) -> list[tuple[str, str]]:
    return [(step.entry.detector, step.entry.capture) for step in seen]


def test_a_finished_run_has_nothing_to_repeat(make_experiment: MakeExperiment, tmp_path: Path) -> None:
    experiment = make_experiment()
    before = run_experiment(experiment, tmp_path / "run", jobs=1).scores()
    seen: list[Progress] = []
    folder = run_experiment(experiment, tmp_path / "run", jobs=1, resume=True, progress=seen.append)
    assert seen == []
    pd.testing.assert_frame_equal(folder.scores(), before)
    assert len(folder.manifest["sessions"]) == 2


def test_after_a_torn_journal_only_the_torn_unit_runs_again(make_experiment: MakeExperiment, tmp_path: Path) -> None:
    experiment = make_experiment(datasets=THREE)
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    before = folder.scores()
    journal = folder.path / "journal.jsonl"
    journal.write_bytes(journal.read_bytes()[:-40])
    seen: list[Progress] = []
    run_experiment(experiment, tmp_path / "run", jobs=1, resume=True, progress=seen.append)
    assert units_run(seen) == [("paper-filtering", "approach-ch9-metal-3")]
    assert (seen[0].done, seen[0].total) == (6, 6)
    pd.testing.assert_frame_equal(folder.scores(), before)
    assert len(folder.damage) == 1


def test_failed_units_run_again(
    make_experiment: MakeExperiment, detector_file: DetectorFile, tmp_path: Path, misbehaving: Path
) -> None:
    step = f"{{use: misbehaving.raise, params: {{file: '{tmp_path / 'ready'}'}}}}"
    experiment = make_experiment(f"[oracle, {detector_file('late', step)}]")
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    assert {entry.status for entry in folder.entries()} == {"done", "failed"}
    (tmp_path / "ready").write_text("")
    seen: list[Progress] = []
    run_experiment(experiment, tmp_path / "run", jobs=1, resume=True, progress=seen.append)
    assert [name for name, _ in units_run(seen)] == ["late"]
    assert {entry.status for entry in folder.entries()} == {"done"}
    assert set(folder.scores()["status"]) == {"scored"}


def test_a_dataset_that_is_found_again_is_no_longer_a_failure(make_experiment: MakeExperiment, tmp_path: Path) -> None:
    capture = make_experiment().datasets[0].references()[0].open()
    experiment = make_experiment("[oracle]", datasets="[{use: capture, params: {files: ['later*.h5']}}]")
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    assert [(entry.kind, entry.status) for entry in folder.entries()] == [("listing", "failed")]
    write_capture(tmp_path / "later.h5", capture)
    run_experiment(experiment, tmp_path / "run", jobs=1, resume=True)
    assert {entry.status for entry in folder.entries()} == {"done"}
    assert set(folder.scores()["status"]) == {"scored"}


def test_a_capture_whose_content_changed_runs_again(make_experiment: MakeExperiment, tmp_path: Path) -> None:
    refs = make_experiment(datasets=THREE).datasets[0].references()
    for name, ref in zip("ab", refs, strict=False):
        write_capture(tmp_path / f"{name}.h5", ref.open())
    experiment = make_experiment("[oracle]", datasets="[{use: capture, params: {files: ['?.h5']}}]")
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    write_capture(tmp_path / "b.h5", refs[2].open())
    seen: list[Progress] = []
    run_experiment(experiment, tmp_path / "run", jobs=1, resume=True, progress=seen.append)
    assert units_run(seen) == [("oracle", "b")]
    assert folder.content(seen[0].entry.capture_id) == refs[2].open().sha256


def test_another_configuration_is_refused_and_named(make_experiment: MakeExperiment, tmp_path: Path) -> None:
    run_experiment(make_experiment(), tmp_path / "run", jobs=1)
    with pytest.raises(StoreError, match=r"another configuration \(different: gate_m, seed\)"):
        run_experiment(make_experiment(gate_m=0.1, seed=3), tmp_path / "run", jobs=1, resume=True)


def test_what_is_no_run_cannot_be_resumed(make_experiment: MakeExperiment, tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="is not a run folder"):
        run_experiment(make_experiment(), tmp_path / "nothing", resume=True)


def test_an_interrupted_serial_run_keeps_what_was_finished(make_experiment: MakeExperiment, tmp_path: Path) -> None:
    experiment = make_experiment(datasets=THREE)

    def stop(progress: Progress) -> None:
        if progress.done == 2:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted, match=r"continue with --resume .*run"):
        run_experiment(experiment, tmp_path / "run", jobs=1, progress=stop)
    folder = RunFolder(tmp_path / "run")
    assert [entry.status for entry in folder.entries()] == ["done", "done"]
    assert len(folder.scores()) == 4
    seen: list[Progress] = []
    run_experiment(experiment, tmp_path / "run", jobs=1, resume=True, progress=seen.append)
    assert len(seen) == 4


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_a_parallel_run_that_is_killed_or_interrupted_can_be_continued(
    make_experiment: MakeExperiment, detector_file: DetectorFile, tmp_path: Path, misbehaving: Path, how: signal.Signals
) -> None:
    slow = detector_file("slow", f"{{use: misbehaving.wait, params: {{file: '{tmp_path / 'ready'}'}}}}")
    experiment = make_experiment(f"[oracle, {slow}]", datasets=THREE)
    (tmp_path / "go.py").write_text(SCRIPT)
    command = [sys.executable, tmp_path / "go.py", tmp_path / "tiny.yaml", tmp_path / "run", "2"]
    process = subprocess.Popen(command, start_new_session=True, stderr=subprocess.PIPE, text=True)
    journal = tmp_path / "run" / "journal.jsonl"
    deadline = time.monotonic() + 180
    while not journal.exists() or not journal.read_bytes().endswith(b"\n"):
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < deadline, "no unit finished"
        time.sleep(0.05)
    os.killpg(process.pid, how)
    said = process.communicate(timeout=180)[1]
    if how == signal.SIGINT:
        assert process.returncode == 1
        assert f"continue with --resume {tmp_path / 'run'}" in said
        assert "Traceback" not in said, said
    done = [json.loads(line) for line in journal.read_text().splitlines()]
    assert done
    assert {entry["detector"] for entry in done} == {"oracle"}

    (tmp_path / "ready").write_text("")
    seen: list[Progress] = []
    folder = run_experiment(experiment, tmp_path / "run", jobs=1, resume=True, progress=seen.append)
    assert len(seen) == 6 - len(done)
    assert {entry.status for entry in folder.entries()} == {"done"}


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_workers_end_with_the_run_that_started_them(
    make_experiment: MakeExperiment, detector_file: DetectorFile, tmp_path: Path, misbehaving: Path, how: signal.Signals
) -> None:
    slow = detector_file("slow", f"{{use: misbehaving.wait, params: {{file: '{tmp_path / 'never'}'}}}}")
    make_experiment(f"[oracle, {slow}]", datasets=THREE)
    (tmp_path / "go.py").write_text(SCRIPT)
    command = [sys.executable, tmp_path / "go.py", tmp_path / "tiny.yaml", tmp_path / "run", "2"]
    process = subprocess.Popen(command, start_new_session=True, stderr=subprocess.DEVNULL)
    journal = tmp_path / "run" / "journal.jsonl"
    deadline = time.monotonic() + 180
    while not journal.exists() or not journal.read_bytes().endswith(b"\n"):
        assert time.monotonic() < deadline, "no unit finished"
        time.sleep(0.05)
    workers = psutil.Process(process.pid).children(recursive=True)
    assert workers
    process.send_signal(how)
    process.wait(timeout=180)
    _, alive = psutil.wait_procs(workers, timeout=180)
    assert not alive
