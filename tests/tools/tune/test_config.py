"""Tuning files: what they may say, and what is told about mistakes."""

import jsonschema
import pytest
import yaml

from uwbbench.api import ConfigError, PluginError
from uwbbench.api.locate import shipped
from uwbbench.tools.schema import tuning_schema
from uwbbench.tools.tune.config import Steps, read_tuning

WIDTH = "pipeline.filter.width.params.minimum"


def test_steps_are_even_and_as_people_write_them():
    assert Steps(start=0.1, stop=0.5, count=5).values == [0.1, 0.2, 0.3, 0.4, 0.5]
    assert Steps(start=0.01, stop=1, count=3, spacing="log").values == [0.01, 0.1, 1.0]


def test_a_file_becomes_a_sweep_with_all_sets(tuning):
    made = tuning()
    assert made.sweep is not None
    assert len(made.sweep) == 27
    assert made.sweep.axes[1].thresholds == (0.5, 1.5, 2.5)


def test_a_clustering_behind_the_ranges_is_left_out_of_the_sweep(tuning):
    made = tuning(detector="paper")
    assert made.sweep is not None
    assert [step.label for step in made.sweep.config.steps][-1] == "position"
    assert made.detector.steps[-1].label == "dbscan"


def test_values_are_set_in_the_detector_before_the_grid(tuning):
    made = tuning(set={"pipeline.filter.first_path.params.guard_taps": 3})
    guard = next(step for step in made.detector.steps if step.label == "filter.first_path")
    assert guard.params == {"guard_taps": 3}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"grid": ...}, "expected either 'grid' or 'search'"),
        ({"search": {"space": {WIDTH: {"low": 0, "high": 1}}}}, "expected either 'grid' or 'search'"),
        ({"gird": {}}, r"own.yaml:\d+: gird: unknown key 'gird'. Did you mean 'grid'"),
        ({"grid": {"pipeline.filter.widht.params.minimum": [1]}}, r"own.yaml:\d+: grid.*no item 'filter.widht"),
        ({"grid": {WIDTH: [-1]}}, r"own.yaml:\d+: grid.*greater than or equal to 0"),
        ({"grid": {WIDTH: []}}, r"own.yaml:\d+: grid.*at least one value"),
        ({"grid": {WIDTH: {"start": 0, "stop": 1, "count": 3, "spacing": "log"}}}, "above 0"),
        ({"grid": {"pipeline.peaks.params.relative_height": [0.5]}}, "is no filter that compares"),
        ({"grid": {WIDTH: [1]}, "table": "mapping"}, "table 'mapping' needs 'search'"),
        ({"grid": ..., "search": {"space": {"pipeline.nothing.params.x": {"low": 0, "high": 1}}}}, "no item 'nothing"),
        ({"grid": ..., "search": {"space": {WIDTH: {"low": 2, "high": 1}}}}, "must lie below high"),
        ({"grid": ..., "search": {"space": {WIDTH: {"choices": [1, 1]}}}}, "a choice is given twice"),
        ({"detector": "papr"}, r"own.yaml:\d+: detector: no detector named 'papr'. Did you mean 'paper'"),
        ({"held_out": ...}, "key 'held_out' is missing"),
        ({"groups": ["color"]}, r"own.yaml:\d+: groups"),
        ({"experiment": "no-such"}, r"own.yaml:\d+: experiment: no experiment named 'no-such'"),
        ({"tuning": [{"use": "approach", "params": {"materail": "metal"}}]}, r"tuning\[0\].params.materail"),
    ],
)
def test_mistakes_are_named_with_file_line_and_key(tuning, changes, message):
    with pytest.raises(ConfigError, match=message):
        tuning(**changes)


def test_an_unknown_dataset_is_named_with_its_line(tuning):
    with pytest.raises(PluginError, match=r"own.yaml:\d+: held_out\[0\].use: .*'aproach'"):
        tuning(held_out=[{"use": "aproach"}])


def test_shipped_tunings_are_valid_by_the_schema_and_can_be_read():
    files = shipped("tuning")
    assert files
    for name, path in files.items():
        jsonschema.validate(yaml.safe_load(path.read_text()), tuning_schema())
        assert read_tuning(name).name == name


def test_the_schema_refuses_what_the_reader_refuses(contents):
    jsonschema.validate(contents, tuning_schema())
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**contents, "gird": {}}, tuning_schema())
