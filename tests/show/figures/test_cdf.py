import dataclasses

import numpy as np
import pytest

from uwbbench.api import ConfigError, ScoringError
from uwbbench.detect.pipeline import load_detector
from uwbbench.measure.accuracy.scoring import ScoringRules, outcomes, score
from uwbbench.show.figures.cdf import draw_cdf
from uwbbench.show.figures.source import from_capture, from_run


def curve(axes):
    return next(line for line in axes.lines if line.get_drawstyle() == "steps-post").get_xydata()


@pytest.mark.parametrize("table", ["filtering", "mapping"])
def test_the_curve_is_that_of_the_scored_errors(paper, table, look):
    rules = ScoringRules("frame")
    seen = look(draw_cdf([paper], rules, table))
    errors = np.sort(np.abs(outcomes(paper.detections, paper.header, rules)[table].error_m))
    points = curve(seen.axes[0])
    np.testing.assert_allclose(points[1:, 0], errors)
    np.testing.assert_allclose(points[1:, 1], np.arange(1, len(errors) + 1) / len(errors))


def test_median_p90_and_p95_are_those_of_the_scores(paper, look):
    seen = look(draw_cdf([paper], ScoringRules("frame")))
    scores = score(paper.detections, paper.header)
    places = {marker: seen.lines(marker)[0][0] for marker in "osD"}
    assert places["s"] == pytest.approx([scores.p90_m, 0.90])
    assert places["D"] == pytest.approx([scores.p95_m, 0.95])
    assert places["o"][1] == 0.5
    (label,) = seen.legend()
    assert label.startswith(f"paper: {100 * places['o'][0]:.1f}, {100 * scores.p90_m:.1f}, {100 * scores.p95_m:.1f} cm")


def test_a_percentile_without_enough_samples_is_not_drawn(paper, look):
    few = dataclasses.replace(paper, detections=paper.detections.take(np.arange(20)))
    seen = look(draw_cdf([few], ScoringRules("frame")))
    (label,) = seen.legend()
    assert "n/a, n/a" in label
    assert np.isnan(seen.lines("D")[0][0, 0])


def test_datasets_of_a_run_have_panels_and_detectors_curves_of_their_own(folder, look):
    seen = look(draw_cdf(from_run(folder), folder.rules[0]))
    assert [axes.get_title() for axes in seen.axes] == ["metal, SIMULATED", "plywood, SIMULATED"]
    assert [axes.get_xlabel() for axes in seen.axes] == ["Absolute error (m)"] * 2
    looks = {(h.get_color(), h.get_linestyle()) for h in seen.axes[0].get_legend().legend_handles}
    assert len(looks) == 2


def test_an_unknown_table_is_named_with_the_nearest(paper):
    with pytest.raises(ConfigError, match=r"no table 'maping'\. Did you mean 'mapping'"):
        draw_cdf([paper], ScoringRules("frame"), "maping")


def test_missing_truth_is_refused(paper):
    blind = dataclasses.replace(paper, header=dataclasses.replace(paper.header, truth=None))
    with pytest.raises(ScoringError, match="no ground truth"):
        draw_cdf([blind], ScoringRules("frame"))


def test_a_detector_without_clusters_has_no_errors_after_mapping(folder):
    with pytest.raises(ScoringError, match="cfar-os: no detection has an error in the table 'mapping'"):
        draw_cdf(from_run(folder, "cfar-os"), folder.rules[0], "mapping")


def test_detectors_far_apart_share_a_logarithmic_axis_with_plain_numbers(paper, approach, look):
    oracle = from_capture(approach, load_detector("oracle"))
    seen = look(draw_cdf([paper, oracle], ScoringRules("frame")))
    axes = seen.axes[0]
    seen.figure.draw_without_rendering()
    assert axes.get_xscale() == "log"
    assert {"0.01", "0.1"} <= {label.get_text() for label in axes.get_xticklabels()}
    assert look(draw_cdf([paper], ScoringRules("frame"))).axes[0].get_xscale() == "linear"


def test_errors_of_zero_are_drawn_on_a_linear_axis(approach, look):
    seen = look(draw_cdf([from_capture(approach, load_detector("oracle"))], ScoringRules("frame")))
    assert seen.axes[0].get_xscale() == "linear"
    assert seen.axes[0].get_xlim() == (0.0, 0.001)
