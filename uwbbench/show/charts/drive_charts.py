"""One run to look at: the map that a mapper has made of it, and how far its poses are off, up to a chosen time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.mapper import LandmarkKind
from uwbbench.results.drives import MappedDrive, cells, ellipses, thinned
from uwbbench.results.ground_truth import outlines
from uwbbench.show.charts.chart import Series, Spec, axis, chart
from uwbbench.show.charts.scene_charts import DETECTOR
from uwbbench.show.text.numbers import rounded

POSES, ECHOES, CELLS, POINTS = 200, 300, 600, 300
"""Most of each that is drawn of a detector: a page holds the maps of many."""

ON_THE_WAY, LANDMARKS, CORNERS = 12, 40, 12
"""Most ellipses along the path and of landmarks, and the corners of each."""

MARGIN_M = 0.3

SHOWN = "datum.detector === detector"
PAST = "datum.time <= until"
"""Filters by the chosen detector and the chosen time."""

_MARKS: dict[LandmarkKind, tuple[str, str]] = {"point": ("landmark", "circle"), "anchor": ("anchor", "triangle-up")}


def drive_map(title: str, drives: Mapping[str, MappedDrive], names: Mapping[str, str], shown: str) -> Spec:
    """A run from above: outlines, true path, and of a chosen detector its map, and its path up to a chosen time.

    Parameters
    ----------
    title : str
        With :data:`~uwbbench.show.charts.scene_charts.DETECTOR` where its name belongs.
    drives : mapping of str to MappedDrive
        By detector; of one run.
    names : mapping of str to str
        Labels of detectors.
    shown : str
        Detector that is shown first.
    """
    place = _place(*_box(drives.values()))
    colour = {"color": Series(names, [names[name] for name in drives]).encoding(legend=False)["color"]}
    line = {**place, "order": {"field": "order"}, "detail": {"field": "line"}}

    def rows(of: Any) -> list[dict[str, Any]]:
        return [{"detector": names[name], **row} for name, drive in drives.items() for row in of(drive)]

    def layer(values: list[dict[str, Any]], mark: Spec, encoding: Spec, *filters: str) -> Spec:
        drawn: Spec = {"data": {"values": values}, "mark": {**mark, "clip": True}, "encoding": encoding}
        return {**drawn, "transform": [{"filter": one} for one in filters]} if filters else drawn

    there = list(_there(next(iter(drives.values()))))
    truth = {
        kind: layer([row for row in there if row["kind"] == kind], {"type": "line", "style": kind}, line)
        for kind in ("structure", "path", "truth")
    }
    box = {**place, "x2": {"field": "x2"}, "y2": {"field": "y2"}}
    shape = {"field": "kind", "type": "nominal", "legend": None, "title": None}
    shapes = {
        "shape": {
            **shape,
            "scale": {"domain": [n for n, _ in _MARKS.values()], "range": [s for _, s in _MARKS.values()]},
        }
    }
    tooltip = [{"field": name, "title": name.capitalize()} for name in ("kind", "identity", "support")]
    layers = [
        layer(rows(_cells), {"type": "rect", "style": "cell"}, box, SHOWN),
        truth["structure"],
        truth["path"],
        layer(
            rows(_echoes),
            {"type": "point", "filled": True, "size": 8, "opacity": 0.35, "style": "echo"},
            place,
            SHOWN,
            PAST,
        ),
        layer(rows(_points), {"type": "point", "filled": True, "size": 10, "opacity": 0.8}, {**place, **colour}, SHOWN),
        layer(rows(_segments), {"type": "line", "strokeWidth": 3, "opacity": 0.7}, {**line, **colour}, SHOWN),
        layer(rows(_path), {"type": "line", "strokeWidth": 1.8}, {**line, **colour}, SHOWN, PAST),
        layer(rows(_ellipses_on_the_way), {"type": "line", "strokeWidth": 1}, {**line, **colour}, SHOWN, PAST),
        layer(
            rows(_path),
            {"type": "point", "filled": True, "size": 70, "opacity": 1},
            {**place, **colour},
            SHOWN,
            PAST,
            "until < datum.next",
        ),
        truth["truth"],
        layer(rows(_ellipses_of_landmarks), {"type": "line", "strokeWidth": 1}, {**line, **colour}, SHOWN),
        layer(
            rows(_landmarks),
            {"type": "point", "size": 50, "strokeWidth": 2},
            {**place, **colour, **shapes, "tooltip": tooltip},
            SHOWN,
        ),
    ]
    subtitle = "Green: true outlines; dashed: true path; line: estimate, 95 % ellipses; dots: echoes; grey: cells."
    return chart(title, subtitle, layers, params=_params(drives, names, shown))


def drive_errors(title: str, drives: Mapping[str, MappedDrive], names: Mapping[str, str], shown: str) -> Spec:
    """Distance of each detector's poses from the true ones over time, with the band of a chosen detector.

    Parameters
    ----------
    title, drives, names, shown
        As of :func:`drive_map`.
    """
    lines, bands, top_cm = [], [], 1.0
    for name, drive in drives.items():
        kept = thinned(len(drive.poses), POSES)
        error_cm, time_s = 100 * drive.error_m[kept], drive.time_s[kept]
        top_cm = max(top_cm, float(error_cm.max()))
        for time, error in zip(_plain(time_s), _plain(error_cm), strict=True):
            lines.append({"detector": names[name], "time": time, "error": error})
        if drive.band_m is not None:
            for time, band in zip(_plain(time_s), _plain(100 * drive.band_m[kept]), strict=True):
                bands.append({"detector": names[name], "time": time, "band": band})
    x = axis("time", "Time since the first step (s)", scale={"domain": [0, _end(drives)], "nice": False})
    # Of the errors alone: the band of a filter that has lost itself would flatten them all.
    scale = {"domain": [0, rounded(1.1 * top_cm)], "nice": False}
    colour = Series(names, [names[name] for name in drives]).encoding()["color"]
    tooltip = [
        {"field": "detector", "title": "Detector"},
        {"field": "time", "format": ".1f", "title": "Time (s)"},
        {"field": "error", "format": ".1f", "title": "Error (cm)"},
    ]
    layers: list[Spec] = [
        {
            "data": {"values": bands},
            "transform": [{"filter": SHOWN}],
            "mark": {"type": "area", "opacity": 0.2, "clip": True},
            "encoding": {"x": x, "y": axis("band", "Error of the position (cm)", scale=scale), "color": colour},
        },
        {
            "data": {"values": lines},
            "mark": {"type": "line", "strokeWidth": 1.8, "clip": True},
            "encoding": {
                "x": x,
                "y": axis("error", "Error of the position (cm)", scale=scale),
                "color": colour,
                "tooltip": tooltip,
            },
        },
        {
            "data": {"values": [{}]},
            "transform": [{"calculate": "until", "as": "time"}],
            "mark": {"type": "rule", "style": "deadline"},
            "encoding": {"x": x},
        },
    ]
    subtitle = f"Shaded: 95 % as {DETECTOR} states it, if it does. Upright: the chosen time."
    return chart(title, subtitle, layers, params=_params(drives, names, shown))


def _params(drives: Mapping[str, MappedDrive], names: Mapping[str, str], shown: str) -> list[Spec]:
    return [{"name": "detector", "value": names[shown]}, {"name": "until", "value": _end(drives)}]


def _end(drives: Mapping[str, MappedDrive]) -> float:
    """Time of the last pose of all."""
    return float(rounded(max(float(drive.time_s[-1]) for drive in drives.values())) or 1.0)


def _place(low: FloatArray, high: FloatArray) -> Spec:
    """Axes in which a metre is as long across as up, whatever the shape of the chart, that hold a box."""
    span_x, span_y = (high - low).tolist()
    half = f"max({span_x:.4g} / width, {span_y:.4g} / height) / 2"
    made = {}
    for name, size, middle in zip("xy", ("width", "height"), ((low + high) / 2).tolist(), strict=True):
        ends = [{"expr": f"{middle:.4g} {sign} {size} * {half}"} for sign in "-+"]
        made[name] = axis(name, f"{name} (m)", scale={"domain": ends, "nice": False, "zero": False})
    return made


def _box(drives: Iterable[MappedDrive]) -> tuple[FloatArray, FloatArray]:
    boxes = [drive.box_m for drive in drives]
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    return low - MARGIN_M, high + MARGIN_M


def _plain(values: Any) -> list[float | None]:
    return [rounded(value) for value in np.asarray(values, float).tolist()]


def _corners(points_m: FloatArray, **facts: Any) -> Iterator[dict[str, Any]]:
    """Points (n, 2) as rows, in order."""
    for order, (x, y) in enumerate(zip(_plain(points_m[:, 0]), _plain(points_m[:, 1]), strict=True)):
        yield {"x": x, "y": y, "order": order, **facts}


def _there(drive: MappedDrive) -> Iterator[dict[str, Any]]:
    path_m = drive.header.trajectory.position_m[:, :2]
    yield from _corners(path_m[thinned(len(path_m), POSES)], line="path", kind="path")
    for number, outline in enumerate(outlines(drive.header)):
        if not outline.moves:
            closed = np.concatenate([outline.points_m, outline.points_m[:1]])
            kind = "structure" if outline.structure else "truth"
            yield from _corners(closed, line=f"{number} {outline.name}", kind=kind)


def _path(drive: MappedDrive) -> Iterator[dict[str, Any]]:
    kept = thinned(len(drive.poses), POSES)
    times = _plain(drive.time_s[kept])
    nexts = [*times[1:], 1e9]
    for row, time, after in zip(_corners(drive.pose[kept, :2], line="path"), times, nexts, strict=True):
        yield {**row, "time": time, "next": after}


def _echoes(drive: MappedDrive) -> Iterator[dict[str, Any]]:
    at, place_m = drive.found
    kept = thinned(len(at), ECHOES)
    for (x, y), time in zip(map(_plain, place_m[kept]), _plain(drive.time_s[at[kept]]), strict=True):
        yield {"x": x, "y": y, "time": time}


def _cells(drive: MappedDrive) -> Iterator[dict[str, Any]]:
    if drive.grid is None:
        return
    middle_m, log_odds = cells(drive.grid, occupied=True)
    kept = np.sort(np.argsort(-log_odds, kind="stable")[:CELLS])
    half_m = drive.grid.cell_m / 2
    for x, y in drive.motion.of_points(middle_m[kept]).tolist():
        low_x, low_y, high_x, high_y = _plain([x - half_m, y - half_m, x + half_m, y + half_m])
        yield {"x": low_x, "y": low_y, "x2": high_x, "y2": high_y}


def _points(drive: MappedDrive) -> Iterator[dict[str, Any]]:
    yield from _corners(drive.points_m[thinned(len(drive.points_m), POINTS)])


def _segments(drive: MappedDrive) -> Iterator[dict[str, Any]]:
    for number, piece_m in enumerate([*drive.segments_m, *drive.lines_m]):
        yield from _corners(piece_m, line=number)


def _ellipses_on_the_way(drive: MappedDrive) -> Iterator[dict[str, Any]]:
    if drive.spread_m2 is None:
        return
    kept = thinned(len(drive.poses), ON_THE_WAY)
    outlines_m = ellipses(drive.pose[kept, :2], drive.spread_m2[kept], CORNERS)
    for number, (outline_m, time) in enumerate(zip(outlines_m, _plain(drive.time_s[kept]), strict=True)):
        yield from _corners(outline_m, line=number, time=time)


def _landmarks(drive: MappedDrive) -> Iterator[dict[str, Any]]:
    for kind, (name, _) in _MARKS.items():
        marks = drive.mapped.map.landmarks.of(kind)
        place_m, _ = drive.marks(kind)
        for row, identity, support in zip(
            _corners(place_m), marks.identity.tolist(), marks.support.tolist(), strict=True
        ):
            yield {**row, "kind": name, "identity": identity, "support": support}


def _ellipses_of_landmarks(drive: MappedDrive) -> Iterator[dict[str, Any]]:
    for kind in _MARKS:
        place_m, covariance = drive.marks(kind)
        support = drive.mapped.map.landmarks.of(kind).support
        kept = np.argsort(-support, kind="stable")[:LANDMARKS]
        for number, outline_m in enumerate(ellipses(place_m[kept], covariance[kept], CORNERS)):
            yield from _corners(outline_m, line=f"{kind} {number}")
