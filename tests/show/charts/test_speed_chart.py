"""Labels of the chart of speed against error cover nothing, and what has no room has none."""

import math

import pytest

from uwbbench.measure.accuracy.metrics.detection import F1
from uwbbench.measure.accuracy.stats import Estimate
from uwbbench.results.pareto import Point, Speed
from uwbbench.show.charts.chart import HEIGHT
from uwbbench.show.charts.speed_chart import speed_against_error
from uwbbench.show.text.quantity import Quantity

WIDE, HIGH = 520.0, HEIGHT - 110.0


def point(name: str, ratio: float, f1: float, deadline: float = 40.0) -> Point:
    speed = Speed("reference", ratio, ratio * 0.98, ratio * 1.02, 2, deadline, 10.0 * ratio)
    return Point(name, speed, Estimate(f1, f1 - 0.01, f1 + 0.01, 100, 9), on_front=False, probability=0.5)


def boxes(points: list[Point]) -> tuple[list[tuple[float, float, float, float]], float]:
    """Boxes of the labels in pixels of the plot, and where the frame period is."""
    names = {one.detector: one.detector for one in points}
    spec = speed_against_error("title", points, names, Quantity.of("f1", F1))
    x, y = (spec["layer"][4]["encoding"][axis]["scale"]["domain"] for axis in "xy")

    def across(ratio: float) -> float:
        return WIDE * math.log(ratio / x[0]) / math.log(x[1] / x[0])

    found = []
    for row in spec["data"]["values"]:
        if row["label"]:
            middle = HIGH * (row["value"] - y[0]) / (y[1] - y[0]) - row["dy"]
            start = across(row["ratio"]) + row["dx"]
            ends = (start, start + 6 * len(row["label"])) if row["dx"] > 0 else (start - 6 * len(row["label"]), start)
            found.append((*ends, middle - 6, middle + 6))
    return found, across(points[0].speed.deadline)


@pytest.mark.parametrize("apart", [1.0, 1.02, 1.5])
def test_no_label_covers_another_or_the_frame_period(apart: float) -> None:
    found, period = boxes([point(f"detector-{n}", 3.0 * apart**n, 0.9 + 0.001 * n) for n in range(10)])
    for place, a in enumerate(found):
        assert not a[0] < period < a[1]
        assert a[0] >= 0
        assert a[1] <= WIDE
        assert all(a[1] <= b[0] or b[1] <= a[0] or a[3] <= b[2] or b[3] <= a[2] for b in found[:place])


def test_labels_with_room_are_all_drawn() -> None:
    found, _ = boxes([point("left", 1.0, 0.5), point("right", 8.0, 0.9)])
    assert len(found) == 2
