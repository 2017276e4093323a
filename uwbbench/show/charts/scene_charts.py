"""One capture to look at: over time and range, and from above."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.results.cases import Case
from uwbbench.show.charts.chart import Spec, axis, chart, limits
from uwbbench.show.looks import SERIES
from uwbbench.show.text.numbers import rounded

DETECTOR = "{detector}"
"""Stands in a title for the detector that is shown, as the reader may choose another one."""

NEAR = {True: "within the gate", False: "elsewhere"}


def radargram(title: str, case: Case, image: tuple[str, float] | None, names: Mapping[str, str]) -> Spec:
    """A capture over time and range: samples where they are at hand, true ranges, detections of a chosen detector.

    Parameters
    ----------
    title : str
    case : Case
    image : (str, float) or None
        ``data:`` address of the samples as a picture, and the range in metres at its upper edge; None where the capture
        is not at hand.
    names : mapping of str to str
        Labels of detectors.
    """
    truth = [
        {"time": time, "range": range_m, "object": f"{place} {one.name}"}
        for place, one in enumerate(case.ranges)
        for time, range_m in zip(_nulls(case.time_s), _nulls(one.ahead_m), strict=True)
    ]
    detections = [
        {"detector": names[marks.detector], "time": time, "range": range_m, "near": NEAR[near]}
        for marks in case.marks
        for time, range_m, near in zip(_nulls(marks.time_s), _nulls(marks.range_m), marks.near.tolist(), strict=True)
        if range_m is not None
    ]
    end = float(case.time_s[-1]) if len(case.time_s) else 0.0
    far = image[1] if image else case.header.radar.window_m
    x = axis("time", "Time since the first frame (s)", scale={"domain": [0, end or 1.0], "nice": False})
    y = axis("range", "Range (m)", scale={"domain": [0, far], "nice": False})
    layers: list[Spec] = []
    if image is not None:
        stretched: Spec = {"width": {"expr": "width"}, "height": {"expr": "height"}, "x": 0, "y": 0, "aspect": False}
        mark = {"type": "image", "url": image[0], "align": "left", "baseline": "top", **stretched}
        layers.append({"data": {"values": [{}]}, "mark": mark})
    tooltip = [
        {"field": "detector", "title": "Detector"},
        {"field": "near", "title": "Detection"},
        {"field": "time", "format": ".2f", "title": "Time (s)"},
        {"field": "range", "format": ".2f", "title": "Range (m)"},
    ]
    layers.append(
        {
            "data": {"values": detections},
            "transform": [{"filter": "datum.detector === detector"}],
            "mark": {"type": "point", "size": 30, "opacity": 0.8, "clip": True, "filled": True},
            "encoding": {"x": x, "y": y, **_nearness(), "tooltip": tooltip},
        }
    )
    lines = [  # above the detections, thinner than they are wide: neither hides the other
        {
            "mark": {"type": "line", "clip": True, "style": look},
            "encoding": {"x": x, "y": y, "detail": {"field": "object"}},
        }
        for look in ("halo", "range")
    ]
    layers.append({"data": {"values": truth}, "layer": lines})
    samples = "grey: amplitude, 50 dB down to white" if image else "the samples are not at hand"
    return chart(title, f"Green line: true range; {samples}.", layers, params=[_chosen(names[case.leader])])


def top_view(title: str, case: Case, names: Mapping[str, str]) -> Spec:
    """A capture from above: outlines, the robot's path, and the places of the detections of a chosen detector.

    Parameters
    ----------
    title : str
    case : Case
    names : mapping of str to str
        Labels of detectors.
    """
    lines: list[Spec] = [
        {"x": x, "y": y, "order": index, "line": "robot path", "kind": "path"}
        for index, (x, y) in enumerate(case.path_m.tolist())
    ]
    for place, outline in enumerate(case.outlines):
        points_m = outline.points_m if outline.moves else np.concatenate([outline.points_m, outline.points_m[:1]])
        kind = "structure" if outline.structure else "truth"
        lines += [
            {"x": x, "y": y, "order": index, "line": f"{place} {outline.name}", "kind": kind}
            for index, (x, y) in enumerate(zip(_nulls(points_m[:, 0]), _nulls(points_m[:, 1]), strict=True))
        ]
    detections = [
        {"detector": names[marks.detector], "x": x, "y": y, "near": NEAR[near]}
        for marks in case.marks
        for x, y, near in zip(_nulls(marks.x_m), _nulls(marks.y_m), marks.near.tolist(), strict=True)
        if x is not None and y is not None
    ]
    corners = [(row["x"], row["y"]) for row in [*lines, *detections] if row["x"] is not None and row["y"] is not None]
    across, up = limits([point[0] for point in corners]), limits([point[1] for point in corners])
    tall, middle = max(up[1] - up[0], (across[1] - across[0]) / 2.2), (up[0] + up[1]) / 2
    x = axis("x", "x (m)", scale={"domain": across, "nice": False, "zero": False})
    y = axis("y", "y (m)", scale={"domain": [middle - tall / 2, middle + tall / 2], "nice": False, "zero": False})
    drawn = {
        kind: {
            "data": {"values": [line for line in lines if line["kind"] == kind]},
            "mark": {"type": "line", "style": kind, "clip": True},
            "encoding": {"x": x, "y": y, "order": {"field": "order"}, "detail": {"field": "line"}},
        }
        for kind in ("structure", "path", "truth")
    }
    points: Spec = {
        "data": {"values": detections},
        "transform": [{"filter": "datum.detector === detector"}],
        "mark": {"type": "point", "size": 22, "opacity": 0.5, "filled": True, "clip": True},
        "encoding": {"x": x, "y": y, **_nearness()},
    }
    layers = [drawn["structure"], drawn["path"], points, drawn["truth"]]
    return chart(title, "Green line: true outline; dashed: robot path.", layers, params=[_chosen(names[placing(case)])])


def titled(spec: Spec) -> Spec:
    """Chart whose title and subtitle name the detector that is shown at first."""
    head = {name: text.replace(DETECTOR, spec["params"][0]["value"]) for name, text in spec["title"].items()}
    return {**spec, "title": head}


def placing(case: Case) -> str:
    """Detector whose places are shown first: the leader, or the first one that gives any."""
    able = [marks.detector for marks in case.marks if marks.placed]
    return case.leader if case.leader in able or not able else able[0]


def _chosen(detector: str) -> Spec:
    """The detector whose detections are shown."""
    return {"name": "detector", "value": detector}


def _nearness() -> Spec:
    kinds = list(NEAR.values())
    legend = {"orient": "bottom", "title": None}
    scale = {"domain": kinds, "range": [SERIES[0], SERIES[1]]}
    return {
        "color": {"field": "near", "type": "nominal", "scale": scale, "legend": legend, "title": None},
        "shape": {
            "field": "near",
            "type": "nominal",
            "scale": {"domain": kinds, "range": ["circle", "triangle-up"]},
            "legend": legend,
            "title": None,
        },
    }


def _nulls(values: FloatArray) -> list[float | None]:
    """Values as JSON holds them; None where there is none, which breaks a line."""
    return [rounded(value) for value in values.tolist()]
