"""Numbers of a site as cells: values with their intervals, times, and differences of pairs."""

from __future__ import annotations

import math
import re

from uwbbench.measure.accuracy.stats import Estimate
from uwbbench.results.leaderboard.ranking import Ranking, Standing
from uwbbench.results.verdicts import Pair, rank_text
from uwbbench.show.html.cell import Cell
from uwbbench.show.text.numbers import between, interval, number, significant
from uwbbench.show.text.quantity import Quantity


def quantity(ranking: Ranking, name: str) -> Quantity:
    """How a metric of a board is shown."""
    return Quantity.of(name, ranking.metrics[name])


def metric_cell(by: Quantity, estimate: Estimate) -> Cell:
    """Value with its interval below."""
    text = number(estimate.value, by.digits, by.factor)
    ends = between(estimate.low, estimate.high, by.digits, by.factor)
    return Cell(text, small=ends, key=_key(estimate.value), title=by.in_full(estimate))


def rank_cell(standing: Standing) -> Cell:
    """Rank set of a detector."""
    key = "n/a" if standing.ranks is None else f"{sum(standing.ranks) / 2:g}"
    return Cell(rank_text(standing.ranks), key=key)


def speed_cell(standing: Standing) -> Cell:
    """Time ratio with its interval below; absolute times hold on one machine only and are not shown here."""
    speed = standing.speed
    if speed is None:
        return Cell("not timed", key="n/a")
    ends = "" if math.isnan(speed.low) else f"[{significant(speed.low)}, {significant(speed.high)}]"
    return Cell(significant(speed.ratio), small=ends, key=_key(speed.ratio))


def pair_text(ranking: Ranking, pair: Pair) -> str:
    """Difference with unit and interval."""
    by, d = quantity(ranking, pair.metric), pair.difference
    text = f"{interval(d.value, d.low, d.high, by.digits, by.factor)} {by.unit}".strip()
    return re.sub(r"-(0\.0*)(?!\d)", r"\1", text)  # what rounds to nothing has no sign


def pair_cell(ranking: Ranking, pair: Pair) -> Cell:
    """Difference of a pair."""
    return Cell(pair_text(ranking, pair), key=_key(pair.difference.value))


def _key(value: float) -> str:
    return "n/a" if math.isnan(value) else f"{value:.6g}"
