"""Gate files: what they may say, and how mistakes are named."""

import json
import sys
from pathlib import Path

import jsonschema
import pytest

from uwbbench.api import ConfigError, UwbbenchError
from uwbbench.api.locate import config_folder, shipped
from uwbbench.api.yaml_file import read_yaml
from uwbbench.tools.gate import read_gate
from uwbbench.tools.schema import gate_schema

F1 = "[{metric: f1, scoring: frame, minimum: 0.9}]"


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({}, "nothing to check: expected latency, deadline or accuracy"),
        ({"accuracy": F1, "captures": None}, "no captures: expected 'datasets' or 'captures'"),
        ({"latency": "{}"}, "gate.yaml:4: latency: needs a 'base'"),
        ({"latency": "{maximum_ration: 1.1}"}, "latency.maximum_ration: unknown key 'maximum_ration'. Did you mean"),
        ({"latency": "{maximum_ratio: 0.9}", "base": "paper"}, "latency.maximum_ratio"),
        ({"accuracy": F1, "head": "papre"}, "gate.yaml:2: head: no detector named 'papre'. Did you mean 'paper'?"),
        ({"accuracy": F1, "base": "{pyton: x, detector: paper}"}, "gate.yaml:5: base.pyton: unknown key 'pyton'"),
        ({"accuracy": F1, "head": "{python: bin/python}"}, "key 'detector' is missing"),
        ({"accuracy": F1, "head": "nowhere/mine.yaml"}, "head: "),
        ({"accuracy": "[{metric: f2, scoring: frame, minimum: 1}]"}, "accuracy[0].metric: no metric named 'f2'"),
        ({"accuracy": "[{metric: f1, minimum: 1}]"}, "key 'scoring' is missing"),
        ({"accuracy": "[{metric: f1, scoring: frame}]"}, "one of minimum, maximum and no_worse_than, found none"),
        ({"accuracy": "[{metric: f1, scoring: frame, minimum: 0.1, maximum: 1}]"}, "found minimum and maximum"),
        ({"accuracy": "[{metric: mae, scoring: frame, minimum: 0.1}]"}, "of 'mae' lower is better"),
        ({"accuracy": "[{metric: f1, scoring: frame, maximum: 0.1}]"}, "of 'f1' higher is better"),
        ({"accuracy": "[{metric: gospa, scoring: frame, maximum: 0.1}]"}, "no meaning in the scoring frame: it is for"),
        ({"accuracy": "[{metric: bias, scoring: frame, no_worse_than: run}]"}, "neither end is better"),
        ({"accuracy": "[{metric: f1, scoring: frame, minimum: 0.1, tolerance: 1}]"}, "belong to no_worse_than"),
        ({"accuracy": "[{metric: f1, scoring: frame, minimum: 0.1, dataset: capture}]"}, "Did you mean 'captures'?"),
        ({"accuracy": F1, "datasets": "[{use: aproach}]"}, "datasets[0].use: no dataset named 'aproach'"),
        ({"deadline": "{maximum_missed_share: 1}"}, "deadline.maximum_missed_share"),
    ],
)
def test_a_mistake_is_named_with_its_place(write_gate, keys, message) -> None:
    with pytest.raises(UwbbenchError) as caught:
        read_gate(write_gate(**keys))
    assert message in str(caught.value)
    assert "gate.yaml" in str(caught.value)


def test_paths_start_from_the_file_and_links_to_interpreters_are_not_followed(write_gate, tmp_path) -> None:
    (tmp_path / "python").symlink_to(sys.executable)
    (tmp_path / "mine.yaml").write_text("schema: 1\nextends: paper-filtering\nname: mine\n")
    gate = read_gate(write_gate(accuracy=F1, head="{python: python, detector: mine.yaml}"))
    assert gate.head.python == tmp_path / "python"
    assert gate.head.detector == str(tmp_path / "mine.yaml")


def test_a_detector_of_another_environment_need_not_be_known_here(write_gate) -> None:
    gate = read_gate(write_gate(accuracy=F1, head="{python: elsewhere, detector: unheard-of}"))
    assert gate.head.detector == "unheard-of"


def test_null_is_the_detector_of_that_name(write_gate) -> None:
    assert read_gate(write_gate(accuracy=F1, head="null")).head.detector == "null"


def test_values_can_be_set_by_path(write_gate) -> None:
    gate = read_gate(write_gate(base="paper", latency="{}"), {"latency.maximum_ratio": 1.2})
    assert gate.model.latency.maximum_ratio == 1.2
    with pytest.raises(ConfigError, match="maximum_ratio"):
        read_gate(write_gate(base="paper", latency="{}"), {"latency.maximum_ratio": "fast"})


@pytest.mark.parametrize("path", shipped("gates").values(), ids=lambda path: path.stem)
def test_shipped_gates_are_valid_and_fit_the_schema(path: Path) -> None:
    assert read_gate(path).name == path.stem
    jsonschema.Draft202012Validator(gate_schema()).validate(json.loads(json.dumps(read_yaml(path).data)))


@pytest.mark.parametrize("text", [{"head": 1}, {"accuracy": [{"metric": "f1"}]}, {"gate": 1}, {"latency": {"x": 1}}])
def test_the_schema_refuses_what_the_checks_refuse(text) -> None:
    good = {"schema": 1, "head": "paper", "captures": ["a.h5"]}
    validator = jsonschema.Draft202012Validator(gate_schema())
    assert validator.is_valid(good)
    assert not validator.is_valid(good | text)


def test_the_shipped_workflow_runs_a_gate_and_keeps_its_results() -> None:
    (job,) = read_yaml(config_folder() / "gates" / "github-workflow.yml").data["jobs"].values()
    commands = [step.get("run", "") for step in job["steps"]]
    assert any("uwbbench gate head/gate.yaml --junit gate.xml" in command for command in commands)
    assert [step["with"]["path"] for step in job["steps"] if "checkout" in step.get("uses", "")] == ["head", "base"]
    assert any("upload-artifact" in step.get("uses", "") and step["if"] == "always()" for step in job["steps"])
