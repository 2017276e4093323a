"""Running experiments: what is stored, what fails alone, what is refused."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from uwbbench.api import StoreError
from uwbbench.detect.pipeline import load_detector
from uwbbench.measure.accuracy.scoring import Region, ScoringRules, score
from uwbbench.run import Progress, rescore, run_experiment
from uwbbench.run.experiment import Experiment
from uwbbench.run.folder import RunFolder
from uwbbench.run.folder.scored import causes_of

MakeExperiment = Callable[..., Experiment]
DetectorFile = Callable[..., Path]


def test_stored_detections_and_scores_are_those_of_a_direct_run(
    make_experiment: MakeExperiment, tmp_path: Path
) -> None:
    experiment = make_experiment(scoring="[frame, peak]")
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    capture = experiment.datasets[0].references()[0].open()
    found = load_detector("paper-filtering").run(capture)
    (entry,) = [entry for entry in folder.entries() if entry.detector == "paper-filtering"]
    stored = folder.detections(entry.unit)
    for name, values in found.columns.items():
        np.testing.assert_array_equal(stored.columns[name], values)
    np.testing.assert_array_equal(stored.processed, found.processed)
    scores = folder.scores().set_index(["detector", "scoring"])
    for scoring in ("frame", "peak"):
        expected = score(found, capture, scoring).filtering
        row = scores.loc["paper-filtering", scoring]
        assert (row["tp"], row["fp"], row["fn"]) == (expected.tp, expected.fp, expected.fn)
        assert row["mae_m"] == expected.mae_m
    assert entry.facts["sha256"] == capture.sha256


@pytest.mark.slow
def test_parallel_and_serial_runs_give_the_same_scores(make_experiment: MakeExperiment, tmp_path: Path) -> None:
    experiment = make_experiment(datasets="[{use: approach, params: {speed_m_s: 3.0, runs: 3}}]")
    seen: list[Progress] = []
    serial = run_experiment(experiment, tmp_path / "serial", jobs=1, progress=seen.append)
    parallel = run_experiment(experiment, tmp_path / "parallel", jobs=2)
    pd.testing.assert_frame_equal(serial.scores(), parallel.scores())
    assert [(step.done, step.total) for step in seen] == [(number, 6) for number in range(1, 7)]


def test_the_manifest_tells_what_ran_where(make_experiment: MakeExperiment, tmp_path: Path) -> None:
    experiment = make_experiment()
    manifest = run_experiment(experiment, tmp_path / "run", jobs=1).manifest
    assert manifest["experiment"] == json.loads(json.dumps(experiment.to_dict()))
    assert manifest["detectors"]["oracle"] == load_detector("oracle").identity
    assert list(manifest["data"].values()) == [experiment.datasets[0].references()[0].open().sha256]
    (session,) = manifest["sessions"]
    assert {"python", "uwbbench", "numpy", "scipy", "scikit-learn"} <= set(session["versions"])
    assert {"cpu", "cores", "os"} <= set(session["machine"])


def test_a_detector_that_does_not_fit_a_capture_is_a_failed_row(
    make_experiment: MakeExperiment, detector_file: DetectorFile, tmp_path: Path
) -> None:
    steps = ("{use: first_path.crest}", "{use: profile.amplitude}", "{use: peaks}", "{use: pdoa}", "{use: range}")
    broken = detector_file("needs-sts", *steps)
    experiment = make_experiment(
        f"[oracle, {broken}]", datasets="[{use: approach, params: {speed_m_s: 3.0, sts: false}}]"
    )
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    by_name = {entry.detector: entry for entry in folder.entries()}
    assert by_name["oracle"].status == "done"
    assert by_name["needs-sts"].status == "failed"
    assert by_name["needs-sts"].reason.startswith("ConfigError: ")
    assert "STS" in by_name["needs-sts"].reason
    assert "Traceback" in by_name["needs-sts"].traceback
    rows = folder.scores().set_index("detector")
    assert rows.loc["needs-sts", "status"] == "failed"
    assert set(rows.loc["oracle", "status"]) == {"scored"}


def test_a_capture_that_cannot_be_opened_fails_alone(make_experiment: MakeExperiment, tmp_path: Path) -> None:
    (tmp_path / "broken.h5").write_bytes(b"not hdf5")
    files = "{use: capture, params: {files: ['*.h5']}}"
    experiment = make_experiment("[oracle]", datasets=f"[{{use: approach, params: {{speed_m_s: 3.0}}}}, {files}]")
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    statuses = {entry.dataset: (entry.status, entry.reason) for entry in folder.entries()}
    assert statuses["approach"] == ("done", "")
    assert statuses["capture"][0] == "failed"
    assert "broken.h5" in statuses["capture"][1]


def test_a_dataset_that_cannot_be_listed_is_a_failed_row(
    make_experiment: MakeExperiment, tmp_path: Path, misbehaving: Path
) -> None:
    approach = "{use: approach, params: {speed_m_s: 3.0}}"
    experiment = make_experiment("[oracle]", datasets=f"[{{use: misbehaving.listing}}, {approach}]")
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    rows = folder.scores()
    failed = rows[rows["status"] == "failed"]
    assert failed["dataset"].tolist() == ["misbehaving.listing"]
    assert failed["reason"].tolist() == ["RuntimeError: the shelf is empty"]
    assert len(rows) > 1


def test_an_exception_of_a_stage_is_a_failed_row_with_its_traceback(
    make_experiment: MakeExperiment, detector_file: DetectorFile, tmp_path: Path, misbehaving: Path
) -> None:
    experiment = make_experiment(f"[{detector_file('bad', '{use: misbehaving.raise}')}, oracle]")
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    entry = next(entry for entry in folder.entries() if entry.detector == "bad")
    assert entry.reason == "ValueError: no luck today | at all"
    assert 'raise ValueError("no luck' in entry.traceback
    assert {entry.detector for entry in folder.entries() if entry.status == "done"} == {"oracle"}


@pytest.mark.slow
def test_a_stage_that_kills_its_process_fails_alone(
    make_experiment: MakeExperiment, detector_file: DetectorFile, tmp_path: Path, misbehaving: Path
) -> None:
    crash = detector_file("crash", "{use: misbehaving.crash}")
    experiment = make_experiment(f"[{crash}, oracle, 'null']")
    folder = run_experiment(experiment, tmp_path / "run", jobs=2)
    statuses = {entry.detector: entry.status for entry in folder.entries()}
    assert statuses == {"crash": "failed", "oracle": "done", "null": "done"}
    (reason,) = [entry.reason for entry in folder.entries() if entry.status == "failed"]
    assert reason == "its process ended itself (exit code 7)"


def test_a_capture_without_truth_is_detected_on_and_said_to_be_unscored(
    make_experiment: MakeExperiment, tmp_path: Path
) -> None:
    from uwbbench.api import write_capture

    experiment = make_experiment()
    capture = experiment.datasets[0].references()[0].open()
    write_capture(tmp_path / "blind.h5", dataclasses.replace(capture, truth=None))
    blind = make_experiment("[paper-filtering]", datasets="[{use: capture, params: {files: [blind.h5]}}]")
    folder = run_experiment(blind, tmp_path / "run", jobs=1)
    (entry,) = folder.entries()
    assert entry.status == "done"
    assert len(folder.detections(entry.unit)) > 0
    rows = folder.scores()
    assert set(rows["status"]) == {"unscored"}
    assert rows["reason"].str.contains("no ground truth").all()


@pytest.mark.parametrize("name", ["a/../b", "\"'`|<b>\n", "n" * 10_000, "..", "con", "ü\u202e🙂"])
def test_hostile_names_are_stored_and_scored(
    make_experiment: MakeExperiment, detector_file: DetectorFile, tmp_path: Path, name: str
) -> None:
    path = detector_file(name, "{use: reference.nothing}")
    folder = run_experiment(make_experiment(f"[{path}]"), tmp_path / "run", jobs=1)
    (entry,) = folder.entries()
    assert (entry.detector, entry.status) == (name, "done")
    assert set(folder.scores()["detector"]) == {name}
    written = {path.relative_to(tmp_path / "run").as_posix() for path in (tmp_path / "run").rglob("*")}
    assert all(len(path) < 60 for path in written)


def test_scoring_again_gives_what_the_run_gave(make_experiment: MakeExperiment, tmp_path: Path) -> None:
    experiment = make_experiment("[paper, 'null']", scoring="[frame, object, peak]")
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    before = folder.scores()
    (tmp_path / "tiny.yaml").unlink()
    rescore(RunFolder(folder.path))
    pd.testing.assert_frame_equal(folder.scores(), before)


def test_scoring_again_with_other_rules_is_scoring_with_those_rules(
    make_experiment: MakeExperiment, tmp_path: Path
) -> None:
    folder = run_experiment(make_experiment("[paper-filtering]"), tmp_path / "loose", jobs=1)
    strict = run_experiment(
        make_experiment("[paper-filtering]", gate_m=0.03, scoring="frame", region="{max_range_m: 2.0}"),
        tmp_path / "strict",
        jobs=1,
    )
    rules = [ScoringRules("frame", 0.03, Region(0.6, 2.0))]
    assert folder.scores()["tp"].iloc[0] != strict.scores()["tp"].iloc[0]
    rescore(folder, rules)
    pd.testing.assert_frame_equal(folder.scores().drop(columns="causes"), strict.scores().drop(columns="causes"))
    assert folder.rules == rules


def test_causes_of_misses_are_kept_under_the_same_rules_and_not_known_under_others(
    make_experiment: MakeExperiment, tmp_path: Path
) -> None:
    folder = run_experiment(make_experiment("[paper-filtering]", scoring="object"), tmp_path / "run", jobs=1)
    before = folder.scores()["causes"].tolist()
    rule = folder.rules[0]
    rescore(folder)
    assert folder.scores()["causes"].tolist() == before
    assert folder.curve(folder.entries()[0].unit, rule) is not None
    other = dataclasses.replace(rule, gate_m=0.03)
    rescore(folder, [other])
    misses = [causes_of(row).misses for row in folder.scores().to_dict("records")]
    assert {cause for causes in misses for cause in causes} == {"not known"}
    assert folder.curve(folder.entries()[0].unit, other) is None


def test_peak_scoring_of_a_run_without_candidates_is_a_row_with_the_reason(
    make_experiment: MakeExperiment, tmp_path: Path
) -> None:
    folder = run_experiment(make_experiment("[paper-filtering]", scoring="frame"), tmp_path / "run", jobs=1)
    rescore(folder, [ScoringRules("peak")])
    (row,) = folder.scores().to_dict("records")
    assert row["status"] == "unscored"
    assert "peaks before the filters" in row["reason"]


def test_a_folder_in_use_is_refused_before_anything_runs(make_experiment: MakeExperiment, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "notes.txt").write_text("mine")
    with pytest.raises(StoreError, match="already exists and is not empty"):
        run_experiment(make_experiment(), tmp_path / "run")
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["notes.txt"]


def test_results_that_cannot_be_stored_stop_the_run(make_experiment: MakeExperiment, tmp_path: Path) -> None:
    def block(_: Progress) -> None:  # a file where the next unit needs a folder
        folder = tmp_path / "run" / "detections"
        for path in folder.iterdir():
            path.unlink()
        folder.rmdir()
        folder.write_text("")

    with pytest.raises(StoreError, match="detections"):
        run_experiment(make_experiment(), tmp_path / "run", jobs=1, progress=block)


def test_the_default_folder_has_a_safe_name(
    make_experiment: MakeExperiment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = run_experiment(make_experiment("['null']", name="'../a b/|c'"), jobs=1)
    assert folder.path.parent == Path("runs")
    assert folder.path.name.startswith("a-b-c-")


@pytest.mark.slow
def test_latency_is_measured_after_accuracy_and_stored_with_every_call(
    make_experiment: MakeExperiment, tmp_path: Path
) -> None:
    experiment = make_experiment("['null']", latency="{reference: null, frames: 20}")
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    assert [entry.kind for entry in folder.entries()] == ["accuracy", "latency"]
    entry = folder.entries()[1]
    assert entry.status == "done", entry.reason
    times_us = folder.times_us(entry.unit)
    assert len(times_us) == entry.facts["n"] == 20
    assert np.median(times_us) == entry.facts["p50_us"]


def test_a_latency_pass_that_fails_is_a_failed_row(make_experiment: MakeExperiment, tmp_path: Path) -> None:
    experiment = make_experiment("['null']", latency="{reference: null, timeout_s: 0.01}")
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    (entry,) = [entry for entry in folder.entries() if entry.kind == "latency"]
    assert entry.status == "failed"
    assert "LatencyError" in entry.traceback


def test_what_cannot_be_run_is_not_timed(
    make_experiment: MakeExperiment, detector_file: DetectorFile, tmp_path: Path, misbehaving: Path
) -> None:
    bad = detector_file("bad", "{use: misbehaving.raise}")
    folder = run_experiment(make_experiment(f"[{bad}]", latency="{reference: null}"), tmp_path / "run", jobs=1)
    accuracy, latency = folder.entries()
    assert "ValueError: no luck" in accuracy.traceback
    assert (latency.status, latency.reason) == ("failed", "not timed, as it could not be run")


def test_a_detector_that_breaks_over_the_hard_cases_is_a_failed_row_and_the_others_are_examined(
    make_experiment: MakeExperiment, detector_file: DetectorFile, tmp_path: Path, misbehaving: Path
) -> None:
    bad = detector_file("bad", "{use: misbehaving.raise}")
    experiment = make_experiment(f"[{bad}, 'null']", stability="true")
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    examined = {entry.detector: entry for entry in folder.entries() if entry.kind == "stability"}
    assert (examined["bad"].status, examined["null"].status) == ("failed", "done")
    assert "no luck" in examined["bad"].reason
    assert examined["null"].facts["failed"] == 0


@pytest.mark.slow
def test_a_detector_that_kills_its_process_over_the_hard_cases_does_not_end_the_run(
    make_experiment: MakeExperiment, detector_file: DetectorFile, tmp_path: Path, misbehaving: Path
) -> None:
    bad = detector_file("bad", "{use: misbehaving.crash}")
    experiment = make_experiment(f"[{bad}, 'null']", stability="true")
    folder = run_experiment(experiment, tmp_path / "run", jobs=2)
    status = {(entry.kind, entry.detector): entry.status for entry in folder.entries()}
    assert status["stability", "bad"] == "failed"
    assert status["accuracy", "null"] == "done"
