"""Times of single calls, with the slow ones drawn as large as they matter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from uwbbench.api.arrays import FloatArray
from uwbbench.results.curves import tail_curve
from uwbbench.show.charts.chart import Series, Spec, axis, chart, deadline
from uwbbench.show.text.numbers import rounded, significant

MARKED = (0.5, 0.1, 0.01)
"""Shares of calls at which a curve has its detector's mark: P50, P90 and P99."""

TIME = (
    "datum.label === '' ? '' : "
    "datum.value < 1000 ? format(datum.value, '~r') + ' us' : format(datum.value / 1000, '~r') + ' ms'"
)
"""Label of a time in microseconds."""


def latency(
    title: str, times_us: Mapping[str, FloatArray], deadline_us: float, names: Mapping[str, str], timed: str
) -> Spec:
    """Share of calls that take as long as a time or longer, one curve for each detector.

    Parameters
    ----------
    title : str
    times_us : mapping of str to (calls,) array
        Times of single calls by detector, in microseconds; at least one.
    deadline_us : float
        Frame period of the radar.
    names : mapping of str to str
        Labels of detectors.
    timed : str
        What the times are of, in words.
    """
    rows: list[dict[str, Any]] = []
    for detector, times in times_us.items():
        slow_us, share = tail_curve(times)
        rows += [
            {
                "detector": names[detector],
                "time": rounded(time),
                "share": rounded(part),
                "text": f"{part:.2%} of {len(times)} calls take {significant(time, 3)} us or longer",
            }
            for time, part in zip(slow_us.tolist(), share.tolist(), strict=True)
        ]
    marks = [
        min((row for row in rows if row["detector"] == names[detector]), key=lambda row: abs(row["share"] / share - 1))
        for detector, times in times_us.items()
        for share in MARKED
        if share * len(times) >= 1
    ]
    series = Series(names, [row["detector"] for row in rows])
    look = series.encoding()
    fastest, slowest = min(row["time"] for row in rows), max(row["time"] for row in rows)
    reach = [fastest / 1.15, max(slowest, deadline_us) * 1.15]
    x = {
        "scale": {"type": "log", "domain": reach, "nice": False},
        "axis": {"labelExpr": TIME, "labelOverlap": "greedy", "labelSeparation": 8},
    }
    least = min(row["share"] for row in rows)
    y = axis(
        "share",
        "Share of calls as slow or slower (log)",
        scale={"type": "log", "domain": [least / 1.2, 1.0], "nice": False},
        axis={"format": "~%", "tickCount": 3},
    )
    tooltip = [{"field": "detector", "title": "Detector"}, {"field": "text", "title": "Calls"}]
    layers: list[Spec] = [
        deadline(deadline_us, f"frame period {significant(deadline_us / 1000, 3)} ms", x),
        {
            "mark": {"type": "line", "interpolate": "step-before", "strokeWidth": 1.8},
            "encoding": {
                "x": axis("time", "Time of a call, one frame (log)", **x),
                "y": y,
                "color": look["color"],
                "tooltip": tooltip,
            },
        },
        {
            "data": {"values": marks},
            "mark": {"type": "point", "filled": True, "size": 70, "opacity": 1},
            "encoding": {"x": axis("time", "", **x), "y": y, **look, "tooltip": tooltip},
        },
    ]
    subtitle = (
        f"Times {timed}, this machine only. A call right of the dashed line misses the next frame. "
        "Marks: P50, P90 and P99."
    )
    return chart(title, subtitle, layers, data={"values": rows})
