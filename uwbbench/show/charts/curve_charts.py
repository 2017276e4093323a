"""Detectors without their thresholds: precision against recall, and recall against false alarms."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from uwbbench.measure.accuracy.intervals import INNER_UNITS, Interval
from uwbbench.results.ranked_curves import RankedCurve
from uwbbench.show.charts.chart import PLAIN_NUMBERS, Series, Spec, axis, chart
from uwbbench.show.text.numbers import interval, rounded, significant

SHARE: Spec = {"scale": {"domain": [0, 1], "nice": False}, "axis": {"format": PLAIN_NUMBERS, "tickCount": 6}}

SUBTITLE = (
    "A line: every threshold of the score. A mark: the detector as it is set; bars: intervals, from 12 scenes on."
)

PLACES: list[Spec] = [
    {"field": "x", "format": ".4~g", "title": "Across"},
    {"field": "y", "format": ".4~g", "title": "Up"},
]


def precision_against_recall(title: str, curves: Mapping[str, RankedCurve], names: Mapping[str, str]) -> Spec | None:
    """Precision against recall, a curve for each detector and a point where it is set; None where none is defined.

    Parameters
    ----------
    title : str
    curves : mapping of str to RankedCurve
        By detector.
    names : mapping of str to str
        Labels of detectors.
    """
    drawn = _drawn(curves)
    if not drawn:
        return None
    rows: list[Spec] = [
        {"detector": names[name], "order": place, "x": recall, "y": precision, "text": text}
        for name, curve in drawn.items()
        for place, (recall, precision, text) in enumerate(_steps(curve, curve.recall, curve.precision))
    ]
    points = [_point(names[name], curve, "recall", "precision") for name, curve in drawn.items()]
    x, y = axis("x", "Recall", **SHARE), axis("y", "Precision", **SHARE)
    return chart(
        title, SUBTITLE, _layers(Series(names, [row["detector"] for row in rows]), x, y, points), data={"values": rows}
    )


def recall_against_false_alarms(title: str, curves: Mapping[str, RankedCurve], names: Mapping[str, str]) -> Spec | None:
    """Recall against false alarms a minute, on a logarithmic axis whose left end is none at all.

    Parameters
    ----------
    title : str
    curves : mapping of str to RankedCurve
        By detector.
    names : mapping of str to str
        Labels of detectors.
    """
    drawn = _drawn(curves)
    rates = [curve.false_alarms_per_minute.value for curve in drawn.values()]
    rates += [np.atleast_1d(curve.setting["false_alarms_per_minute"].value) for curve in drawn.values()]
    some = np.concatenate([*rates, np.empty(0)])
    some = some[some > 0]
    if not len(some):
        return None
    least, most = float(some.min()) / 2, float(some.max()) * 1.25
    rows: list[Spec] = [
        {"detector": names[name], "order": place, "x": max(rate, least), "y": recall, "text": text}
        for name, curve in drawn.items()
        for place, (rate, recall, text) in enumerate(_steps(curve, curve.false_alarms_per_minute, curve.recall))
    ]
    points = [_point(names[name], curve, "false_alarms_per_minute", "recall", least) for name, curve in drawn.items()]
    scale = {"type": "log", "domain": [least, most], "nice": False}
    x = axis(
        "x", "False alarms a minute (log; left end: none)", scale=scale, axis={"format": PLAIN_NUMBERS, "tickCount": 6}
    )
    y = axis("y", "Recall", **SHARE)
    return chart(
        title, SUBTITLE, _layers(Series(names, [row["detector"] for row in rows]), x, y, points), data={"values": rows}
    )


def _drawn(curves: Mapping[str, RankedCurve]) -> dict[str, RankedCurve]:
    """Curves on captures whose truth is whole, of scored detections, where there was anything to find."""
    return {
        name: curve
        for name, curve in curves.items()
        if curve.exhaustive and len(curve.score) and not np.isnan(curve.recall.value).all()
    }


def _steps(curve: RankedCurve, across: Interval, up: Interval) -> list[tuple[float, float, str]]:
    """Points of a curve that have both values, with the threshold in words."""
    said = []
    for score, x, y in zip(*(values.tolist() for values in (curve.score, across.value, up.value)), strict=True):
        if not (math.isnan(x) or math.isnan(y)):
            threshold = f"{score:.4g}" if math.isfinite(score) else "none"
            said.append((rounded(x) or 0.0, rounded(y) or 0.0, threshold))
    return said


def _point(name: str, curve: RankedCurve, across: str, up: str, least: float = 0.0) -> Spec:
    """A detector as it is set; its bar is as short as its value where too few scenes give an inner interval."""
    point: Spec = {"detector": name}
    for key, quantity, floor in (("x", across, least), ("y", up, 0.0)):
        one = curve.setting[quantity]
        value, low, high = (float(end) for end in (one.value, one.low, one.high))
        value = floor if math.isnan(value) else max(value, floor)
        bar = curve.scenes >= INNER_UNITS and math.isfinite(low) and math.isfinite(high)
        ends = (max(low, floor), high) if bar else (value, value)
        point |= {key: rounded(value), f"{key}low": rounded(ends[0]), f"{key}high": rounded(ends[1])}
    recall, precision, alarms = (curve.setting[key] for key in ("recall", "precision", "false_alarms_per_minute"))
    point["text"] = ", ".join(
        f"{what} {interval(float(one.value), float(one.low), float(one.high), 3)}"
        for what, one in (("recall", recall), ("precision", precision))
    )
    point["text"] += f", {significant(float(alarms.value), 3)} false alarms a minute"
    return point


def _layers(series: Series, x: Spec, y: Spec, points: list[Spec]) -> list[Spec]:
    look = series.encoding()
    names = {"field": "detector", "title": "Detector"}
    bars = [
        {
            "data": {"values": points},
            "mark": {"type": "rule", "strokeWidth": 1.4, "clip": True, "opacity": 0.55},
            "encoding": {
                "x": {**x, "field": "xlow"} if level else x,
                "y": y if level else {**y, "field": "ylow"},
                **({"x2": {"field": "xhigh"}} if level else {"y2": {"field": "yhigh"}}),
                "color": look["color"],
            },
        }
        for level in (True, False)
    ]
    return [
        {
            "mark": {"type": "line", "interpolate": "step-before", "strokeWidth": 1.8, "clip": True},
            "encoding": {
                "x": x,
                "y": y,
                "order": {"field": "order"},
                "color": look["color"],
                "tooltip": [names, {"field": "text", "title": "Threshold"}, *PLACES],
            },
        },
        *bars,
        {
            "data": {"values": points},
            "mark": {"type": "point", "filled": True, "size": 95, "opacity": 1, "clip": False},
            "encoding": {"x": x, "y": y, **look, "tooltip": [names, {"field": "text", "title": "As set"}]},
        },
    ]
