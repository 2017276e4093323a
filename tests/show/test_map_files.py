"""Maps as PLY and CSV files."""

import csv
import io

import numpy as np
import pytest

from uwbbench.api import Grid, Landmarks, Map
from uwbbench.show import map_files

LANDMARKS = Landmarks(
    identity=np.array([7, 8, 9]),
    kind=np.array([0, 1, 2]),
    a=np.array([0.5, 1.25, -3.0]),
    b=np.array([1.5, -0.25, 4.0]),
    covariance=np.arange(12.0).reshape(3, 2, 2),
    support=np.array([4, 5, 6]),
)
FOUND = Map(
    LANDMARKS,
    segments_m=np.array([[[0.0, 1.0], [2.0, 3.0]]]),
    points_m=np.array([[0.1, 0.2]]),
    grid=Grid(np.array([1.0, 2.0]), 0.5, np.array([[0.0, 1.0], [-1.0, 0.0]])),
)


def parsed(text):
    """Vertices and edges, read by the head as any program does."""
    head, _, body = text.partition("end_header\n")
    counts = {line.split()[1]: int(line.split()[2]) for line in head.splitlines() if line.startswith("element")}
    lines = body.splitlines()
    assert len(lines) == sum(counts.values())
    return np.array([line.split() for line in lines[: counts["vertex"]]], float), lines[counts["vertex"] :]


def test_a_ply_file_has_every_point_with_its_kind_and_an_edge_a_segment():
    text = map_files.ply(FOUND)
    assert text.startswith("ply\nformat ascii 1.0\n")
    vertices, edges = parsed(text)
    rows = {tuple(row[:2]): map_files.KINDS[int(row[3])] for row in vertices}
    assert rows == {
        (0.1, 0.2): "surface",
        (0.5, 1.5): "point",
        (-3.0, 4.0): "anchor",
        (0.0, 1.0): "segment",
        (2.0, 3.0): "segment",
        (1.75, 2.25): "cell",
    }
    first, second = map(int, edges[0].split())
    assert vertices[[first, second], :2].tolist() == [[0.0, 1.0], [2.0, 3.0]]


def test_an_empty_map_is_a_file_without_vertices():
    vertices, edges = parsed(map_files.ply(Map()))
    assert (len(vertices), edges) == (0, [])
    assert map_files.table(Map()).splitlines() == [",".join(map_files.COLUMNS)]


def test_a_csv_file_has_a_row_a_piece_with_its_numbers():
    rows = list(csv.DictReader(io.StringIO(map_files.table(FOUND))))
    assert [row["kind"] for row in rows] == ["point", "line", "anchor", "segment", "surface", "cell", "cell"]
    point, line, _, segment, _, _, free = rows
    assert (point["identity"], point["x_m"], point["y_m"], point["support"]) == ("7", "0.5", "1.5", "4")
    assert (point["variance_1"], point["covariance"], point["variance_2"]) == ("0.0", "1.0", "3.0")
    assert (line["distance_m"], line["normal_rad"], line["x_m"]) == ("1.25", "-0.25", "")
    assert (segment["to_x_m"], segment["to_y_m"]) == ("2.0", "3.0")
    assert float(free["log_odds"]) == pytest.approx(-1.0)
