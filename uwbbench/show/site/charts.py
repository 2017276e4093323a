"""Charts of a site as SVG pictures, in the colours of the page around them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from uwbbench.results.curves import error_curve
from uwbbench.results.leaderboard.ranking import SETTINGS, Ranking
from uwbbench.results.pareto import points
from uwbbench.run.folder.identity import digest
from uwbbench.show import drawing
from uwbbench.show.charts import error_charts, speed_chart
from uwbbench.show.charts.chart import Spec
from uwbbench.show.charts.theme import PAGE
from uwbbench.show.text.quantity import Quantity
from uwbbench.show.text.sheet import shown

WIDTH = 760


def pareto(ranking: Ranking, metric: str, title: str, names: Mapping[str, str]) -> Spec | None:
    """Speed against a metric, of the detectors that were timed and scored on all captures; None where there is none.

    Parameters
    ----------
    ranking : Ranking
    metric : str
        One that its suite shows.
    title : str
        Of the dataset's section; says so where captures are simulated.
    names : mapping of str to str
        Labels of contenders by key.
    """
    members = {one.contender.key: one.scored for one in ranking.standings if len(one.scored) == ranking.captures}
    speeds = {
        one.contender.key: replace(one.speed, reference=shown(one.speed.reference))
        for one in ranking.standings
        if one.speed is not None
    }
    drawn = points(members, speeds, ranking.metrics[metric], SETTINGS, ranking.ranks.bounds)
    if not drawn:
        return None
    quantity = Quantity.of(metric, ranking.metrics[metric])
    return speed_chart.speed_against_error(f"{title}: speed against {quantity.title}", drawn, names, quantity)


def errors(ranking: Ranking, title: str, names: Mapping[str, str]) -> Spec | None:
    """Distribution of the errors; None where nothing was found.

    Parameters
    ----------
    ranking : Ranking
    title : str
        Of the dataset's section; says so where captures are simulated.
    names : mapping of str to str
        Labels of contenders by key.
    """
    curves = {one.contender.key: error_curve([part.outcome for part in one.scored]) for one in ranking.standings}
    known = {key: curve for key, curve in curves.items() if curve is not None}
    return error_charts.error_cdf(f"{title}: errors", known, names) if known else None


def svg(spec: Spec) -> str:
    """SVG of a chart; what a screen reader says of it is beside it, not inside.

    Raises
    ------
    ReportToolsError
        If vl-convert is not installed.
    """
    complete: dict[str, Any] = {**spec, "width": WIDTH, "config": PAGE}
    drawn: str = drawing.svg(complete)
    plain = re.sub(r' (?:role|aria-[a-z]+)="[^"<>]*"', "", drawn)
    # vl-convert counts clips through its whole life; on a page they must be distinct, and the same every time.
    chart, places = digest(spec)[:8], dict[str, int]()
    return re.sub(
        r'(id="|url\(#)clip(\d+)', lambda m: f"{m[1]}clip-{chart}-{places.setdefault(m[2], len(places))}", plain
    )
