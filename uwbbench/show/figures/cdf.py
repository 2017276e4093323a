"""How the absolute errors of detectors are distributed."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, Any

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.errors import ConfigError, ScoringError, nearest
from uwbbench.measure.accuracy.metrics.error import MeanAbsoluteError, Percentile90, Percentile95
from uwbbench.measure.accuracy.scoring import ScoringRules, outcomes
from uwbbench.show.figures import style
from uwbbench.show.figures.source import Found, about

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BESIDE = 3
"""Most curves whose legend fits into the axes."""
SPREAD, SMALLEST_M = 10.0, 1e-3
"""Ratio of the 95th percentiles from which the errors get a logarithmic axis, and the smallest error on that."""


def draw_cdf(founds: list[Found], rules: ScoringRules, table: str = "filtering") -> Figure:
    """Draw the share of detections whose absolute error stays below each value, one curve a detector.

    Captures of one dataset are pooled; datasets, and measured and simulated captures, have panels of their own.

    Parameters
    ----------
    founds : list of Found
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
    panels: dict[tuple[str, str, bool], dict[str, list[FloatArray]]] = defaultdict(lambda: defaultdict(list))
    for found in founds:
        made = outcomes(found.detections, found.header, rules)
        if table in made:
            group = (found.dataset, found.header.source, made[table].exhaustive)
            panels[group][found.detector].append(np.abs(MeanAbsoluteError.partial(made[table])))
    if not any(len(part) for curves in panels.values() for parts in curves.values() for part in parts):
        raise ScoringError(f"{founds[0].detector}: no detection has an error in the table '{table}'")
    with style.styled():
        crowded = max(map(len, panels.values())) > BESIDE
        columns = 1 if crowded else min(len(panels), 2)
        rows = -(-len(panels) // columns)
        drawn = style.figure(style.PAGE_IN if columns > 1 or crowded else 4.6, 0.7 + 2.5 * rows)
        grid = drawn.subplots(rows, columns, sharey=True, squeeze=False).ravel()
        for axes, ((dataset, source, exhaustive), curves) in zip(grid, panels.items(), strict=False):
            _panel(axes, {name: np.sort(np.concatenate(parts)) for name, parts in curves.items()})
            matched = "" if exhaustive else "matched only"
            kind = "SIMULATED" if source == "simulated" else "measured"
            axes.set_title(style.plain(", ".join(part for part in (dataset, kind, matched) if part)))
        for axes in grid[len(panels) :]:
            axes.set_visible(False)
        for axes in grid[::columns]:
            axes.set_ylabel("Share of detections")
        style.caption(drawn, _sentences(founds, rules, table))
    return drawn


def _panel(axes: Any, curves: dict[str, FloatArray]) -> None:
    handles, labels = [], []
    reach = [float(np.quantile(error_m, 0.95)) for error_m in curves.values() if len(error_m)]
    for number, (name, error_m) in enumerate(curves.items()):
        if not len(error_m):
            labels.append(f"{name} (nothing)")
            handles += axes.plot([], [], color=style.GREY)
            continue
        colour = style.SERIES[number % 7]
        share = np.arange(1, len(error_m) + 1) / len(error_m)
        handles += axes.step(
            np.insert(error_m, 0, 0.0),
            np.insert(share, 0, 0.0),
            where="post",
            color=colour,
            ls=style.LINES[number % 7],
            lw=1.3,
        )
        median, p90, p95 = float(np.median(error_m)), Percentile90.value(error_m), Percentile95.value(error_m)
        for (value, at), marker in zip(((median, 0.5), (p90, 0.9), (p95, 0.95)), "osD", strict=True):
            axes.plot([value], [at], marker, color=colour, mfc="white", ms=4, zorder=4)
        numbers = ", ".join("n/a" if np.isnan(v) else f"{100 * v:.1f}" for v in (median, p90, p95))
        labels.append(f"{name}: {numbers} cm (n = {len(error_m)})")
    for share_ in (0.5, 0.9, 0.95):
        axes.axhline(share_, color="0.7", lw=0.5, ls=":", zorder=0)
    axes.set_yticks([0.0, 0.25, 0.5, 0.75, 0.9, 0.95, 1.0], ["0", "0.25", "0.5", "0.75", "0.90", "0.95", ""])
    axes.set_xlabel("Absolute error (m)")
    farthest = max(1.6 * max(reach, default=1.0), SMALLEST_M)
    if farthest > SPREAD * max(
        min(reach, default=1.0), SMALLEST_M
    ):  # one bad detector would squeeze the others against the axis
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.set_xlim(max(SMALLEST_M, float(np.min([np.min(e) for e in curves.values() if len(e)]))), farthest)
    else:
        axes.set_xlim(0.0, farthest)
    axes.set_ylim(0.0, 1.02)
    place: dict[str, Any] = {"loc": "lower right"}
    if len(curves) > BESIDE:
        place = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.0), "borderaxespad": 0.0}
    style.legend(axes, handles, labels, title="median, P90, P95", title_fontsize=7.0, **place)


def _sentences(founds: list[Found], rules: ScoringRules, table: str) -> list[str]:
    named = list(dict.fromkeys(about(found.header) for found in founds))
    if len(named) > 2:
        named = [f"{len(named)} captures."]
    what = "range after filtering" if table == "filtering" else "distance to the outline after mapping"
    rule = f"Error of the {what}, scoring {rules.scoring}; circle: median, square: P90, diamond: P95."
    partial = any(found.header.truth is not None and not found.header.truth.exhaustive for found in founds)
    gate = (
        f"Where the truth is not exhaustive: detections within {rules.gate_m:g} m of an object alone."
        if partial
        else ""
    )
    detectors = list(dict.fromkeys(found.detector for found in founds))
    who = f"Detector {detectors[0]}." if len(detectors) == 1 else ""
    return [*named, who, rule, gate]
