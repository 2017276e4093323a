"""What each cause of errors costs each detector."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence

from uwbbench.results.error_causes import ErrorCauses
from uwbbench.show.charts.chart import PLAIN_NUMBERS, Series, Spec, axis, chart
from uwbbench.show.text.numbers import number, rounded

ROW_PX = 34
AROUND_PX, LEGEND_ROW_PX = 130, 20
"""Title and axis, and a row of the legend: a chart has its height in all."""

LEGEND_COLUMNS = 3
"""The plot is narrow beside the names of the causes, and so is its legend."""


def causes_of_errors(title: str, causes: Sequence[ErrorCauses], names: Mapping[str, str]) -> Spec | None:
    """What F1 would gain without each cause, a mark for each detector; None where nothing is missed or false.

    Parameters
    ----------
    title : str
    causes : sequence of ErrorCauses
        Of one board.
    names : mapping of str to str
        Labels of detectors.
    """
    rows: list[Spec] = [
        {
            "detector": names[one.detector],
            "cause": f"{cost.error}: {cost.cause}",
            "gain": rounded(cost.gain),
            "text": f"{cost.count} of {one.fn if cost.error == 'missed' else one.fp} {cost.error}; "
            f"F1 {number(one.f1, 3)}, without it {number(cost.f1, 3)}",
        }
        for one in causes
        for cost in one.costs
        if not math.isnan(cost.gain)
    ]
    if not rows:
        return None
    dearest: dict[str, float] = defaultdict(float)
    for row in rows:
        dearest[row["cause"]] = max(dearest[row["cause"]], row["gain"])
    order = sorted(dearest, key=lambda cause: (-dearest[cause], cause))
    series = Series(names, [row["detector"] for row in rows])
    look = series.encoding()
    for channel in look.values():
        channel["legend"] = {**channel["legend"], "columns": LEGEND_COLUMNS}
    beside = {"field": "detector", "type": "nominal", "scale": {"domain": series.detectors}}
    x = axis("gain", "Gain of F1 if it were gone", scale={"zero": True}, axis={"format": PLAIN_NUMBERS, "tickCount": 6})
    place = {"field": "cause", "type": "nominal", "title": None, "sort": order}
    y = {**place, "axis": {"labelLimit": 260, "grid": True}}
    tooltip = [
        {"field": "detector", "title": "Detector"},
        {"field": "cause", "title": "Error"},
        {"field": "text", "title": "Count"},
    ]
    points = {
        "mark": {"type": "point", "filled": True, "size": 85, "opacity": 0.85},
        "encoding": {"x": x, "y": y, "yOffset": beside, **look, "tooltip": tooltip},
    }
    subtitle = "Each cause taken away alone: misses found, false detections gone. Gains do not add up."
    return chart(title, subtitle, [points], data={"values": rows}, height=_height(len(order), len(series.detectors)))


def _height(causes: int, detectors: int) -> int:
    return AROUND_PX + LEGEND_ROW_PX * math.ceil(detectors / LEGEND_COLUMNS) + ROW_PX * causes
