"""Times of single calls, with the slow ones drawn as large as they matter."""

from __future__ import annotations

from collections.abc import Mapping

from uwbbench.api.arrays import FloatArray
from uwbbench.results.curves import tail_curve
from uwbbench.show.charts.chart import LINES, Series, Spec, axis, chart, deadline


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
    rows = []
    for detector, times in times_us.items():
        slow_us, share = tail_curve(times)
        rows += [
            {
                "detector": names[detector],
                "time": time,
                "share": part,
                "text": f"{part:.2%} of {len(times)} calls take {time:.0f} us or longer",
            }
            for time, part in zip(slow_us.tolist(), share.tolist(), strict=True)
        ]
    series = Series(names, [row["detector"] for row in rows])
    fastest, slowest = min(row["time"] for row in rows), max(row["time"] for row in rows)
    reach = [fastest / 1.15, max(slowest, deadline_us) * 1.15]
    x = {"scale": {"type": "log", "domain": reach, "nice": False}, "axis": {"format": "~s"}}
    least = min(row["share"] for row in rows)
    y = axis(
        "share",
        "Share of calls as slow or slower (log)",
        scale={"type": "log", "domain": [least / 1.2, 1.0], "nice": False},
        axis={"format": "~%", "tickCount": 3},
    )
    tooltip = [{"field": "detector", "title": "Detector"}, {"field": "text", "title": "Calls"}]
    layers: list[Spec] = [
        deadline(deadline_us, f"frame period {deadline_us:.0f} us", x),
        {
            "mark": {"type": "line", "interpolate": "step-before", "strokeWidth": 1.8},
            "encoding": {
                "x": axis("time", "Time of a call, one frame (us, log)", **x),
                "y": y,
                **series.encoding(LINES, "strokeDash"),
                "tooltip": tooltip,
            },
        },
    ]
    subtitle = f"Times {timed}, this machine only. A call right of the dashed line misses the next frame."
    return chart(title, subtitle, layers, data={"values": rows})
