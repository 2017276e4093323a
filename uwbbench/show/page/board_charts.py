"""Charts of one board, drawn for every board that a reader can choose."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

from uwbbench.results.curves import error_curve
from uwbbench.results.pareto import points
from uwbbench.results.results import Scored
from uwbbench.results.slices import ALL, Board
from uwbbench.show.charts import error_charts, speed_chart
from uwbbench.show.charts.chart import Spec

if TYPE_CHECKING:
    from uwbbench.show.page.content import Content


@dataclass(frozen=True)
class BoardChart:
    """A kind of chart.

    Attributes
    ----------
    draw : callable
        From the content, a board and a metric to the chart; None where there is nothing to draw.
    of_metric : bool
        Whether it differs with the chosen metric.
    empty : str
        Said where there is nothing to draw.
    """

    draw: Callable[[Content, Board, str], Spec | None]
    of_metric: bool
    empty: str


def pareto(content: Content, board: Board, name: str) -> Spec | None:
    """Speed against error; None where no detector was timed.

    Parameters
    ----------
    content : Content
    board : Board
    name : str
        Metric.
    """
    members: dict[str, list[Scored]] = defaultdict(list)
    for one in content.boards[board]:
        members[one.detector].append(one)
    speeds = content.speeds.get(board[0], {})
    report = content.report
    placed = points(members, speeds, report.metrics[name], report.settings, report.bounds)
    if not placed:
        return None
    quantity = content.quantities[name]
    title = content.title(f"Speed against {quantity.title}", board[0], board[1])
    return speed_chart.speed_against_error(title, placed, content.detectors, quantity)


def by_range(content: Content, board: Board, name: str) -> Spec | None:
    """A metric by range; None where there are no bins.

    Parameters
    ----------
    content : Content
    board : Board
    name : str
        Metric.
    """
    finds = {one.detector for one in content.boards[board] if one.outcome.tp.any()}
    shown = [one for one in content.slices if one.board == board and (one.channel, one.material) == (ALL, ALL)]
    shown = [one for one in shown if one.span != ALL and one.detector in finds]
    shown = [one for one in shown if not math.isnan(one.estimates[name].value)]
    spans = [span for span in content.spans if any(one.span == span for one in shown)]
    if not spans:
        return None
    quantity = content.quantities[name]
    title = content.title(f"{quantity.title} by range", board[0], board[1])
    return error_charts.by_range(title, shown, spans, content.detectors, quantity)


def errors(content: Content, board: Board, name: str) -> Spec | None:  # noqa: ARG001 - the same for every metric
    """Distribution of the errors; None where there are none.

    Parameters
    ----------
    content : Content
    board : Board
    name : str
        Metric; errors are the same whichever it is.
    """
    curves = {}
    for detector in content.report.detectors:
        curve = error_curve([one.outcome for one in content.boards[board] if one.detector == detector])
        if curve is not None:
            curves[detector] = curve
    title = content.title("Errors", board[0], board[1])
    return error_charts.error_cdf(title, curves, content.detectors) if curves else None


BOARD_CHARTS: Mapping[str, BoardChart] = MappingProxyType(
    {
        "pareto": BoardChart(
            pareto,
            of_metric=True,
            empty="Nothing to draw: no detector was both timed against a reference and found anything here.",
        ),
        "range": BoardChart(
            by_range,
            of_metric=True,
            empty="Nothing to draw: the obstacles stay in one range bin, or each bin has too few samples.",
        ),
        "errors": BoardChart(errors, of_metric=False, empty="Nothing to draw: no detection has an error here."),
    }
)
"""By the kind that a section names."""


def drawn(content: Content) -> dict[str, list[dict[str, Spec | None]]]:
    """Every chart of every board: by kind, then board, then metric; ``""`` where all metrics share it."""
    charts: dict[str, list[dict[str, Spec | None]]] = {}
    for kind, chart in BOARD_CHARTS.items():
        charts[kind] = [
            {name: chart.draw(content, board, name) for name in (content.charted(board) if chart.of_metric else [""])}
            for board in content.boards
        ]
    return charts
