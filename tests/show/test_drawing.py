"""Charts drawn in a process of their own, which may end without taking anything along."""

import pytest

from uwbbench.show import drawing
from uwbbench.show.extras import ReportToolsError

CHART = {
    "$schema": "https://vega.github.io/schema/vega-lite/v6.json",
    "data": {"values": [{"x": 1.0}, {"x": 2.0}]},
    "mark": "point",
    "encoding": {"x": {"field": "x", "type": "quantitative"}},
}


def test_a_chart_becomes_a_picture() -> None:
    drawn = drawing.svg(CHART)
    assert drawn.startswith("<svg")
    assert drawing.png(drawn).startswith(b"\x89PNG")


def test_an_engine_that_ends_is_an_error_with_its_end_and_the_next_chart_is_drawn() -> None:
    drawing.svg(CHART)
    (engine,) = drawing._running
    engine.kill()
    engine.wait()
    assert drawing.svg(CHART).startswith("<svg")
    with pytest.raises(ReportToolsError, match=r"their engine ended \(exit code 1\)"):
        drawing._asked("film", CHART)
    assert drawing.svg(CHART).startswith("<svg")
