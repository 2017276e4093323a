"""Metrics as plugins, and the examples in the docstrings."""

import doctest
import importlib

import numpy as np
import pytest

from uwbbench.api import registry
from uwbbench.api.metric import Metric
from uwbbench.tools.check.outcomes import empty


def test_every_registered_metric_evaluates_an_empty_outcome_to_undefined():
    names = registry.entries("metrics")
    assert {"precision", "recall", "f1", "false_alarms_per_minute", "mae", "p90", "p95", "sd", "bias"} <= set(names)
    for name in names:
        metric = registry.load_plugin("metrics", name)
        assert issubclass(metric, Metric)
        assert np.isnan(metric.value(metric.partial(empty(metric.of)))), name


@pytest.mark.parametrize(
    "module",
    [
        "uwbbench.measure.accuracy.matching",
        "uwbbench.measure.accuracy.stats",
        "uwbbench.measure.accuracy.metrics.detection",
        "uwbbench.measure.accuracy.metrics.error",
        "uwbbench.measure.accuracy.metrics.track",
        "uwbbench.measure.accuracy.set_distances",
    ],
)
def test_examples_in_docstrings_are_true_and_conventions_are_stated(module):
    loaded = importlib.import_module(module)
    result = doctest.testmod(loaded)
    assert result.attempted > 0
    assert result.failed == 0
    assert "Conventions\n-----------" in loaded.__doc__
