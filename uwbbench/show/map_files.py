"""Maps as files for other programs: PLY for viewers of points, CSV for tables.

Conventions
-----------
* Lengths are in metres, in the frame that the mapper works in; heights are 0.
* PLY is the text form of version 1.0. Each vertex has a ``kind``, its place in :data:`KINDS`; segments are the element
  ``edge``. Programs that know points alone leave out what they do not know. Of a grid those cells are points that are
  more probably occupied than not; lines, which have no ends, are in the CSV alone.
* CSV has a row for each piece of the map and the columns :data:`COLUMNS`, empty where a piece has no such value. Points
  and anchors have ``x_m, y_m``, segments ``to_x_m, to_y_m`` besides; a line has its distance from the origin and the
  direction of its normal. Variances and covariance are of the two columns that place a landmark.
  A cell of a grid has the place of its middle and its log-odds; cells of which nothing is known have no row.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from typing import Any

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.mapper import LANDMARK_KINDS, Map
from uwbbench.results.drives import cells

KINDS = ("surface", "point", "anchor", "segment", "cell")
"""Of what a vertex of a PLY file is: a point of a surface, a landmark, an anchor, the end of a segment, a cell."""

COLUMNS = (
    "kind",
    "identity",
    "x_m",
    "y_m",
    "to_x_m",
    "to_y_m",
    "distance_m",
    "normal_rad",
    "variance_1",
    "covariance",
    "variance_2",
    "support",
    "log_odds",
)
"""Of a CSV file."""


def ply(found: Map) -> str:
    """Map as the content of a PLY file."""
    places: dict[str, FloatArray] = {
        "surface": found.points_m,
        "point": found.landmarks.of("point").position_m,
        "anchor": found.landmarks.of("anchor").position_m,
        "segment": found.segments_m.reshape(-1, 2),
        "cell": np.zeros((0, 2)) if found.grid is None else cells(found.grid, occupied=True)[0],
    }
    first = sum(len(places[kind]) for kind in KINDS[: KINDS.index("segment")])
    vertices = [f"{x!r} {y!r} 0 {KINDS.index(kind)}" for kind in KINDS for x, y in places[kind].tolist()]
    edges = [f"{first + 2 * place} {first + 2 * place + 1}" for place in range(len(found.segments_m))]
    head = [
        "ply",
        "format ascii 1.0",
        f"comment kind: {', '.join(f'{number} {kind}' for number, kind in enumerate(KINDS))}",
        f"element vertex {len(vertices)}",
        *(f"property double {axis}" for axis in "xyz"),
        "property uchar kind",
        f"element edge {len(edges)}",
        "property int vertex1",
        "property int vertex2",
        "end_header",
    ]
    return "\n".join([*head, *vertices, *edges, ""])


def table(found: Map) -> str:
    """Map as the content of a CSV file."""
    written = io.StringIO()
    writer = csv.DictWriter(written, COLUMNS, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(_rows(found))
    return written.getvalue()


def _rows(found: Map) -> Iterator[dict[str, Any]]:
    marks = found.landmarks
    columns = (marks.identity, marks.kind, marks.a, marks.b, marks.covariance, marks.support)
    for identity, kind, a, b, covariance, support in zip(*(column.tolist() for column in columns), strict=True):
        names = ("distance_m", "normal_rad") if LANDMARK_KINDS[kind] == "line" else ("x_m", "y_m")
        yield {
            "kind": LANDMARK_KINDS[kind],
            "identity": identity,
            **dict(zip(names, (a, b), strict=True)),
            "variance_1": covariance[0][0],
            "covariance": covariance[0][1],
            "variance_2": covariance[1][1],
            "support": support,
        }
    for (x, y), (to_x, to_y) in found.segments_m.tolist():
        yield {"kind": "segment", "x_m": x, "y_m": y, "to_x_m": to_x, "to_y_m": to_y}
    for x, y in found.points_m.tolist():
        yield {"kind": "surface", "x_m": x, "y_m": y}
    if found.grid is not None:
        middles_m, log_odds = cells(found.grid)
        for (x, y), value in zip(middles_m.tolist(), log_odds.tolist(), strict=True):
            yield {"kind": "cell", "x_m": x, "y_m": y, "log_odds": value}
