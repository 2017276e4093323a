"""JSON Schema for editors: it accepts what the checks accept, and refuses the commonest mistakes."""

import json
from importlib.metadata import entry_points
from typing import Any

import jsonschema
import pytest

from uwbbench.api import PluginError, registry
from uwbbench.api.locate import shipped
from uwbbench.api.yaml_file import parse_yaml, read_yaml
from uwbbench.tools.schema import detector_schema, experiment_schema, robot_schema, scene_schema

STEPS = "schema: 1\nname: x\npipeline:\n  - {use: profile.amplitude}\n"
EXPERIMENT = "schema: 1\ndetectors: [paper]\ndatasets:\n  - {use: approach}\n"


def as_an_editor_sees_it(data: dict[str, Any]) -> Any:
    """Values with the keys that JSON knows, which are text."""
    return json.loads(json.dumps(data))


def errors(schema: dict[str, Any], text: str) -> list[Any]:
    return list(jsonschema.Draft202012Validator(schema).iter_errors(as_an_editor_sees_it(parse_yaml(text, "x").data)))


@pytest.fixture(scope="module")
def detector() -> dict[str, Any]:
    return detector_schema()


@pytest.fixture(scope="module")
def experiment() -> dict[str, Any]:
    return experiment_schema()


@pytest.fixture(scope="module")
def scene() -> dict[str, Any]:
    return scene_schema()


def test_the_schemas_are_valid_schemas_of_plain_json(detector, experiment, scene) -> None:
    for schema in (detector, experiment, scene):
        jsonschema.Draft202012Validator.check_schema(json.loads(json.dumps(schema, allow_nan=False)))


@pytest.mark.parametrize("name", sorted(shipped("detectors")))
def test_shipped_detectors_fit(detector, name) -> None:
    data = as_an_editor_sees_it(read_yaml(shipped("detectors")[name]).data)
    jsonschema.Draft202012Validator(detector).validate(data)


@pytest.mark.parametrize("name", sorted(shipped("experiments")))
def test_shipped_experiments_fit(experiment, name) -> None:
    data = as_an_editor_sees_it(read_yaml(shipped("experiments")[name]).data)
    jsonschema.Draft202012Validator(experiment).validate(data)


@pytest.mark.parametrize("name", sorted(shipped("scenes")))
def test_shipped_scenes_fit(scene, name) -> None:
    data = as_an_editor_sees_it(read_yaml(shipped("scenes")[name]).data)
    jsonschema.Draft202012Validator(scene).validate(data)


@pytest.mark.parametrize("term", ["{use: noisy}", "{use: noise, params: {snr: 3}}", "{params: {}}"])
def test_a_scenes_terms_follow_from_their_use(scene, term) -> None:
    text = "schema: 1\ntrajectory: {kind: static, duration_s: 1}\nterms: [TERM]\n"
    assert not errors(scene, text.replace("TERM", "{use: noise, params: {snr_db: 3}}"))
    assert errors(scene, text.replace("TERM", term))


@pytest.mark.parametrize(
    "line",
    [
        "robot: rover",
        "robot_seed: 3",
        "seed: {by_channel: {5: 1, 9: 2}}",
        "radar: {taps: {by_channel: {5: 50, other: 60}}}",
        "objects: [{id: a, shape: point, center_m: [1, 0], tail: {level_db: {by_channel: {9: -3}}}}]",
    ],
)
def test_a_scene_may_name_its_robot_and_values_by_channel(scene, line: str) -> None:
    text = "schema: 1\ntrajectory: {kind: static, duration_s: {by_channel: {9: 1}}}\nterms: [{use: direct}]\n"
    assert errors(scene, text + line) == []


@pytest.mark.parametrize(
    "line",
    [
        "robot: {seed: 3}",
        "robot_seed: three",
        "seed: {by_channel: {five: 1}}",
        "radar: {channel: {by_channel: {5: 5}}}",
        "objects: [{id: a, shape: point, center_m: [1, 0], tail: {level_db: {by_channel: {9: low}}}}]",
    ],
)
def test_a_scene_with_a_wrong_robot_or_table_does_not_fit(scene, line: str) -> None:
    assert errors(scene, f"schema: 1\ntrajectory: {{kind: static, duration_s: 1}}\nterms: [{{use: direct}}]\n{line}\n")


@pytest.mark.parametrize(
    "step",
    [
        "{use: peaks, params: {relative_height: 0.5, window_taps: null}}",
        "{use: peaks, params: {relative_height: {by_channel: {5: 0.5, 9: 0.4, other: 0.3}}}}",
        "{use: filter.width, as: narrow, optional: true, params: {minimum: 0.2}}",
    ],
)
def test_correct_steps_fit(detector, step: str) -> None:
    assert errors(detector, f"{STEPS}  - {step}\n") == []


@pytest.mark.parametrize(
    "step",
    [
        "{use: peeks}",
        "{params: {}}",
        "{use: peaks, parms: {}}",
        "{use: peaks, params: {relative_heigth: 0.5}}",
        "{use: peaks, params: {relative_height: high}}",
        "{use: peaks, params: {relative_height: 2}}",
        "{use: peaks, params: {relative_height: {by_channel: {nine: 0.5}}}}",
        "{use: peaks, params: {relative_height: {by_channel: {9: 2}}}}",
        "{use: peaks, params: {relative_height: {by_channel: {}}}}",
        "{use: filter.prominence}",
        "{use: filter.prominence, params: {}}",
    ],
)
def test_wrong_steps_do_not_fit(detector, step: str) -> None:
    assert errors(detector, f"{STEPS}  - {step}\n")


def test_a_detector_that_extends_another_may_be_short(detector) -> None:
    assert errors(detector, "extends: paper\nset: {pipeline.range.params.bias_m: 0.1}\n") == []
    assert errors(detector, "schema: 1\nname: x\n")
    assert errors(detector, f"{STEPS}set: {{name: y}}\n")


@pytest.mark.parametrize(
    "line",
    ["scoring: frame", "scoring: [frame, object]", "latency: false", "latency: {frames: 10}", "gate_m: 0.1"],
)
def test_correct_experiments_fit(experiment, line: str) -> None:
    assert errors(experiment, f"{EXPERIMENT}{line}\n") == []


def test_the_short_form_of_an_experiment_in_the_readme_fits(experiment) -> None:
    text = "schema: 1\ndetectors: [paper, cfar-os, ./mine.yaml]\ndatasets:\n"
    assert errors(experiment, text + "  - {use: capture, params: {files: ['runs/*.h5']}}\nscoring: [frame]\n") == []


@pytest.mark.parametrize(
    "text",
    [
        f"{EXPERIMENT}scoring: frames\n",
        f"{EXPERIMENT}gate: 0.1\n",
        f"{EXPERIMENT}gate_m: -1\n",
        "schema: 1\ndetectors: [paper]\ndatasets: [{use: aproach}]\n",
        "schema: 1\ndetectors: [paper]\ndatasets: [{use: approach, params: {chanel: 5}}]\n",
        "schema: 1\ndetectors: [paper]\ndatasets: [{use: capture}]\n",
        "schema: 1\ndetectors: [paper]\n",
    ],
)
def test_wrong_experiments_do_not_fit(experiment, text: str) -> None:
    assert errors(experiment, text)


def test_every_registered_stage_can_be_chosen(detector) -> None:
    names = detector["$defs"]["StepModel"]["properties"]["use"]["enum"]
    assert sorted(names) == sorted(point.name for point in entry_points(group="uwbbench.stages"))


def test_a_stage_that_cannot_be_loaded_keeps_its_name_and_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    load = registry.load_plugin

    def broken(kind: Any, name: str) -> type:
        if name == "peaks":
            raise PluginError("stage 'peaks' cannot be loaded: its library is missing")
        return load(kind, name)

    monkeypatch.setattr(registry, "load_plugin", broken)
    schema = detector_schema()
    use = schema["$defs"]["StepModel"]["properties"]["use"]
    assert "peaks" in use["enum"]
    assert "its library is missing" in use["description"]
    assert errors(schema, f"{STEPS}  - {{use: peaks, params: {{anything: 1}}}}\n") == []
    assert errors(schema, f"{STEPS}  - {{use: filter.prominence}}\n")


ROBOT = "schema: 1\nname: rover\nradar: {sample_interval_ns: 1.0016}\nseed: 1\nchannels: {9: {terms: {TERM}}}\n"


@pytest.mark.parametrize("name", sorted(shipped("robots")))
def test_shipped_robots_fit(name) -> None:
    data = as_an_editor_sees_it(read_yaml(shipped("robots")[name]).data)
    jsonschema.Draft202012Validator(robot_schema()).validate(data)


@pytest.mark.parametrize("term", ["grid: {}", "noize: {}", "ringing: {level: 1}", "ringing: {decay_ns: -1}"])
def test_a_robot_is_made_of_terms_that_belong_to_it(term) -> None:
    schema = robot_schema()
    assert errors(schema, ROBOT.replace("TERM", "ringing: {taps: [{delay_ns: 1, level_db: -9}]}, array: {}")) == []
    assert errors(schema, ROBOT.replace("TERM", term))
