"""Sections about errors: charts of causes, and of detectors without their thresholds."""

import dataclasses
import math

import numpy as np
import pytest

from uwbbench.show.charts.chart import Spec
from uwbbench.show.charts.curve_charts import precision_against_recall, recall_against_false_alarms
from uwbbench.show.page import Content, error_sections
from uwbbench.show.text.report import Tables


@pytest.fixture(scope="module")
def charts(content: Content) -> list[Spec]:
    sections = [error_sections.causes(content), error_sections.curves(content)]
    return [chart for section in sections if section is not None for chart in section.charts]


@pytest.mark.slow
def test_every_chart_is_a_valid_specification_that_says_simulated(charts: list[Spec]) -> None:
    import altair  # slow to load

    assert len(charts) == 3
    for chart in charts:
        altair.Chart.from_dict(chart)
        assert "SIMULATED" in chart["title"]["text"]


def test_a_mark_is_the_detector_as_it_is_set(content: Content, charts: list[Spec]) -> None:
    curve = content.report.curves["plates", "simulated", "paper"]
    recall, precision, alarms = (
        float(curve.setting[name].value) for name in ("recall", "precision", "false_alarms_per_minute")
    )
    marks = [
        next(point for point in chart["layer"][-1]["data"]["values"] if point["detector"] == "paper")
        for chart in charts[1:]
    ]
    assert (marks[0]["x"], marks[0]["y"]) == (pytest.approx(recall, rel=1e-4), pytest.approx(precision, rel=1e-4))
    none = charts[2]["layer"][-1]["encoding"]["x"]["scale"]["domain"][0]
    across = max(alarms, none)
    assert (marks[1]["x"], marks[1]["y"]) == (pytest.approx(across, rel=1e-4), pytest.approx(recall, rel=1e-4))


def test_lines_go_through_the_counts_at_every_threshold(content: Content, charts: list[Spec]) -> None:
    curve = content.report.curves["plates", "simulated", "cfar-os"]
    rows = [row for row in charts[1]["data"]["values"] if row["detector"] == "cfar-os"]
    known = ~np.isnan(curve.precision.value)
    np.testing.assert_allclose([row["x"] for row in rows], curve.recall.value[known], rtol=1e-4)
    np.testing.assert_allclose([row["y"] for row in rows], curve.precision.value[known], rtol=1e-4)


def test_a_detector_that_finds_nothing_has_no_line(content: Content, charts: list[Spec]) -> None:
    assert "null" not in {row["detector"] for row in charts[1]["data"]["values"]}
    curves = {"null": content.report.curves["plates", "simulated", "null"]}
    assert precision_against_recall("title", curves, content.detectors) is None
    assert recall_against_false_alarms("title", curves, content.detectors) is None


def test_captures_with_nothing_to_find_have_no_line(content: Content) -> None:
    curve = content.report.curves["plates", "simulated", "paper"]
    unknown = curve.recall._replace(value=np.full(curve.recall.value.shape, np.nan))
    curves = {"paper": dataclasses.replace(curve, recall=unknown)}
    assert precision_against_recall("title", curves, content.detectors) is None
    assert recall_against_false_alarms("title", curves, content.detectors) is None


def test_the_table_is_ordered_by_average_precision(content: Content) -> None:
    (sheet,) = Tables(content.report).curves()
    values = [float(row[1].split()[0]) for row in sheet.rows]
    assert values == sorted(values, reverse=True)
    assert not any(math.isnan(value) for value in values)
    assert {row[6] for row in sheet.rows} == {"score_db", "no candidate"}
