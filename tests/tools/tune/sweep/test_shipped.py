"""Every shipped detector that has thresholds can be swept, also those that look at many frames."""

import numpy as np
import pytest

from tests.fixtures.shipped import PIPELINES
from uwbbench.api import ConfigError, registry
from uwbbench.api.filters import LimitFilter
from uwbbench.detect.pipeline import load_detector
from uwbbench.tools.tune.sweep.sweep import Sweep


def thresholds(detector, capture):
    """Three thresholds of each of the first three limited columns, taken from the peaks."""
    peaks = detector.run(capture).candidates
    grid = {}
    for step in detector.config.steps:
        stage = registry.load_plugin("stages", step.use)
        for name, limit in stage.limits.items() if issubclass(stage, LimitFilter) else ():
            values = np.abs(peaks[limit.column])
            if name in step.params and np.isfinite(values).any():
                values = np.quantile(values[np.isfinite(values)], [0.2, 0.6, 0.9], method="nearest")
                grid[f"pipeline.{step.label}.params.{name}"] = values.tolist()
    return dict(list(grid.items())[:3])


LIMITED = {
    name: pipeline
    for name, pipeline in PIPELINES.items()
    if pipeline.config.mapper is None
    and any(step.use in ("filter.snr", "filter.prominence", "filter.width") for step in pipeline.config.steps)
}
COMPARING = [
    name
    for name, pipeline in LIMITED.items()
    if any(step.use == "select.first_above" for step in pipeline.config.steps)
]
SWEEPABLE = [name for name in LIMITED if name not in COMPARING]


@pytest.mark.parametrize("name", COMPARING)
def test_a_detector_that_compares_detections_is_refused(name):
    detector = load_detector(name)
    with pytest.raises(ConfigError, match=r"'select\.first_above' looks at several detections at once"):
        Sweep(detector, {"pipeline.filter.snr.params.minimum_db": [5.0, 10.0]})


@pytest.mark.parametrize("name", SWEEPABLE)
def test_every_set_of_a_shipped_detector_equals_running_it(short, name):
    detector, capture = load_detector(name), short(9, True)
    clusters = [step.label for step in detector.config.steps if step.use == "dbscan"]
    sweep = Sweep(detector, thresholds(detector, capture), leave_out=clusters)
    swept = sweep.run(capture)
    for index in range(0, len(sweep), 2):
        expected, found = sweep.detector(index).run(capture, fused=False), swept.detections(index)
        assert np.array_equal(found.frame, sweep.detector(index).run(capture).frame)
        for column in expected.columns:
            assert np.array_equal(found[column], expected[column], equal_nan=True), column
    assert len(set(swept.retained.tolist())) > 1  # the thresholds matter
