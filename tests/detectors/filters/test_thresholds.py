"""Filters keep what lies inside their limits, and nothing that is NaN."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uwbbench.api import ConfigError, Detections
from uwbbench.detect.pipeline import detector_from_yaml

LIMITS = {
    "filter.prominence": ("prominence", {"minimum": 1.0}),
    "filter.width": ("width_taps", {"minimum": 1.0, "maximum": 3.0}),
    "filter.snr": ("score_db", {"minimum_db": 1.0}),
    "filter.pdoa": ("pdoa_rad", {"maximum_rad": 1.0}),
    "filter.range": ("range_m", {"minimum_m": 1.0, "maximum_m": 3.0}),
    "filter.first_path": ("tap", {"guard_taps": 1.0}),
}


@pytest.fixture
def keep(make_radar, make_block, make_stage, run_stage):
    """Values of one column that a filter keeps, in one frame."""

    def keep(name, params, column, values, first_path=0.0):
        found = Detections(np.zeros(len(values), int), **{column: values})
        block = make_block(np.ones((1, 50)), detections=found, first_path=np.array([first_path]))
        return run_stage(make_stage(name, **params), make_radar(), block).detections[column].tolist()

    return keep


@pytest.mark.parametrize("name", LIMITS)
def test_nan_passes_no_filter(keep, name):
    column, params = LIMITS[name]
    assert keep(name, params, column, [np.nan]) == []


def test_a_detection_without_a_first_path_is_dropped(keep):
    assert keep("filter.first_path", {}, "tap", [20.0], first_path=np.nan) == []


@pytest.mark.parametrize(
    ("name", "values", "expected"),
    [
        ("filter.prominence", [0.5, 1.0, 2.0], [1.0, 2.0]),
        ("filter.width", [0.5, 1.0, 3.0, 3.5], [1.0, 3.0]),
        ("filter.snr", [-np.inf, 0.5, 1.0, 9.0], [1.0, 9.0]),
        ("filter.pdoa", [-1.5, -1.0, 0.0, 1.0, 1.5], [-1.0, 0.0, 1.0]),
        ("filter.range", [0.5, 1.0, 3.0, 3.5], [1.0, 3.0]),
        ("filter.first_path", [0.5, 1.0, 1.5, 2.0], [1.5, 2.0]),
    ],
)
def test_limits_are_inclusive_and_the_first_path_guard_is_not(keep, name, values, expected):
    column, params = LIMITS[name]
    assert keep(name, params, column, values) == expected


def test_the_default_pdoa_limit_is_45_degrees_of_the_printed_formula(make_stage):
    assert make_stage("filter.pdoa").params.maximum_rad == pytest.approx(np.pi * np.sin(0.95 * np.pi / 4), abs=5e-5)


@given(st.lists(st.tuples(st.integers(0, 4), st.floats(0, 20)), max_size=12))
def test_each_detection_is_compared_with_the_first_path_of_its_own_frame(
    make_radar, make_block, make_stage, run_stage, rows
):
    frame, tap = np.array([r[0] for r in rows], int), np.array([r[1] for r in rows])
    first_path = np.array([0.0, 5.0, np.nan, 10.0, 15.5])
    block = make_block(np.ones((5, 20)), first=30, first_path=first_path, detections=Detections(frame + 30, tap=tap))
    found = run_stage(make_stage("filter.first_path", guard_taps=2), make_radar(20), block).detections
    assert found["tap"].tolist() == [t for f, t in rows if t > first_path[f] + 2]


def detector(step):
    sources = "[{use: profile.amplitude}, {use: peaks}, {use: first_path.crest}, {use: range}, "
    return detector_from_yaml(f"schema: 1\nname: test\npipeline: {sources}{step}]\n")


@pytest.mark.parametrize(
    ("step", "message"),
    [
        ("{use: filter.range}", "give minimum_m, maximum_m or both"),
        ("{use: filter.range, params: {minimum_m: 3, maximum_m: 1}}", r"minimum_m \(3\) lies above maximum_m \(1\)"),
        ("{use: filter.width, params: {minimum: 3, maximum: 1}}", r"minimum \(3\) lies above maximum \(1\)"),
        ("{use: filter.prominence}", "key 'minimum' is missing"),
    ],
)
def test_limits_that_cannot_be_meant_are_refused(step, message):
    with pytest.raises(ConfigError, match=message):
        detector(step)
