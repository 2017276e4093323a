"""``uwbbench tune`` as a user calls it."""

import json
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest
import yaml

from uwbbench.detect.pipeline import load_detector

pytestmark = pytest.mark.slow

TUNE = """\
schema: 1
detector: paper
grid:
  pipeline.filter.prominence.params.minimum: [0.01, 0.03, 0.1]
  pipeline.filter.width.params.minimum: {start: 0.5, stop: 2.5, count: 3}
tuning:
  - {use: approach, params: {material: concrete, frame_rate_hz: 8, seed: 1}}
held_out:
  - {use: approach, params: {material: concrete, frame_rate_hz: 8, seed: 2}}
groups: [material, overall]
intervals: {resamples: 100}
"""
SEARCH = """\
schema: 1
detector: paper-filtering
search:
  space: {pipeline.filter.width.params.minimum: {low: 0, high: 3}}
  trials: 3
  seed: 7
tuning: [{use: approach, params: {frame_rate_hz: 8, seed: 1}}]
held_out: [{use: approach, params: {frame_rate_hz: 8, seed: 2}}]
groups: [overall]
intervals: {resamples: 100}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "own.yaml"
    path.write_text(TUNE)
    return path


def test_a_tuning_leaves_detectors_all_sets_manifest_and_summary(uwbbench, file, tmp_path):
    printed = uwbbench("tune", file, "-o", "tuned").stdout
    folder = tmp_path / "tuned"
    names = {"manifest.json", "sets.parquet", "summary.md", "paper-tuned-concrete.yaml", "paper-tuned-overall.yaml"}
    assert {path.name for path in folder.iterdir()} == names
    assert "SIMULATED" in printed
    assert "held-out F1 tuned" in printed
    table = pq.read_table(folder / "sets.parquet").to_pandas()
    assert len(table) == 2 * 9
    assert table.groupby("group")["chosen"].sum().tolist() == [1, 1]
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["tuning"]["detector"]["name"] == "paper"
    assert len(manifest["captures"]["tuning"][0]["sha256"]) == 64
    assert manifest["optuna"] is None
    assert manifest["results"][0]["stable_zone"]["share"] == table[table["group"] == "concrete"]["stable"].mean()
    assert "| concrete | 9 |" in (folder / "summary.md").read_text()


def test_tuned_thresholds_are_a_detector_that_can_be_run_and_tells_what_it_was_tuned_on(uwbbench, file, tmp_path):
    result = json.loads(uwbbench("tune", file, "-o", "tuned", "--json").stdout)
    group = result["groups"][0]
    detector = load_detector(result["detectors"][0])
    assert detector.identity == group["identity"]
    params = {f"pipeline.{step.label}.params": step.params for step in detector.config.steps}
    for path, value in group["values"].items():
        step, _, name = path.rpartition(".")
        assert params[step][name] == value
    about = detector.config.description
    assert "concrete" in about
    assert "simulated" in about
    assert f"F1 {group['tuning']['after']['f1']:.3f} there" in about
    assert f"{group['held_out']['after']['f1']:.3f} on 1 simulated capture held out" in about
    (tmp_path / "run.yaml").write_text(
        "schema: 1\ndetectors: [tuned/paper-tuned-concrete.yaml]\nlatency: false\nstability: false\n"
        "datasets: [{use: approach, params: {material: concrete, frame_rate_hz: 8, seed: 2}}]\nscoring: frame\n"
    )
    uwbbench("run", "run.yaml", "--out", "run", "--jobs", "1", "--quiet")
    scored = pq.read_table(tmp_path / "run" / "scores.parquet").to_pandas()
    of_run = scored[scored["table"] == "filtering"]["f1"].item()
    assert of_run == pytest.approx(group["held_out"]["after"]["f1"])


def test_a_detector_beside_the_file_is_extended_by_its_path_from_the_new_folder(uwbbench, file, tmp_path):
    (tmp_path / "mine.yaml").write_text("schema: 1\nextends: paper\nname: mine\n")
    file.write_text(TUNE.replace("detector: paper", "detector: mine.yaml"))
    result = json.loads(uwbbench("tune", file, "-o", "deep/er", "--json").stdout)
    assert yaml.safe_load(Path(result["detectors"][0]).read_text())["extends"] == "../../mine.yaml"
    assert load_detector(tmp_path / result["detectors"][0]).name == "mine-tuned-concrete"


def test_json_is_one_value_and_nothing_else(uwbbench, file):
    result = json.loads(uwbbench("tune", file, "-o", "tuned", "--json").stdout)
    assert result["scoring"] == "frame"
    assert result["folder"] == "tuned"
    assert set(result["groups"][0]["held_out"]["after"]) >= {"f1", "f1_low", "rmse_m", "tp", "captures"}


def test_a_figure_of_the_stable_zone_is_drawn(uwbbench, file, tmp_path):
    uwbbench("tune", file, "-o", "tuned", "--figure", "zone.png")
    assert (tmp_path / "zone.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--figure", "zone.txt"], "expected .png or .svg or .pdf"),
        (["--set", "gate_m=-1"], "gate_m"),
        (["--experiment", "dmo"], "no experiment named 'dmo'. Did you mean 'demo'?"),
    ],
)
def test_mistakes_are_told_before_anything_is_made(uwbbench, file, tmp_path, options, message):
    assert message in uwbbench("tune", file, "-o", "tuned", *options, code=2).stderr
    assert not (tmp_path / "tuned").exists()


def test_a_folder_that_holds_something_is_not_overwritten(uwbbench, file, tmp_path):
    (tmp_path / "tuned").mkdir()
    (tmp_path / "tuned" / "mine.txt").write_text("keep")
    assert "not empty" in uwbbench("tune", file, "-o", "tuned", code=2).stderr
    assert [path.name for path in (tmp_path / "tuned").iterdir()] == ["mine.txt"]


def test_tuning_on_what_an_experiment_scores_is_refused(uwbbench, file, tmp_path):
    (tmp_path / "scores.yaml").write_text(
        "schema: 1\ndetectors: ['null']\n"
        "datasets: [{use: approach, name: test set, params: {material: concrete, frame_rate_hz: 8, seed: 1}}]\n"
    )
    message = uwbbench("tune", file, "-o", "tuned", "--experiment", "scores.yaml", code=2).stderr
    assert "experiment 'scores' scores captures that would be tuned on: 'test set: " in message


def test_a_search_records_trials_sampler_and_seed(uwbbench, tmp_path):
    pytest.importorskip("optuna")
    (tmp_path / "search.yaml").write_text(SEARCH)
    uwbbench("tune", "search.yaml", "-o", "tuned")
    recorded = json.loads((tmp_path / "tuned" / "manifest.json").read_text())["optuna"]
    assert {key: recorded[key] for key in ("trials", "sampler", "seed")} == {"trials": 3, "sampler": "tpe", "seed": 7}
    assert pq.read_table(tmp_path / "tuned" / "sets.parquet").num_rows == 3


def test_choices_of_several_types_are_stored_as_text(uwbbench, tmp_path):
    pytest.importorskip("optuna")
    window, bias = "pipeline.peaks.params.window_taps", "pipeline.range.params.bias_m"
    choices = f"{{{window}: {{choices: [null, 9]}}, {bias}: {{choices: [0.1, paper]}}}}"
    text = SEARCH.replace("{pipeline.filter.width.params.minimum: {low: 0, high: 3}}", choices)
    (tmp_path / "search.yaml").write_text(text.replace("trials: 3", "trials: 8"))
    uwbbench("tune", "search.yaml", "-o", "tuned")
    table = pq.read_table(tmp_path / "tuned" / "sets.parquet").to_pandas()
    assert set(table[bias]) == {"0.1", "paper"}
    assert set(table[window].dropna()) == {9}


def test_a_search_without_optuna_tells_how_to_install_it(uwbbench, tmp_path, monkeypatch):
    (tmp_path / "search.yaml").write_text(SEARCH)
    monkeypatch.setitem(sys.modules, "optuna", None)
    assert "pip install 'uwbbench[tune]'" in uwbbench("tune", "search.yaml", "-o", "tuned", code=2).stderr


def test_a_search_has_no_stable_zone_to_draw(uwbbench, tmp_path):
    (tmp_path / "search.yaml").write_text(SEARCH)
    message = uwbbench("tune", "search.yaml", "-o", "tuned", "--figure", "zone.png", code=2).stderr
    assert "a search has none" in message


def test_names_that_no_file_and_no_table_can_hold_do_no_harm(uwbbench, file, tmp_path):
    hostile = "a/../|b\n<script>"
    (tmp_path / "mine.yaml").write_text(f"schema: 1\nextends: paper\nname: {json.dumps(hostile)}\n")
    file.write_text(TUNE.replace("detector: paper", "detector: mine.yaml"))
    uwbbench("tune", file, "-o", "tuned")
    names = sorted(path.name for path in (tmp_path / "tuned").glob("*.yaml"))
    assert names == ["a-..-b-script--tuned-concrete.yaml", "a-..-b-script--tuned-overall.yaml"]
    assert "<script>" not in (tmp_path / "tuned" / "summary.md").read_text()
    assert load_detector(tmp_path / "tuned" / names[0]).name == f"{hostile}-tuned-concrete"
