import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api import ConfigError, ScoringError
from uwbbench.detect.pipeline import load_detector
from uwbbench.show.figures.properties import BIN_M, LEAST, draw_properties, running_median
from uwbbench.show.figures.source import from_capture, from_run


def test_the_points_are_the_peaks_nearest_to_the_obstacle(paper, look):
    seen = look(draw_properties([paper]))
    peaks, header = paper.candidates, paper.header
    true_m = header.truth.seen_from(header.radar, header.trajectory).range_m[:, 0]
    expected = []
    for frame in range(len(header)):
        mine = peaks.take(peaks.frame == frame)
        error = np.abs(mine["range_m"] - true_m[frame])
        if len(mine) and np.nanmin(error) <= 0.2:
            best = np.nanargmin(error)
            expected.append((true_m[frame], mine["prominence"][best], mine["width_taps"][best]))
    distance, prominence, width = np.array(expected).T
    for axes, values in enumerate((prominence, width)):
        (points,) = seen.lines("o", axes)
        np.testing.assert_allclose(points, np.stack([distance, values], axis=1))
    assert seen.axes[0].get_ylabel() == "Prominence"
    assert seen.axes[1].get_ylabel() == "Width (taps)"
    assert seen.axes[1].get_xlabel() == "Distance (m)"


def test_materials_of_a_run_differ_in_colour_and_dashes(folder, look):
    legend = look(draw_properties(from_run(folder, "paper"))).legend()
    assert set(legend) == {"metal", "plywood"}
    looks = [(h.get_color(), h.get_linestyle(), h.get_marker()) for h in legend.values()]
    assert all(a != b for a, b in zip(*looks, strict=True))


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.floats(0, 3), st.floats(-5, 5)), max_size=40))
def test_the_running_median_is_the_median_of_each_window(pairs):
    distance_m, value = np.array(pairs, float).reshape(-1, 2).T
    for centre, median in zip(*running_median(distance_m, value), strict=True):
        inside = (distance_m >= centre - BIN_M / 2) & (distance_m < centre + BIN_M / 2)
        expected = np.median(value[inside]) if inside.sum() >= LEAST else np.nan
        np.testing.assert_equal(median, expected)


def test_missing_truth_is_refused(paper):
    blind = dataclasses.replace(paper, header=dataclasses.replace(paper.header, truth=None))
    with pytest.raises(ScoringError, match="has no ground truth"):
        draw_properties([blind])


def test_a_detector_that_measures_no_prominence_is_refused(approach):
    with pytest.raises(ConfigError, match="'cfar-os' does not measure prominence and width_taps"):
        draw_properties([from_capture(approach, load_detector("cfar-os"))])


def test_peaks_far_from_all_obstacles_give_no_picture(approach):
    with pytest.raises(ConfigError, match="no peak of 'null' lies within"):
        draw_properties([from_capture(approach, load_detector("null"))])
