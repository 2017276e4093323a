"""``uwbbench gate``: each outcome, as a user runs the command."""

import json
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
import waiting

from uwbbench.api import registry, write_capture
from uwbbench.config.source import open_dataset
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment

ONCE = "{maximum_ratio: 3, frames: 100, blocks: 31, patience: 1, warmup_windows: 2, processes: 3}"
"""Latency with a limit that no machine reaches by chance."""

PLATE = "{use: approach, name: plate}"
"""The gate's simulated capture."""


@pytest.fixture
def make_gate(tmp_path: Path):
    """Write a gate file on a simulated capture."""

    def make(name: str = "gate.yaml", **keys: object) -> Path:
        lines = {"schema": 1, "head": "paper-filtering", "datasets": f"[{PLATE}]", **keys}
        path = tmp_path / name
        path.write_text("".join(f"{key}: {value}\n" for key, value in lines.items() if value is not None), "utf-8")
        return path

    return make


@pytest.fixture
def stages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The stages ``test.wait`` and ``test.crash``, here and in worker processes."""
    waiting.install(tmp_path / "site")
    monkeypatch.syspath_prepend(tmp_path / "site")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "site"))
    for known in (registry.entries, registry.load_plugin):
        known.cache_clear()
    yield
    for known in (registry.entries, registry.load_plugin):
        known.cache_clear()


@pytest.fixture
def stored_run(tmp_path: Path) -> Path:
    """A run of ``paper-filtering`` on the gate's captures."""
    file = tmp_path / "stored.yaml"
    file.write_text(f"schema: 1\ndetectors: [paper-filtering]\nlatency: false\nstability: false\ndatasets: [{PLATE}]\n")
    return run_experiment(read_experiment(file), tmp_path / "stored", jobs=1).path


@pytest.fixture(scope="session")
def capture_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The gate's simulated capture as a file, which need not be simulated again in every worker."""
    dataset = open_dataset("approach", {}, [])
    path = tmp_path_factory.mktemp("capture") / "plate.h5"
    write_capture(path, dataset.open(dataset.names()[0]))
    return path


def verdicts(told: dict) -> list[str]:
    return [check["verdict"] for check in told["checks"]]


@pytest.mark.slow
def test_a_gate_that_holds_is_exit_code_0_and_is_told_for_people(uwbbench, make_gate) -> None:
    make_gate(
        accuracy="[{metric: f1, scoring: frame, minimum: 0.5}, {metric: mae, scoring: object, maximum: 1.0}]",
        deadline="{rate_hz: 1, paced: false, frames: 400, patience: 1, warmup_windows: 2}",
    )
    done = uwbbench("gate", "gate.yaml")
    for text in ("F1 (frame scoring, filtering) on plate, SIMULATED", "missed 0.00 % [0.00 %, 0.92 %], 400 frames"):
        assert text in done.stdout
    assert "PASS (exit code 0)" in done.stdout
    assert "accuracy on plate" in done.stderr
    make_gate(accuracy="[{metric: f1, scoring: frame, minimum: 0.5}]")
    assert uwbbench("gate", "gate.yaml", "--quiet").stderr == ""


def test_a_limit_that_is_missed_is_exit_code_1_with_files_for_ci(uwbbench, make_gate, tmp_path, monkeypatch) -> None:
    make_gate(accuracy="[{metric: f1, scoring: frame, minimum: 0.999}]", name="strict|<b>.yaml")
    (tmp_path / "step.md").write_text("before\n")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "step.md"))
    done = uwbbench("gate", "strict|<b>.yaml", "--json", "--junit", "gate.xml", "-q", code=1)
    told = json.loads(done.stdout)
    assert (told["verdict"], told["exit_code"]) == ("regression", 1)
    assert 0.5 < told["checks"][0]["value"] < told["checks"][0]["limit"] == 0.999
    (suite,) = ET.parse(tmp_path / "gate.xml").getroot()  # noqa: S314 - our own file
    assert (suite.get("tests"), suite.get("failures")) == ("1", "1")
    lines = (tmp_path / "step.md").read_text().splitlines()
    assert lines[:2] == ["before", "## Gate strict\\|&lt;b&gt;: REGRESSION"]


@pytest.mark.slow
def test_a_head_that_is_much_slower_is_caught_and_a_faster_one_passes(
    uwbbench, make_gate, stages, capture_file, tmp_path
) -> None:
    waiting.slowed(tmp_path / "slow.yaml", 200.0, "null")
    on_file = {"latency": ONCE, "datasets": None, "captures": f"['{capture_file}']"}
    make_gate(base="'null'", head="slow.yaml", **on_file)
    told = json.loads(uwbbench("gate", "gate.yaml", "--json", code=1).stdout)
    assert verdicts(told) == ["pass", "regression"]
    assert told["checks"][1]["low"] > 3
    assert told["checks"][1]["n"] == 31
    make_gate(base="slow.yaml", head="null", **on_file)
    told = json.loads(uwbbench("gate", "gate.yaml", "--json").stdout)
    assert told["checks"][1]["high"] < 0.5


@pytest.mark.slow
def test_two_environments_take_turns_in_fresh_pairs_of_processes(uwbbench, make_gate, capture_file, tmp_path) -> None:
    (tmp_path / "base").symlink_to(Path(sys.executable).parent.parent)
    python = f"base/bin/{Path(sys.executable).name}"
    captures = f"['{capture_file}']"
    make_gate(
        latency=ONCE, datasets=None, captures=captures, head="null", base=f"{{python: {python}, detector: 'null'}}"
    )
    told = json.loads(uwbbench("gate", "gate.yaml", "--json").stdout)
    assert verdicts(told) == ["pass", "pass"]
    assert [(check["n"], check["counted"]) for check in told["checks"]] == [(3, "processes")] * 2
    assert python in told["base"]


@pytest.mark.slow
def test_a_base_that_differs_from_itself_is_exit_code_3_and_the_head_is_not_measured(
    uwbbench, make_gate, stages, capture_file, tmp_path
) -> None:
    waiting.with_stage(tmp_path / "uneven.yaml", "test.uneven", {"wait_us": 200.0}, "null")
    make_gate(latency=ONCE, base="uneven.yaml", head="null", datasets=None, captures=f"['{capture_file}']")
    told = json.loads(uwbbench("gate", "gate.yaml", "--json", code=3).stdout)
    canary, head = told["checks"]
    assert (canary["kind"], canary["verdict"], canary["reason"]) == (
        "canary",
        "invalid",
        "the same detector differs from itself",
    )
    assert canary["high"] < 1 / 3
    assert (head["verdict"], head["value"]) == ("invalid", None)
    assert "not measured" in head["reason"]


@pytest.mark.slow
def test_too_few_frames_are_inconclusive_and_exit_code_2(uwbbench, make_gate, capture) -> None:
    make_gate(latency=ONCE, base="paper-filtering", datasets=None, captures=f"[{capture.name}]")
    done = uwbbench("gate", "gate.yaml", code=2)
    assert "frames are too few; at least 100 are needed" in done.stdout
    assert "INCONCLUSIVE (exit code 2)" in done.stdout


@pytest.mark.slow
def test_missed_deadlines_are_counted_with_bursts(uwbbench, make_gate, stages, tmp_path) -> None:
    waiting.slowed(tmp_path / "slow.yaml", 2000.0)
    make_gate(head="slow.yaml", deadline="{rate_hz: 1000, maximum_burst: 3, frames: 60, warmup_windows: 2}")
    told = json.loads(uwbbench("gate", "gate.yaml", "--json", code=1).stdout)
    share, burst = told["checks"]
    assert (share["verdict"], burst["verdict"]) == ("regression", "regression")
    assert share["value"] > 0.9
    assert burst["value"] > 50


@pytest.mark.slow
@pytest.mark.parametrize(
    ("keys", "reason"),
    [
        ({"base": "{python: nowhere/python, detector: paper}", "latency": ONCE}, "no Python interpreter to run"),
        ({"datasets": "[{use: capture, params: {files: [none.h5]}}]", "deadline": "{}"}, "no file matches 'none.h5'"),
        ({"accuracy": "[{metric: f1, scoring: frame, no_worse_than: nowhere}]"}, "is not a run folder"),
        ({"accuracy": "[{metric: f1, scoring: frame, table: mapping, minimum: 0}]"}, "does not cluster positions"),
        ({"head": "null", "accuracy": "[{metric: mae, scoring: frame, maximum: 1}]"}, "nothing was retained"),
    ],
)
def test_what_cannot_be_measured_is_exit_code_3_and_says_why(uwbbench, make_gate, keys, reason) -> None:
    make_gate(**keys)
    done = uwbbench("gate", "gate.yaml", "--junit", "gate.xml", code=3)
    assert reason in done.stdout
    assert "INVALID (exit code 3)" in done.stdout
    assert "<error " in Path("gate.xml").read_text()


@pytest.mark.slow
def test_a_detector_that_crashes_is_invalid_for_every_check(uwbbench, make_gate, stages, tmp_path) -> None:
    text = waiting.slowed(tmp_path / "crash.yaml", 0.0).read_text()
    (tmp_path / "crash.yaml").write_text(text.replace("test.wait", "test.crash"))
    make_gate(
        head="crash.yaml",
        base="paper-filtering",
        latency=ONCE,
        deadline="{}",
        accuracy="[{metric: f1, scoring: frame, minimum: 0}]",
    )
    told = json.loads(uwbbench("gate", "gate.yaml", "--json", code=3).stdout)
    assert verdicts(told) == ["invalid"] * 3
    assert all("the worker ended (exit code 7)" in check["reason"] for check in told["checks"])


@pytest.mark.slow
def test_the_same_detector_is_no_worse_than_its_stored_run_and_a_worse_one_is(uwbbench, make_gate, stored_run) -> None:
    rule = "[{metric: f1, scoring: frame, no_worse_than: stored, detector: paper-filtering}]"
    make_gate(accuracy=rule)
    told = json.loads(uwbbench("gate", "gate.yaml", "--json").stdout)
    assert (verdicts(told), told["checks"][0]["value"]) == (["pass"], 0)
    make_gate(head="constant", accuracy=rule)
    worse = uwbbench("gate", "gate.yaml", code=2).stdout
    assert "worse, but 1 scenes are too few for an interval" in worse


@pytest.mark.slow
def test_a_stored_run_that_was_edited_by_hand_is_invalid(uwbbench, make_gate, stored_run) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = stored_run / "scores.parquet"
    table = pq.read_table(path)
    column = table.column_names.index("recall")
    pq.write_table(table.set_column(column, "recall", pa.array([0.1] * len(table))), path)
    make_gate(accuracy="[{metric: recall, scoring: frame, no_worse_than: stored}]")
    assert "edited by hand" in uwbbench("gate", "gate.yaml", code=3).stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("nowhere.yaml",), "nowhere.yaml: no such file"),
        (("gate.yaml", "--set", "latensy.blocks=9"), "latensy"),
        (("gate.yaml", "--junit", "nowhere/gate.xml"), "nowhere/gate.xml: no folder to write it into"),
        ((), "GATE"),
    ],
)
def test_a_mistake_is_exit_code_2_and_one_message(uwbbench, make_gate, words, message) -> None:
    make_gate(accuracy="[{metric: f1, scoring: frame, minimum: 0.5}]")
    assert message in uwbbench("gate", *words, code=2).stderr


def test_validate_and_schema_know_gates(uwbbench, make_gate) -> None:
    make_gate(accuracy="[{metric: f1, scoring: frame, minimum: 0.5}]")
    assert "gate 'gate', 1 datasets, fine" in uwbbench("validate", "gate.yaml").stdout
    assert "maximum_missed_share" in uwbbench("schema", "gate").stdout
    make_gate(accuracy="[{metric: f1, scoring: frame, minimun: 0.5}]")
    assert "Did you mean 'minimum'?" in uwbbench("validate", "gate.yaml", code=2).stderr


@pytest.mark.slow
def test_a_capture_without_truth_can_be_timed_and_not_scored(uwbbench, make_gate, capture_without_truth) -> None:
    captures = f"[{capture_without_truth.name}]"
    make_gate(
        datasets=None,
        captures=captures,
        deadline="{rate_hz: 1, paced: false, frames: 400, patience: 1, warmup_windows: 2}",
    )
    uwbbench("gate", "gate.yaml")
    make_gate(datasets=None, captures=captures, accuracy="[{metric: f1, scoring: frame, minimum: 0.5}]")
    assert "has no ground truth" in uwbbench("gate", "gate.yaml", code=3).stdout


@pytest.mark.slow  # simulates two runs of two receivers
def test_a_mapper_is_gated_on_runs(make_gate, uwbbench) -> None:
    way = "set: {trajectory.points_m: [[0.0, 0.0], [0.3, 0.0]]}"
    dataset = f"{{use: simulated, captures: ['*/drift-0.02/*'], params: {{scenes: [rods-loop-walls], runs: 1, {way}}}}}"
    limits = "[{metric: ate, scoring: pose, maximum: 0.1}, {metric: f1, scoring: object, minimum: 0.5}]"
    make_gate(head="map-occupancy", datasets=f"[{dataset}]", accuracy=limits)
    told = json.loads(uwbbench("gate", "gate.yaml", "--json", code=3).stdout)
    made = {check["name"]: (check["verdict"], check["counted"]) for check in told["checks"]}
    assert made["ATE (pose scoring, filtering) on simulated, SIMULATED"] == ("pass", "runs in 1 groups")
    assert made["accuracy of f1 (object scoring) on simulated"][0] == "invalid"
