"""Fit files: what they may say, and what is said about mistakes."""

import json

import jsonschema
import pytest

from tests.tools.fit.conftest import FIT
from uwbbench.api import ConfigError, PluginError
from uwbbench.api.locate import shipped
from uwbbench.api.override import value_at, with_values
from uwbbench.api.yaml_file import read_yaml
from uwbbench.tools.fit import read_fit
from uwbbench.tools.schema import fit_schema

DISTANCE = FIT["parameters"]["distance"]


def test_a_search_begins_with_the_value_of_the_file_where_its_range_holds_it(plan):
    assert plan().start == {"distance": 2.0}
    assert plan(parameters={"distance": {**DISTANCE, "high": 1.5}}).start == {"distance": 1.25}
    channel = {"in": "plate.yaml", "path": "radar.channel", "choices": [5, 9]}
    assert plan(parameters={"channel": channel}).start == {"channel": 9}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"checking": {"seeds": [5, 1]}}, r"seed 1 is both for fitting and for checking"),
        ({"fitting": {"seeds": [1, 1]}}, r"a seed is given twice"),
        ({"parameters": {"d": {**DISTANCE, "low": 4.0}}}, r"low \(4\) must lie below high \(2\)"),
        (
            {"parameters": {"d": {**DISTANCE, "path": "objects.plte.center_m.0"}}},
            r"parameters\.d\.path: .*Known: 0, plate",
        ),
        ({"parameters": {"d": {**DISTANCE, "path": "radar.chanel"}}}, r"parameters\.d\.path: .*'channel'"),
        ({"parameters": {"d": {**DISTANCE, "in": "plates.yaml"}}}, r"no cell uses 'plates\.yaml'.*'plate\.yaml'"),
        ({"parameters": {"d": {**DISTANCE, "in": "robot"}}}, r"the file names no 'robot'"),
        ({"parameters": {"d": {**DISTANCE, "cells": ["nar"]}}}, r"no cell 'nar'.*'near'"),
        ({"targets": {"far": {"filtering": {"mae": 1}}}}, r"targets\.far: no cell 'far'"),
        ({"targets": {"near": {"filtering": {"p90": 1}}}}, r"'tolerances' says nothing of 'p90'"),
        ({"targets": {"near": {"chain": {"peeks": 1}}}}, r"no step 'peeks'"),
        ({"targets": {"near": {"filtering": {"mae": 0}}}, "tolerances": {"mae": {"relative": 0.1}}}, r"absolute"),
        ({"tolerances": {"mae": {"absolute": 0.1, "relative": 0.1}}}, r"expected one of absolute, relative"),
        ({"tolerances": {"mae": {"absolute": 0.1, "weight": 0}}}, r"nothing is fitted"),
        ({"search": {"stages": [{"free": ["distanse"]}]}}, r"no parameter 'distanse'.*'distance'"),
        ({"cells": {"near": {"scene": "plate.yaml", "set": {"terms.nise.params.snr_db": 3}}}}, r"noise"),
        ({"robot": "nobody"}, r"robot: no robot named 'nobody'"),
    ],
)
def test_mistakes_are_refused_with_their_place(plan, changes, message):
    with pytest.raises(ConfigError, match=message):
        plan(**changes)


def test_an_unknown_metric_is_refused_with_the_nearest_name(plan):
    with pytest.raises(PluginError, match=r"targets\.near\.filtering\.maee: .*'mae'"):
        plan(targets={"near": {"filtering": {"maee": 1}}})


def test_a_scene_that_is_still_several_is_refused(plan, tmp_path):
    text = (tmp_path / "plate.yaml").read_text() + "vary: {radar.channel: [5, 9]}\n"
    (tmp_path / "plate.yaml").write_text(text)
    with pytest.raises(ConfigError, match="cell 'near': its scene varies into 2"):
        plan()
    assert plan(cells={"near": {"scene": "plate.yaml", "set": {"radar.channel": 5}}}).cells["near"].set


@pytest.mark.parametrize("name", sorted(shipped("fits")))
def test_shipped_fits_are_right_and_fit_their_schema(name):
    assert read_fit(name).targets
    data = json.loads(json.dumps(read_yaml(shipped("fits")[name]).data))
    jsonschema.Draft202012Validator(fit_schema()).validate(data)


def test_a_number_may_be_a_key_of_a_path():
    data = {"channels": {5: {"level": 1}}}
    assert value_at(data, "channels.5.level", "x") == 1
    assert value_at(data, "channels.9.level", "x") is None
    assert with_values(data, {"channels.5.level": 2}, "x") == {"channels": {5: {"level": 2}}}
