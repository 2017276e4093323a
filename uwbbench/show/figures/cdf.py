"""How the absolute errors of detectors are distributed."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, Any

import numpy as np

from uwbbench.api.errors import ConfigError, ScoringError, nearest
from uwbbench.api.metric import Outcome
from uwbbench.api.text import printable
from uwbbench.measure.accuracy.scoring import ScoringRules, outcomes
from uwbbench.results.curves import ErrorCurve, error_axis, error_curve
from uwbbench.show.figures import style
from uwbbench.show.figures.source import Result, about
from uwbbench.show.text.numbers import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BESIDE = 3
"""Most curves whose legend fits into the axes."""
MOST_POINTS = 10_000
"""Points of a curve at most: no printer shows more steps."""


def draw_cdf(results: list[Result], rules: ScoringRules, table: str = "filtering") -> Figure:
    """Draw the share of detections whose absolute error stays below each value, one curve a detector.

    Captures of one dataset are pooled; datasets, and measured and simulated captures, have panels of their own.

    Parameters
    ----------
    results : list of Result
    rules : ScoringRules
    table : {"filtering", "mapping"}

    Raises
    ------
    ScoringError
        If a capture has no truth or nothing has an error.
    ConfigError
        If there is no such table.
    """
    tables = ("filtering", "mapping")
    if table not in tables:
        raise ConfigError(f"no table '{table}'.{nearest(table, tables)}")
    panels: dict[tuple[str, str, bool], dict[str, list[Outcome]]] = defaultdict(lambda: defaultdict(list))
    for result in results:
        by_table = outcomes(result.detections, result.header, rules.of(result.dataset))
        if table in by_table:
            group = (result.dataset, result.header.source, by_table[table].exhaustive)
            panels[group][result.detector].append(by_table[table])
    curves = {
        group: {name: error_curve(parts, MOST_POINTS) for name, parts in members.items()}
        for group, members in panels.items()
    }
    if not any(curve for members in curves.values() for curve in members.values()):
        raise ScoringError(f"{results[0].detector}: no detection has an error in the table '{table}'")
    with style.styled():
        crowded = max(map(len, curves.values())) > BESIDE
        columns = 1 if crowded else min(len(curves), 2)
        rows = -(-len(curves) // columns)
        drawn = style.figure(style.PAGE_IN if columns > 1 or crowded else 4.6, 0.7 + 2.5 * rows)
        grid = drawn.subplots(rows, columns, sharey=True, squeeze=False).ravel()
        for axes, ((dataset, source, exhaustive), members) in zip(grid, curves.items(), strict=False):
            _panel(axes, members)
            matched = "" if exhaustive else "matched only"
            kind = "SIMULATED" if source == "simulated" else "measured"
            axes.set_title(printable(", ".join(part for part in (dataset, kind, matched) if part)))
        for axes in grid[len(curves) :]:
            axes.set_visible(False)
        for axes in grid[::columns]:
            axes.set_ylabel("Share of detections")
        style.caption(drawn, _sentences(results, rules, table))
    return drawn


def _panel(axes: Any, curves: dict[str, ErrorCurve | None]) -> None:
    handles, labels = [], []
    for place, (name, curve) in enumerate(curves.items()):
        if curve is None:
            labels.append(f"{name} (nothing)")
            handles += axes.plot([], [], color=style.GREY)
            continue
        colour = style.SERIES[place % 7]
        steps = (np.insert(curve.error_m, 0, 0.0), np.insert(curve.share, 0, 0.0))
        handles += axes.step(*steps, where="post", color=colour, ls=style.LINES[place % 7], lw=1.3)
        known_m = (curve.p50_m, curve.p90_m, curve.p95_m)
        for value_m, at, marker in zip(known_m, (0.5, 0.9, 0.95), "osD", strict=True):
            axes.plot([value_m], [at], marker, color=colour, mfc="white", ms=4, zorder=4)
        labels.append(f"{name}: {', '.join(number(value_m, 1, 100.0) for value_m in known_m)} cm (n = {curve.n})")
    for share in (0.5, 0.9, 0.95):
        axes.axhline(share, color="0.7", lw=0.5, ls=":", zorder=0)
    axes.set_yticks([0.0, 0.25, 0.5, 0.75, 0.9, 0.95, 1.0], ["0", "0.25", "0.5", "0.75", "0.90", "0.95", ""])
    axes.set_xlabel("Absolute error (m)")
    near_m, far_m, logarithmic = error_axis([curve for curve in curves.values() if curve is not None])
    if logarithmic:
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_xlim(near_m, far_m)
    axes.set_ylim(0.0, 1.02)
    where: dict[str, Any] = {"loc": "lower right"}
    if len(curves) > BESIDE:
        where = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.0), "borderaxespad": 0.0}
    style.legend(axes, handles, labels, title="median, P90, P95", title_fontsize=7.0, **where)


def _sentences(results: list[Result], rules: ScoringRules, table: str) -> list[str]:
    named = list(dict.fromkeys(about(result.header) for result in results))
    if len(named) > 2:
        named = [f"{len(named)} captures."]
    what = "range after filtering" if table == "filtering" else "distance to the outline after mapping"
    rule = f"Error of the {what}, scoring {rules.scoring}; circle: median, square: P90, diamond: P95."
    partial = any(result.header.truth is not None and not result.header.truth.exhaustive for result in results)
    gate = (
        f"Where the truth is not exhaustive: detections within {rules.gate_m:g} m of an object alone."
        if partial
        else ""
    )
    detectors = list(dict.fromkeys(result.detector for result in results))
    who = f"Detector {detectors[0]}." if len(detectors) == 1 else ""
    return [*named, who, rule, gate]
