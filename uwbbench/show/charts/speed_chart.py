"""Speed against error, with intervals on both axes, the front, and the radar's frame period."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np

from uwbbench.results.pareto import Point
from uwbbench.results.times import WORDS
from uwbbench.show.charts.chart import HEIGHT, PLAIN_NUMBERS, Series, Spec, axis, chart, deadline, limits
from uwbbench.show.text.numbers import between, number, probability
from uwbbench.show.text.quantity import Quantity

PLOT_PX = (520.0, HEIGHT - 110.0)
"""About the size of the plot in print, for which labels are placed."""

TIMES = f"datum.label === '' ? '' : format(datum.value, '{PLAIN_NUMBERS}') + 'x'"
"""Label of a ratio."""

LABELLED_PX = 440
"""Width of a plot from which its points have labels; below, they would cover each other, and the legend serves."""

SIDES = ((12, -11), (12, 13), (-12, -11), (-12, 13))
"""Places of a label beside its point, in pixels right and down, the best first."""


def speed_against_error(title: str, points: Sequence[Point], names: Mapping[str, str], quantity: Quantity) -> Spec:
    """Chart of all detectors that were both timed and scored.

    Parameters
    ----------
    title : str
    points : sequence of Point
        At least one.
    names : mapping of str to str
        Labels of detectors.
    quantity : Quantity
        The metric.
    """
    rows = [_row(point, names, quantity) for point in points]
    frame_period = float(np.median([point.speed.deadline for point in points]))
    ends = [row[side] for row in rows for side in ("left", "right")]
    reach = [min(*ends, frame_period) / 1.25, max(*ends, frame_period) * 1.25]
    span = limits([row[side] for row in rows for side in ("low", "high")], share=0.12)
    lowest, highest = min(row["low"] for row in rows), max(row["high"] for row in rows)
    is_share = quantity.better == "higher" and highest <= 1
    span = [max(span[0], 0.0) if lowest >= 0 else span[0], min(span[1], 1.01) if is_share else span[1]]
    _place_labels(rows, reach, span, frame_period)

    x = {
        "scale": {"type": "log", "domain": reach, "nice": False},
        "axis": {"labelExpr": TIMES, "labelOverlap": "greedy", "labelSeparation": 8},
    }
    y = {"scale": {"domain": span, "zero": False, "nice": False}}
    reference, timed = points[0].speed.reference, WORDS[points[0].speed.timed]
    across = axis("ratio", f"Time a frame {timed}, in times of {names.get(reference, reference)} (log)", **x)
    up = axis("value", quantity.axis, **y)
    series = Series(names, [row["detector"] for row in rows])
    marker = series.encoding()
    colour = {"color": marker["color"]}
    tooltip = [
        {"field": "detector", "title": "Detector"},
        {"field": "error", "title": quantity.title},
        {"field": "time", "title": "Time ratio"},
        {"field": "p50", "title": "Median time a frame"},
        {"field": "chance", "title": "On the front, probability"},
    ]
    point = {"type": "point", "size": 95, "strokeWidth": 2, "opacity": 1}
    layers: list[Spec] = [
        deadline(frame_period, "frame period of the radar", x),
        {
            "data": {"values": sorted((row for row in rows if row["front"]), key=lambda row: row["ratio"])},
            "mark": {"type": "line", "interpolate": "step-after", "style": "front"},
            "encoding": {"x": across, "y": up},
        },
        {
            "mark": {"type": "rule", "strokeWidth": 1.5},
            "encoding": {"x": axis("left", "", **x), "x2": {"field": "right"}, "y": up, **colour},
        },
        {
            "mark": {"type": "rule", "strokeWidth": 1.5},
            "encoding": {"x": across, "y": axis("low", "", **y), "y2": {"field": "high"}, **colour},
        },
        {"mark": {**point, "filled": False}, "encoding": {"x": across, "y": up, **marker, "tooltip": tooltip}},
        {
            "transform": [{"filter": "datum.front"}],
            "mark": {**point, "filled": True},
            "encoding": {"x": across, "y": up, **marker, "tooltip": tooltip},
        },
        {
            "mark": {
                "type": "text",
                "style": "label",
                "dx": {"expr": "datum.dx"},
                "dy": {"expr": "datum.dy"},
                "align": {"expr": "datum.dx < 0 ? 'right' : 'left'"},
                "baseline": "middle",
                "opacity": {"expr": f"width < {LABELLED_PX} ? 0 : 1"},
            },
            "encoding": {"x": across, "y": up, "text": {"field": "label"}},
        },
    ]
    better = {"higher": "up", "lower": "down", "zero": "towards 0"}[quantity.better]
    subtitle = (
        f"Better: left and {better}. Filled, with its probability P: on the front, where no other is both as "
        "fast and as good."
    )
    if any(point.bound for point in points):
        subtitle += " Bounds are no detectors, and put nobody off it."
    return chart(title, subtitle, layers, data={"values": rows})


def _row(point: Point, names: Mapping[str, str], quantity: Quantity) -> Spec:
    value, low, high = (quantity.scaled(v) for v in (point.error.value, point.error.low, point.error.high))
    speed = point.speed
    timed = not math.isnan(speed.low)
    ends = between(speed.low, speed.high, 3) or "(no interval)"
    plural = "capture" if speed.captures == 1 else "captures"
    return {
        "detector": names[point.detector],
        "ratio": speed.ratio,
        "left": speed.low if timed else speed.ratio,
        "right": speed.high if timed else speed.ratio,
        "value": value,
        "low": value if math.isnan(low) else low,
        "high": value if math.isnan(high) else high,
        "front": point.on_front,
        "label": f"{names[point.detector]}, P {probability(point.probability)}"
        if point.on_front
        else names[point.detector],
        "error": quantity.in_full(point.error),
        "time": f"{number(speed.ratio, 3)} {ends}, {speed.captures} timed {plural}",
        "p50": f"{number(speed.p50_us, 0)} us on this machine",
        "chance": probability(point.probability),
    }


def _place_labels(rows: list[Spec], reach: Sequence[float], span: Sequence[float], frame_period: float) -> None:
    """Give each label the first side on which it covers no point, bar, line or label; one that has none is left out.

    Parameters
    ----------
    rows : list of dict
        Points; ``dx`` and ``dy`` are added, and a label that has no room is emptied.
    reach, span : sequence of float
        Ends of the axes.
    frame_period : float
        Where the dashed line is.
    """
    width, height = PLOT_PX

    def across(ratio: float) -> float:
        return width * math.log(ratio / reach[0]) / math.log(reach[1] / reach[0])

    def up(value: float) -> float:
        return height * (value - span[0]) / (span[1] - span[0])

    taken: list[tuple[float, float, float, float]] = []
    if math.isfinite(frame_period):
        taken.append((across(frame_period) - 2, across(frame_period) + 2, 0.0, height))
    for row in rows:
        x, y = across(row["ratio"]), up(row["value"])
        taken.append((x - 8, x + 8, y - 8, y + 8))
        taken.append((x - 1, x + 1, up(row["low"]), up(row["high"])))
        taken.append((across(row["left"]), across(row["right"]), y - 1, y + 1))
    front = sorted((across(row["ratio"]), up(row["value"])) for row in rows if row["front"])
    for (x, y), (next_x, next_y) in itertools.pairwise(front):
        taken += [(x, next_x, y - 1, y + 1), (next_x - 1, next_x + 1, min(y, next_y), max(y, next_y))]
    for row in rows:
        x, y, wide = across(row["ratio"]), up(row["value"]), 6.6 * len(row["label"])
        row |= {"dx": 0, "dy": 0}
        for right, down in SIDES:
            left = x + right if right > 0 else x + right - wide
            box = (left, left + wide, y - down - 7, y - down + 7)
            inside = box[0] >= 0 and box[1] <= width and box[2] >= 0 and box[3] <= height
            if inside and not any(box[0] < b[1] and b[0] < box[1] and box[2] < b[3] and b[2] < box[3] for b in taken):
                row |= {"dx": right, "dy": down}
                taken.append(box)
                break
        else:
            row["label"] = ""
