"""Sections about errors: where they come from, and what detectors would find at other thresholds."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import TYPE_CHECKING

from uwbbench.show.charts import cause_chart, curve_charts
from uwbbench.show.charts.chart import Spec
from uwbbench.show.page.section import Section
from uwbbench.show.text.error_sheets import main_causes
from uwbbench.show.text.report import Tables

if TYPE_CHECKING:
    from uwbbench.show.page.content import Content


def causes(content: Content) -> Section | None:
    """What each cause of errors costs, one chart and one table for each dataset."""
    sheets = tuple(Tables(content.report).causes())
    if not sheets:
        return None
    every = (
        "Each miss has one cause and each false detection one kind; they add up to the misses and false alarms of the "
        "leaderboard.",
    )
    return Section("causes", "Where errors come from", charts=tuple(_cause_charts(content)), notes=every, folded=sheets)


def _cause_charts(content: Content) -> Iterator[Spec]:
    known = [one for one in content.report.causes if one.board in content.boards]
    for board, members in groupby(main_causes(known), key=lambda one: one.board):
        title = content.title(f"Causes of errors ({board[2]} scoring)", board[0], board[1])
        spec = cause_chart.causes_of_errors(title, list(members), content.detectors)
        if spec is not None:
            yield spec


def curves(content: Content) -> Section | None:
    """Precision against recall and recall against false alarms, for each dataset."""
    sheets = tuple(Tables(content.report).curves())
    if not sheets:
        return None
    return Section("curves", "At every threshold", charts=tuple(_curve_charts(content)), sheets=sheets)


def _curve_charts(content: Content) -> Iterator[Spec]:
    boards = {board[:2] for board in content.boards}
    every = {key: curve for key, curve in content.report.curves.items() if key[:2] in boards}
    for (dataset, source), keys in groupby(every, key=lambda key: key[:2]):
        members = {key[2]: every[key] for key in keys}
        for what, draw in (
            ("Precision against recall", curve_charts.precision_against_recall),
            ("Recall against false alarms", curve_charts.recall_against_false_alarms),
        ):
            spec = draw(content.title(what, dataset, source), members, content.detectors)
            if spec is not None:
                yield spec
