"""The detector file: what is checked, what ``extends`` does, values by channel."""

import pytest

from uwbbench.api import ConfigError, PluginError
from uwbbench.config.detector import detector_from_text, read_detector

STAGES = """
from pydantic import Field
from uwbbench.api import Params, Stage, ports

class FinderParams(Params):
    threshold: float = Field(1.0, ge=0)
    width: int = 3

class Finder(Stage[FinderParams]):
    produces = ports("detections")
"""


@pytest.fixture(autouse=True)
def stages(install_plugin):
    install_plugin("teststages", {"stages": {"find": "teststages:Finder"}}, {"teststages.py": STAGES})


def text_of(params="{}", **keys):
    lines = [f"{key}: {value}" for key, value in {"schema": 1, "name": "mine", **keys}.items()]
    return "\n".join([*lines, "pipeline:", f"  - {{use: find, params: {params}}}", ""])


def test_a_detector_is_its_steps_in_order():
    found = detector_from_text(
        "schema: 1\nname: mine\npipeline:\n  - {use: find, as: first}\n  - {use: find, optional: true}\n"
    )
    assert [(step.use, step.label, step.optional) for step in found.steps] == [
        ("find", "first", False),
        ("find", "find", True),
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (text_of(nmae="x"), r"d\.yaml:3: nmae: unknown key 'nmae'\. Did you mean 'name'"),
        (text_of("{treshold: 2}"), r"d\.yaml:4: .*treshold: unknown key 'treshold'\. Did you mean 'threshold'"),
        (text_of("{threshold: -1}"), r"d\.yaml:4: pipeline\[0\]\.params\.threshold: .*greater than or equal to 0"),
        (text_of("{threshold: high}"), r"threshold: .*found 'high'"),
        (text_of("{threshold: .nan}"), r"threshold: .*finite"),
        ("schema: 1\nname: a\npipeline:\n  - {user: find}\n", r"d\.yaml:4: pipeline\[0\]\.user: unknown key.*'use'"),
        ("schema: 1\npipeline: [{use: find}]", r"key 'name' is missing"),
        ("schema: 2\nname: a\npipeline: [{use: find}]", r"d\.yaml:1: schema"),
        ("schema: 1\nname: a\npipeline: []", r"d\.yaml:3: pipeline"),
        ("schema: 1\nname: a\npipeline:\n- use: find\n- use: find", r"d\.yaml:5: .*step 'find' appears twice.*'as'"),
        (text_of(set="{a: 1}"), r"d\.yaml:3: set: 'set' changes an extended detector, but 'extends' is missing"),
        (text_of(extends="[a]"), r"d\.yaml:3: extends: expected the name or path"),
    ],
)
def test_what_is_wrong_is_told_with_file_line_key_and_the_nearest_name(text, message):
    with pytest.raises(ConfigError, match=message):
        detector_from_text(text, "d.yaml")


def test_every_wrong_key_is_told_at_once():
    with pytest.raises(ConfigError) as caught:
        detector_from_text(text_of("{a: 1, b: 2}"), "d.yaml")
    assert len(str(caught.value).splitlines()) == 2


def test_an_unknown_stage_is_told_with_its_line_and_the_nearest_name():
    with pytest.raises(PluginError, match=r"d\.yaml:4: pipeline\[0\]\.use: no stage named 'fnid'.*Did you mean 'find'"):
        detector_from_text("schema: 1\nname: a\npipeline:\n  - use: fnid\n", "d.yaml")


# extends


def write(folder, name, text):
    (folder / name).write_text(text)
    return str(folder / name)


def test_an_extending_detector_changes_single_values(tmp_path):
    write(tmp_path, "base.yaml", text_of("{threshold: 2, width: 5}", description="old"))
    path = write(tmp_path, "mine.yaml", "extends: base.yaml\nname: changed\nset: {pipeline.find.params.threshold: 7}\n")
    found = read_detector(path)
    assert (found.name, found.description) == ("changed", "old")
    assert found.steps[0].params == {"threshold": 7, "width": 5}


def test_extending_reaches_over_several_files_and_the_command_line_comes_last(tmp_path):
    (tmp_path / "deep").mkdir()
    write(tmp_path, "a.yaml", text_of("{threshold: 1, width: 1}"))
    write(tmp_path, "deep/b.yaml", "extends: ../a.yaml\nset: {pipeline.find.params.threshold: 2}\n")
    path = write(tmp_path, "c.yaml", "extends: deep/b.yaml\nname: c\n")
    assert read_detector(path).steps[0].params == {"threshold": 2, "width": 1}
    changes = {"pipeline.find.params.threshold": 3}
    assert read_detector(path, changes=changes).steps[0].params == {"threshold": 3, "width": 1}


def test_a_changed_value_is_checked_like_a_written_one(tmp_path):
    write(tmp_path, "base.yaml", text_of())
    path = write(tmp_path, "mine.yaml", "extends: base.yaml\nset: {pipeline.find.params.treshold: 7}\n")
    with pytest.raises(ConfigError, match=r"mine\.yaml.*unknown key 'treshold'"):
        read_detector(path)


@pytest.mark.parametrize("names", [("a",), ("a", "b"), ("a", "b", "c")])
def test_detectors_that_extend_each_other_in_a_circle_are_refused(tmp_path, names):
    for name, parent in zip(names, (*names[1:], names[0]), strict=True):
        write(tmp_path, f"{name}.yaml", f"extends: {parent}.yaml\n")
    with pytest.raises(ConfigError, match=r"\.yaml:1: extends: detectors extend each other in a circle"):
        read_detector(str(tmp_path / "a.yaml"))


def test_a_path_that_leads_nowhere_names_the_line_of_set(tmp_path):
    write(tmp_path, "base.yaml", text_of())
    path = write(tmp_path, "mine.yaml", "extends: base.yaml\nset: {pipeline.fnid.params.width: 7}\n")
    with pytest.raises(ConfigError, match=r"mine\.yaml:2: set: .*no item 'fnid"):
        read_detector(path)


def test_an_unknown_parent_and_an_unknown_detector_are_named(tmp_path):
    with pytest.raises(ConfigError, match="no detector named 'nobody-knows-me'"):
        read_detector(write(tmp_path, "mine.yaml", "extends: nobody-knows-me\n"))
    with pytest.raises(ConfigError, match=r"none\.yaml: no such file"):
        read_detector("none.yaml", tmp_path)


# by_channel


def test_values_by_channel_fall_back_to_other():
    (step,) = detector_from_text(text_of("{threshold: {by_channel: {5: 1, 9: 2, other: 3}}}")).steps
    assert step.params_for(5) == ({"threshold": 1}, [])
    assert step.params_for(9) == ({"threshold": 2}, [])
    assert step.params_for(None) == ({"threshold": 3}, ["threshold"])


def test_a_channel_without_value_is_refused():
    (step,) = detector_from_text(text_of("{threshold: {by_channel: {5: 1}}}")).steps
    with pytest.raises(ConfigError, match=r"find: 'threshold' has values for channels 5 and no 'other'.*is 9"):
        step.params_for(9)


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ("{threshold: {by_channel: {5: 1, 9: -1}}}", r"pipeline\[0\]\.params\.threshold.*greater"),
        ("{threshold: {by_channel: {5: 1, other: -1}}}", r"pipeline\[0\]\.params\.threshold.*greater"),
        ("{threshold: {by_channel: {five: 1}}}", "by_channel expects channel numbers"),
        ("{threshold: {by_channel: {}}}", "by_channel expects"),
        ("{threshold: {by_channel: 3}}", "by_channel expects"),
        ("{threshold: {by_channel: {5: 1}, more: 2}}", "by_channel expects"),
        ("{threshold: {by_channel: {5: 1}}, width: {by_channel: {9: 1}}}", "no 'other'"),
    ],
)
def test_a_wrong_value_for_any_channel_is_found_when_the_file_is_read(params, message):
    with pytest.raises(ConfigError, match=message):
        detector_from_text(text_of(params), "d.yaml")


def test_a_detector_names_the_column_that_orders_its_candidates():
    changed = read_detector("paper-filtering", changes={"score": "prominence"})
    assert changed.score == changed.to_dict()["score"] == "prominence"
    plain = read_detector("paper-filtering")
    assert plain.score == ""
    assert "score" not in plain.to_dict()


def test_a_score_that_no_step_makes_is_refused_with_the_nearest_column():
    with pytest.raises(ConfigError, match=r"score: no step makes the column 'prominense'.*'prominence'"):
        read_detector("paper-filtering", changes={"score": "prominense"})
