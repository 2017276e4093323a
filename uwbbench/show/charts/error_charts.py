"""Errors: by range, and as a distribution."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from uwbbench.measure.accuracy.intervals import INNER_UNITS
from uwbbench.results.curves import ErrorCurve, error_axis
from uwbbench.results.slices import Slice
from uwbbench.show.charts.chart import PLAIN_NUMBERS, Series, Spec, axis, chart
from uwbbench.show.text.numbers import number, rounded
from uwbbench.show.text.quantity import Quantity

SHARES = (0, 0.25, 0.5, 0.75, 0.9, 0.95, 1)


def by_range(title: str, slices: Sequence[Slice], spans: Sequence[str], names: Mapping[str, str], by: Quantity) -> Spec:
    """A metric against range, a point with its interval for each detector and bin.

    Parameters
    ----------
    title : str
    slices : sequence of Slice
        Cuts of one board by range; those without a value are left out.
    spans : sequence of str
        Names of the bins, the nearest first.
    names : mapping of str to str
        Labels of detectors.
    by : Quantity
        The metric.
    """
    rows: list[Spec] = []
    for part in slices:
        estimate = part.estimates[by.name]
        if not math.isnan(estimate.value):
            value, low, high = (by.scaled(v) for v in (estimate.value, estimate.low, estimate.high))
            if estimate.groups < INNER_UNITS:  # the outer interval of each bin would fill the whole chart
                low = high = math.nan
            rows.append(
                {
                    "detector": names[part.detector],
                    "span": part.span,
                    "value": rounded(value),
                    "low": rounded(value if math.isnan(low) else low),
                    "high": rounded(value if math.isnan(high) else high),
                    "text": by.in_full(estimate),
                }
            )
    series = Series(names, [row["detector"] for row in rows])
    look = series.encoding()
    place = {
        "x": {
            "field": "span",
            "type": "ordinal",
            "title": "True range of the nearest visible obstacle",
            "scale": {"domain": list(spans), "paddingInner": 0.3},
            "axis": {"labelAngle": 0, "labelOverlap": "greedy", "grid": False},
        },
        "xOffset": {"field": "detector", "type": "nominal", "scale": {"domain": series.detectors}},
    }
    y = {"scale": {"zero": by.better != "higher"}}
    up = axis("value", by.axis, **y)
    tooltip = [
        {"field": "detector", "title": "Detector"},
        {"field": "span", "title": "Range"},
        {"field": "text", "title": by.title},
    ]
    layers: list[Spec] = [
        {
            "mark": {"type": "line", "strokeWidth": 1.2, "opacity": 0.5},
            "encoding": {**place, "y": up, "color": look["color"]},
        },
        {
            "mark": {"type": "rule", "strokeWidth": 1.4},
            "encoding": {**place, "y": axis("low", by.axis, **y), "y2": {"field": "high"}, "color": look["color"]},
        },
        {
            "mark": {"type": "point", "filled": True, "size": 70, "opacity": 1},
            "encoding": {**place, "y": up, **look, "tooltip": tooltip},
        },
    ]
    subtitle = "Bars: 95 % intervals; with too few scenes, a bin has none."
    return chart(title, subtitle, layers, data={"values": rows})


def error_cdf(title: str, curves: Mapping[str, ErrorCurve], names: Mapping[str, str]) -> Spec:
    """Distribution of the absolute errors, one curve for each detector, with its percentiles.

    Parameters
    ----------
    title : str
    curves : mapping of str to ErrorCurve
        By detector; at least one.
    names : mapping of str to str
        Labels of detectors.
    """
    *ends_m, logarithmic = error_axis(list(curves.values()))
    least, far = (100 * end_m for end_m in ends_m)
    rows: list[Spec] = []
    points: list[Spec] = []
    for detector, curve in curves.items():
        known = [("median", curve.p50_m, 0.5), ("P90", curve.p90_m, 0.9), ("P95", curve.p95_m, 0.95)]
        percentiles = ", ".join(f"{what} {number(value, 1, 100)}" for what, value, _ in known)
        label = names[detector]
        rows += [
            {"detector": label, "error": rounded(max(100 * error_m, least)), "share": rounded(share)}
            for error_m, share in zip(curve.error_m.tolist(), curve.share.tolist(), strict=True)
        ]
        points += [
            {
                "detector": label,
                "error": 100 * value,
                "share": at,
                "text": f"{percentiles} cm, n = {curve.n} detections",
            }
            for _, value, at in known
            if not math.isnan(value)
        ]
    series = Series(names, [row["detector"] for row in rows])
    look = series.encoding()
    scale = {"type": "log" if logarithmic else "linear", "domain": [least, far], "nice": False}
    x = axis("error", "Absolute error (cm)", scale=scale, axis={"format": PLAIN_NUMBERS, "tickCount": 8})
    y = axis(
        "share",
        "Share of detections",
        scale={"domain": [0, 1]},
        axis={"values": list(SHARES), "format": ".2~f", "labelOverlap": False},
    )
    tooltip = [{"field": "detector", "title": "Detector"}, {"field": "text", "title": "Absolute error"}]
    layers: list[Spec] = [
        {
            "mark": {"type": "line", "strokeWidth": 1.8, "clip": True},
            "encoding": {"x": x, "y": y, "color": look["color"]},
        },
        {
            "data": {"values": points},
            "mark": {"type": "point", "filled": True, "size": 70, "clip": True, "opacity": 1},
            "encoding": {"x": x, "y": y, **look, "tooltip": tooltip},
        },
    ]
    return chart(title, "All retained detections. Points: median, P90 and P95.", layers, data={"values": rows})
