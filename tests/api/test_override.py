"""Changing values by path: ``--set``, ``set`` and merging."""

import pytest

from uwbbench.api import ConfigError
from uwbbench.api.override import merged, parse_settings, with_values

DATA = {
    "gate_m": 0.2,
    "pipeline": [
        {"use": "peaks", "params": {"relative_height": 0.5}},
        {"use": "filter.width", "as": "broad", "params": {"minimum": 1}},
        {"use": "filter.width", "params": {"minimum": 2}},
    ],
}


@pytest.mark.parametrize(
    ("path", "where"),
    [
        ("gate_m", lambda d: d["gate_m"]),
        ("pipeline.peaks.params.relative_height", lambda d: d["pipeline"][0]["params"]["relative_height"]),
        ("pipeline.0.params.window_taps", lambda d: d["pipeline"][0]["params"]["window_taps"]),
        ("pipeline.broad.params.minimum", lambda d: d["pipeline"][1]["params"]["minimum"]),
        ("pipeline.filter.width.params.minimum", lambda d: d["pipeline"][2]["params"]["minimum"]),
        ("pipeline.1", lambda d: d["pipeline"][1]),
        ("new.key", lambda d: d["new"]["key"]),
    ],
)
def test_a_path_changes_one_value_and_leaves_the_original_alone(path, where):
    changed = with_values(DATA, {path: "new"}, "--set")
    assert where(changed) == "new"
    assert "new" not in str(DATA)


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("pipeline.peeks.params", r"--set: 'pipeline\.peeks\.params': no item 'peeks\.params'\. "),
        ("gate_m.unit", "'gate_m' is a single value"),
        ("pipeline.peaks.use.more", "'use' is a single value"),
    ],
)
def test_a_path_that_leads_nowhere_is_named(path, message):
    with pytest.raises(ConfigError, match=message):
        with_values(DATA, {path: 1}, "--set")


def test_settings_are_values_by_path():
    found = parse_settings(["a.b=1e-3", "c=on", "d=[1, 2]", "e=x=y", "f="])
    assert found == {"a.b": 1e-3, "c": "on", "d": [1, 2], "e": "x=y", "f": ""}


@pytest.mark.parametrize("text", ["gate_m", "=1", " =1"])
def test_a_setting_without_key_or_value_is_refused(text):
    with pytest.raises(ConfigError, match="expected key=value"):
        parse_settings([text])


def test_mappings_merge_and_everything_else_replaces():
    base = {"a": {"b": 1, "c": 2}, "l": [1, 2], "s": 1}
    assert merged(base, {"a": {"c": 3, "d": 4}, "l": [9]}) == {"a": {"b": 1, "c": 3, "d": 4}, "l": [9], "s": 1}
    assert base == {"a": {"b": 1, "c": 2}, "l": [1, 2], "s": 1}
