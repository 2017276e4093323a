"""Detectors against physical limits: error and detection against SNR, false alarms, resolution of two echoes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from uwbbench.api.geometry import SPEED_OF_LIGHT_M_S
from uwbbench.results.limits import CLEAR_M, GATE_M
from uwbbench.show.charts.chart import PLAIN_NUMBERS, Series, Spec, axis, chart
from uwbbench.show.text.numbers import between, number, significant, times

if TYPE_CHECKING:
    import pandas as pd

USUAL = 0.9
"""Probability of detection from which an error is that of nearly all echoes, and not of the lucky ones."""


def error_against_snr(table: pd.DataFrame, names: Mapping[str, str]) -> Spec:
    """Root-mean-square range error of each detector against SNR, above the Cramer-Rao bound.

    Parameters
    ----------
    table : DataFrame
        :attr:`uwbbench.results.limits.Limits.accuracy`.
    names : mapping of str to str
        Labels of detectors.
    """
    rows = [
        {
            "detector": names[row["detector"]],
            "snr": row["snr_db"],
            "error": 100 * row["rmse_m"],
            "usual": row["share"] >= USUAL,
            "text": f"{number(row['rmse_m'], 2, 100)} cm, {times(row['ratio'])} the bound",
            "found": f"{number(row['share'], 3)} {between(row['low'], row['high'], 3)} of {row['n']} echoes",
        }
        for row in table.to_dict("records")
        if 0 < row["rmse_m"] < math.inf  # no error at all, of one that looks up the truth, has no place on a log axis
    ]
    bounds = sorted({(row["snr_db"], 100 * row["bound_m"]) for row in table.to_dict("records")})
    bound = [{"snr": snr_db, "error": bound_cm} for snr_db, bound_cm in bounds]
    look = Series(names, [row["detector"] for row in rows]).encoding()
    known = [row["error"] for row in [*rows, *bound]]
    scale = {"type": "log", "domain": [min(known) / 1.25, max(known) * 1.25], "nice": False}
    up = axis("error", "Range error (cm RMS, log)", scale=scale, axis={"format": PLAIN_NUMBERS})
    across = _snr(bound)
    tooltip = [
        {"field": "detector", "title": "Detector"},
        {"field": "text", "title": "Range error"},
        {"field": "found", "title": "Found"},
    ]
    point = {"type": "point", "size": 80, "opacity": 1, "strokeWidth": 1.8}
    layers: list[Spec] = [
        {
            "data": {"values": bound},
            "mark": {"type": "line", "style": "bound"},
            "encoding": {"x": across, "y": up},
        },
        {
            "data": {"values": [{**bound[-1], "text": "Cramer-Rao bound"}]},
            "mark": {"type": "text", "align": "right", "baseline": "top", "dx": -14, "dy": 2, "style": "label"},
            "encoding": {"x": across, "y": up, "text": {"field": "text"}},
        },
        {"mark": {"type": "line", "strokeWidth": 1.5}, "encoding": {"x": across, "y": up, "color": look["color"]}},
        {"mark": {**point, "filled": False}, "encoding": {"x": across, "y": up, **look, "tooltip": tooltip}},
        {
            "transform": [{"filter": "datum.usual"}],
            "mark": {**point, "filled": True},
            "encoding": {"x": across, "y": up, **look, "tooltip": tooltip},
        },
    ]
    subtitle = (
        f"One echo at {CLEAR_M[0]:g} to {CLEAR_M[1]:g} m, error of the detection within {100 * GATE_M:g} cm. Hollow: "
        f"fewer than {USUAL:.0%} of the echoes were found, the strong ones."
    )
    return chart("Range error against SNR, SIMULATED", subtitle, layers, data={"values": rows})


def detection_against_snr(table: pd.DataFrame, names: Mapping[str, str]) -> Spec:
    """Probability of detection of each detector against SNR.

    Parameters
    ----------
    table : DataFrame
        :attr:`uwbbench.results.limits.Limits.accuracy`.
    names : mapping of str to str
        Labels of detectors.
    """
    rows = [_share(row, names, snr=row["snr_db"]) for row in table.to_dict("records")]
    subtitle = f"One echo at {CLEAR_M[0]:g} to {CLEAR_M[1]:g} m; bars: exact 95 % intervals."
    up = "Share of the echoes that are found"
    return _shares("Detection against SNR, SIMULATED", subtitle, rows, _snr(rows), up, names)


def resolution(table: pd.DataFrame, names: Mapping[str, str]) -> Spec:
    """How often two equal echoes are resolved, against their distance.

    Parameters
    ----------
    table : DataFrame
        :attr:`uwbbench.results.limits.Limits.resolution`.
    names : mapping of str to str
        Labels of detectors.
    """
    metres_a_ns = SPEED_OF_LIGHT_M_S * 1e-9 / 2
    rows = [
        _share(row, names, apart=100 * metres_a_ns * row["separation_ns"], ns=row["separation_ns"])
        for row in table.to_dict("records")
    ]
    across = axis(
        "apart", "Distance of the echoes (cm of range)", scale={"zero": False}, axis={"format": PLAIN_NUMBERS}
    )
    subtitle = "Two equal echoes of random phase, both found; bars: exact 95 % intervals."
    up = "Share of the pairs that are resolved"
    return _shares("Resolution of two echoes, SIMULATED", subtitle, rows, across, up, names)


def false_alarms(table: pd.DataFrame, names: Mapping[str, str]) -> Spec:
    """Measured rate of false alarms of each detector, and the rate that it asks for.

    Parameters
    ----------
    table : DataFrame
        :attr:`uwbbench.results.limits.Limits.false_alarms`.
    names : mapping of str to str
        Labels of detectors.
    """
    rows: list[Spec] = []
    for row in table.to_dict("records"):
        asked, share = row["requested"], row["share"]
        compared = f", {times(share / asked)} the {asked:g} asked for" if asked > 0 else ", no rate is asked for"
        rows.append(
            {
                "detector": names[row["detector"]],
                "rate": share if share > 0 else None,
                "low": max(row["low"], 1e-7),
                "high": row["high"],
                "asked": asked if asked > 0 else None,
                "text": f"{row['alarms']} alarms in {row['n']} cells{compared}",
            }
        )
    series = Series(names, [row["detector"] for row in rows])
    look = series.encoding(legend=False)
    ends = [row[key] for row in rows for key in ("rate", "high", "asked") if row[key]]
    reach = [min(ends) / 2, max(ends) * 2]
    decades = range(math.floor(math.log10(reach[0])), math.ceil(math.log10(reach[1])) + 1)
    steps = [first * 10.0**power for power in decades for first in (1, 2, 5)]
    shown = {"format": PLAIN_NUMBERS, "values": [step for step in steps if reach[0] <= step <= reach[1]]}
    scale = {"type": "log", "domain": reach, "nice": False, "clamp": True}
    across = {"scale": scale, "axis": {**shown, "labelOverlap": "greedy", "labelSeparation": 8}}
    up = {"field": "detector", "type": "nominal", "title": None, "sort": series.detectors, "axis": {"labelLimit": 210}}
    tooltip = [{"field": "detector", "title": "Detector"}, {"field": "text", "title": "False alarms"}]
    layers: list[Spec] = [
        {
            "mark": {"type": "tick", "thickness": 2, "size": 22, "style": "asked"},
            "encoding": {"x": axis("asked", "False alarms a cell of noise (log)", **across), "y": up},
        },
        {
            "mark": {"type": "rule", "strokeWidth": 1.6},
            "encoding": {
                "x": axis("low", "", **across),
                "x2": {"field": "high"},
                "y": up,
                "color": look["color"],
            },
        },
        {
            "transform": [{"filter": "isValid(datum.rate)"}],
            "mark": {"type": "point", "filled": True, "size": 80, "opacity": 1},
            "encoding": {"x": axis("rate", "", **across), "y": up, **look, "tooltip": tooltip},
        },
    ]
    subtitle = (
        "Upright strokes: the rate that a detector asks for; bars: 95 % intervals over frames; no mark: none seen."
    )
    return chart("False alarms against the requested rate, SIMULATED", subtitle, layers, data={"values": rows})


def _snr(rows: list[Spec]) -> Spec:
    values = sorted({row["snr"] for row in rows})
    room = 0.04 * (values[-1] - values[0]) or 1.0
    scale = {"domain": [values[0] - room, values[-1] + room], "nice": False, "zero": False}
    return axis("snr", "Signal-to-noise ratio (dB)", scale=scale, axis={"values": values, "format": "~r"})


def _share(row: Mapping[Any, Any], names: Mapping[str, str], **place: float) -> Spec:
    text = f"{number(row['share'], 3)} {between(row['low'], row['high'], 3)}, n = {row['n']}"
    where = ", ".join(f"{significant(value, 3)} {unit}" for unit, value in place.items() if unit == "ns")
    ends = {"low": row["low"], "high": row["high"]}
    return {"detector": names[row["detector"]], "share": row["share"], **ends, **place, "text": text, "where": where}


def _shares(title: str, subtitle: str, rows: list[Spec], across: Spec, up: str, names: Mapping[str, str]) -> Spec:
    """Lines of shares with their intervals."""
    look = Series(names, [row["detector"] for row in rows]).encoding()
    y = {"scale": {"domain": [0, 1]}, "axis": {"format": "~%", "values": [0, 0.25, 0.5, 0.75, 1]}}
    tooltip = [{"field": "detector", "title": "Detector"}, {"field": "text", "title": "Share"}]
    if rows and rows[0]["where"]:
        tooltip.insert(1, {"field": "where", "title": "Apart"})
    layers: list[Spec] = [
        {
            "mark": {"type": "line", "strokeWidth": 1.5},
            "encoding": {"x": across, "y": axis("share", up, **y), "color": look["color"]},
        },
        {
            "mark": {"type": "rule", "strokeWidth": 1.3},
            "encoding": {"x": across, "y": axis("low", up, **y), "y2": {"field": "high"}, "color": look["color"]},
        },
        {
            "mark": {"type": "point", "filled": True, "size": 80, "opacity": 1},
            "encoding": {"x": across, "y": axis("share", up, **y), **look, "tooltip": tooltip},
        },
    ]
    return chart(title, subtitle, layers, data={"values": rows})
