"""Every threshold set of a sweep against the detector with these thresholds."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api import ConfigError
from uwbbench.detect.pipeline import detector_from_yaml, load_detector
from uwbbench.tools.tune.sweep.sweep import Sweep

PROMINENCE = "pipeline.filter.prominence.params.minimum"
WIDTH = "pipeline.filter.width.params.minimum"
WIDEST = "pipeline.filter.width.params.maximum"
SCORE = "pipeline.filter.snr.params.minimum_db"
PDOA = "pipeline.filter.pdoa.params.maximum_rad"
COLUMN = {PROMINENCE: "prominence", WIDTH: "width_taps", SCORE: "score_db", PDOA: "pdoa_rad"}


def assert_equal_to_running_each(sweep, capture):
    swept = sweep.run(capture)
    for index in range(len(sweep)):
        found, fused = swept.detections(index), sweep.detector(index).run(capture)
        expected = sweep.detector(index).run(capture, fused=False)
        assert set(found.columns) == set(expected.columns) == set(fused.columns)
        for column in expected.columns:
            assert np.array_equal(found[column], expected[column], equal_nan=True), (sweep.values(index), column)
            assert np.allclose(found[column], fused[column], rtol=1e-12, atol=1e-12, equal_nan=True)
        assert np.array_equal(found.frame, fused.frame)
        np.testing.assert_allclose(found["tap"], fused["tap"], rtol=0, atol=1e-12)  # logarithms are rounded otherwise
        assert np.array_equal(found.processed, expected.processed)
        assert swept.retained[index] == len(expected)
        if swept.count == 1:
            rows = swept.rows([index])[0]
            assert np.array_equal(swept.found.take(rows[rows >= 0])["tap"], expected["tap"])
            assert np.array_equal(found.processed[rows >= 0], expected.frame)


@pytest.mark.slow
@given(data=st.data())
@settings(max_examples=40, deadline=None)
def test_every_set_equals_the_detector_with_thresholds_taken_from_the_peaks_themselves(short, data):
    capture = short(data.draw(st.sampled_from([5, 9])), data.draw(st.booleans()))
    selection = data.draw(st.sampled_from(["select.strongest", "select.nearest", "select.all"]))
    params = {} if selection == "select.all" else {"count": data.draw(st.sampled_from([1, 1, 2]))}
    name = data.draw(st.sampled_from(["paper-filtering", "paper-subsample"]))
    detector = load_detector(name, changes={"pipeline.select.strongest": {"use": selection, "params": params}})
    peaks = detector.run(capture).candidates
    paths = data.draw(st.lists(st.sampled_from(list(COLUMN)), min_size=1, max_size=3, unique=True))
    grid = {}
    for path in paths:
        known = np.abs(peaks[COLUMN[path]])
        known = known[np.isfinite(known)]
        own = st.sampled_from(sorted(known.tolist())) if len(known) else st.just(1.0)
        grid[path] = data.draw(st.lists(own, min_size=1, max_size=3))
    assert_equal_to_running_each(Sweep(detector, grid), capture)


def test_a_null_threshold_and_a_largest_value_are_swept_too(short):
    peaks = load_detector("paper-filtering").run(short(9, True)).candidates
    widths = np.quantile(peaks["width_taps"], [0.3, 0.9], method="nearest").tolist()
    detector = load_detector("paper-filtering", changes={WIDTH: 0.0})
    assert_equal_to_running_each(Sweep(detector, {WIDEST: [widths[1], None, widths[0]]}), short(9, True))


def test_the_mapping_can_be_left_out_and_positions_stay(short):
    sweep = Sweep(load_detector("paper"), {PROMINENCE: [0.02, 0.1], SCORE: [15, 25]}, leave_out=["dbscan"])
    assert_equal_to_running_each(sweep, short(9, True))
    assert "x_m" in sweep.run(short(9, True)).found


def test_equal_amplitudes_go_to_the_earlier_tap_also_where_interpolation_follows(short):
    capture = short(9, False)
    mirrored = np.array(capture.preamble)
    mirrored[:, 20:40] = 0.1 + 0.05 * (np.arange(20) % 4 == 1)  # equal peaks every four taps
    tied = dataclasses.replace(capture, preamble=mirrored.astype(complex))
    sweep = Sweep(load_detector("paper-subsample"), {PROMINENCE: [0.0, 0.001, 0.5], WIDTH: [0.0, 1.0]})
    assert_equal_to_running_each(sweep, tied)


def test_a_peak_without_a_value_passes_no_threshold(short):
    capture = short(9, False)
    silent = np.array(capture.preamble)
    silent[:, :4] = 0  # no noise: the score is NaN
    swept = Sweep(load_detector("paper-filtering"), {SCORE: [-1000, 10]}).run(
        dataclasses.replace(capture, preamble=silent)
    )
    assert swept.retained.tolist() == [0, 0]


def test_invalid_frames_retain_nothing(short):
    capture = short(9, False)
    broken = np.array(capture.preamble)
    broken[3] = np.nan
    capture = dataclasses.replace(capture, preamble=broken)
    sweep = Sweep(load_detector("paper-filtering"), {PROMINENCE: [0.0, 0.05]})
    assert_equal_to_running_each(sweep, capture)
    assert 3 not in sweep.run(capture).found.processed


def test_sets_are_numbered_as_itertools_product_does():
    sweep = Sweep(load_detector("paper-filtering"), {PROMINENCE: [0.1, 0.01], SCORE: [20, 10, 15]})
    assert (len(sweep), sweep.shape) == (6, (2, 3))
    assert [tuple(sweep.values(index).values()) for index in (0, 1, 5)] == [(0.1, 20), (0.1, 10), (0.01, 15)]


def test_contradictory_thresholds_retain_nothing_and_are_no_detector(short):
    sweep = Sweep(load_detector("paper-filtering"), {WIDTH: [0.5, 3.0], WIDEST: [2.0, 5.0]})
    assert sweep.run(short(9, False)).retained[2] == 0  # from 3 to 2 taps
    with pytest.raises(ConfigError, match=r"minimum \(3\) lies above maximum \(2\)"):
        sweep.detector(2)


def test_rows_are_refused_where_a_frame_may_retain_several(short):
    detector = load_detector("paper-filtering", changes={"pipeline.select.strongest.params": {"count": 2}})
    with pytest.raises(ValueError, match="more than one"):
        Sweep(detector, {PROMINENCE: [0.1]}).run(short(9, False)).rows([0])


CHAIN = "schema: 1\nname: own\npipeline: [{use: profile.amplitude}, {use: peaks}, {use: first_path.crest}, STEPS]\n"


@pytest.mark.parametrize(
    ("steps", "grid", "message"),
    [
        ("{use: filter.width, params: {minimum: 1}}", {}, "at least one threshold"),
        ("{use: filter.width, params: {minimum: 1}}", {WIDTH: []}, "at least one value"),
        ("{use: filter.width, params: {minimum: 1}}", {WIDTH: ["wide"]}, "expected numbers or null, found 'wide'"),
        ("{use: filter.width, params: {minimum: 1}}", {WIDTH: [-1]}, "greater than or equal to 0"),
        ("{use: filter.width, params: {minimum: 1}}", {PROMINENCE: [1]}, "no item 'filter.prominence"),
        ("{use: filter.width, params: {minimum: 1}}", {"name": [1]}, "no parameter of a step"),
        ("{use: filter.width, params: {minimum: 1}}", {"pipeline.peaks.params.window_taps": [5]}, "no filter that"),
        ("{use: filter.first_path}", {"pipeline.filter.first_path.params.guard_taps": [1]}, "no filter that compares"),
        (
            "{use: select.strongest}, {use: filter.width, params: {minimum: 1}}",
            {WIDTH: [1]},
            "'filter.width' filters behind the selection 'select.strongest'",
        ),
        (
            "{use: filter.width, params: {minimum: 1}}, {use: azimuth}, {use: range}, {use: position}, {use: dbscan}",
            {WIDTH: [1]},
            "'dbscan' looks at several detections at once",
        ),
        (
            "{use: range}, {use: filter.range, params: {maximum_m: 2}}, {use: range, as: again, params: {bias_m: 1}}",
            {"pipeline.filter.range.params.maximum_m": [1, 2]},
            "step 'again' replaces 'range_m', which 'filter.range' has compared",
        ),
    ],
)
def test_what_cannot_be_swept_is_refused_with_the_reason(steps, grid, message):
    steps = steps.replace("{use: azimuth}", "{use: pdoa}, {use: azimuth}")
    with pytest.raises(ConfigError, match=message):
        Sweep(detector_from_yaml(CHAIN.replace("STEPS", steps)), grid)


def test_leaving_out_an_unknown_step_names_the_nearest():
    with pytest.raises(ConfigError, match=r"no step 'dbscn'\. Did you mean 'dbscan'"):
        Sweep(load_detector("paper"), {WIDTH: [1]}, leave_out=["dbscn"])


def test_a_grid_too_large_for_memory_is_refused():
    grid = {path: np.linspace(0, 1, 1000).tolist() for path in (PROMINENCE, WIDTH, SCORE)}
    with pytest.raises(ConfigError, match="1000000000 sets"):
        Sweep(load_detector("paper-filtering"), grid)
