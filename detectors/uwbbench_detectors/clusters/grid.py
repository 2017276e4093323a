"""A hash grid of points in the plane whose cells are so small that all points of one cell are neighbours."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from uwbbench.api import compiled

NONE = -1
BORDER = -2
UNNUMBERED = np.iinfo(np.int32).max

SPAN = 5
"""Cells along each axis that hold all neighbours of a point: its own and two on either side."""

AROUND = SPAN * SPAN
OWN = AROUND // 2
"""Place of a cell among the cells around it; the cell at place ``k`` sees it at ``AROUND - 1 - k``."""

# A quotient below 2^41 is rounded by at most 2^-12, so a side shorter by 2^-10 keeps points of one cell neighbours.
LARGEST_INDEX = 2.0**41
_SHORTER = 1 - 2.0**-10
# Sums and differences of coordinates are rounded likewise: boxes along the diagonals reject a little later.
_LATER = 1 + 2.0**-8

POINT = np.dtype(
    [
        ("x", np.float64),
        ("y", np.float64),
        ("cell", np.int32),
        ("next", np.int32),  # in the list of its cell: that of the core points, or of those waiting to be core
        ("count", np.int32),  # neighbours, itself included, no longer kept once they make a core point
        ("reach", np.int32),  # bit k: a core point in the cell at place k around its own is a neighbour
    ]
)
CELL = np.dtype(
    [
        ("column", np.int64),
        ("row", np.int64),
        ("points", np.int32),
        ("waiting", np.int32),  # newest point that is not core
        ("core", np.int32),  # newest core point
        ("tree", np.int32),  # root of the search tree over core points
        ("planted", np.int32),  # newest core point in the tree
        ("depth", np.int32),  # of the tree
        ("first", np.int32),  # of a root: first core point of its component
        ("number", np.int32),  # of a root: smallest number that a part of the component was given
        # Bounds of the core points along both axes and both diagonals.
        ("low_x", np.float64),
        ("high_x", np.float64),
        ("low_y", np.float64),
        ("high_y", np.float64),
        ("low_sum", np.float64),
        ("high_sum", np.float64),
        ("low_difference", np.float64),
        ("high_difference", np.float64),
    ]
)


class Radius(NamedTuple):
    """What the neighbourhood radius means to the grid."""

    side: float
    squared: float
    diagonal: float

    @staticmethod
    def of(eps: float) -> Radius:
        """Cell side, squared radius, and the sum of coordinate differences that no neighbours reach.

        Raises
        ------
        ValueError
            If the square of ``eps`` is no normal number.
        """
        if not 1e-150 <= eps <= 1e150:
            raise ValueError(f"the neighbourhood radius must lie between 1e-150 and 1e150, not {eps:g}")
        return Radius(eps / math.sqrt(2) * _SHORTER, eps * eps, math.sqrt(2) * eps * _LATER)


class Grid(NamedTuple):
    """Arrays of the grid, of which a part is in use; the rest is room to grow.

    Attributes
    ----------
    used : (4,) array
        Points, cells, queued points, and cells with core points.
    points, cells : record arrays
        ``POINT`` and ``CELL``.
    owner : array
        For each point a cell whose cluster it is in for good; ``BORDER`` while that is open, ``NONE`` for noise.
    parent : array
        Union-find over the cells with core points; ``NONE`` for the others.
    dense : array
        The cells with core points, in the order in which they got the first.
    around : (cells, 25) array
        The cells at the places around each.
    table : array
        Cells by the hashes of their indices, with open addressing.
    branches : (points, 4) array
        The children of a core point in the search tree of its cell, as far as there is one.
    queue : array
        Points that a cluster has taken in since the queue was last emptied.
    """

    used: NDArray[np.int64]
    points: NDArray[Any]
    owner: NDArray[np.int32]
    branches: NDArray[np.int32]
    queue: NDArray[np.int32]
    cells: NDArray[Any]
    parent: NDArray[np.int32]
    dense: NDArray[np.int32]
    around: NDArray[np.int32]
    table: NDArray[np.int32]

    @staticmethod
    def empty() -> Grid:
        """Grid without points and without room."""
        return Grid(
            used=np.zeros(4, np.int64),
            points=np.empty(0, POINT),
            owner=np.empty(0, np.int32),
            branches=np.empty((0, 4), np.int32),
            queue=np.empty(0, np.int32),
            cells=np.empty(0, CELL),
            parent=np.empty(0, np.int32),
            dense=np.empty(0, np.int32),
            around=np.empty((0, AROUND), np.int32),
            table=np.full(2, NONE, np.int32),
        )

    def with_room(self, points: int) -> Grid:
        """Return the grid with room for so many points more; arrays at least double where they grow."""
        held, cells, _, _ = self.used.tolist()
        parts: dict[str, NDArray[Any]] = {}
        if held + points > len(self.points):
            size = max(held + points, 2 * held)
            parts |= {name: _grown(getattr(self, name), size) for name in ("points", "owner", "branches", "queue")}
        if cells + points > len(self.cells):
            size = max(cells + points, 2 * cells)
            parts |= {name: _grown(getattr(self, name), size) for name in ("cells", "parent", "dense", "around")}
            parts["table"] = np.full(1 << (2 * size).bit_length(), NONE, np.int32)
            _fill_table(parts["table"], self.cells, cells)
        return self._replace(**parts)


def _grown(values: NDArray[Any], size: int) -> NDArray[Any]:
    larger = np.empty((size, *values.shape[1:]), values.dtype)
    larger[: len(values)] = values
    return larger


@compiled
def _hashed(column: int, row: int) -> int:
    mixed = column * 0x1E3779B97F4A7C15 + row * 0x3F58476D1CE4E5B9
    return mixed ^ (mixed >> 32)


@compiled
def _slot_of(table: Any, cells: Any, column: int, row: int) -> int:
    """Slot of the table that holds a cell, or the empty one where it belongs."""
    mask = len(table) - 1
    slot = _hashed(column, row) & mask
    while table[slot] >= 0 and (cells[table[slot]].column != column or cells[table[slot]].row != row):
        slot = (slot + 1) & mask
    return slot


@compiled
def _fill_table(table: Any, cells: Any, count: int) -> None:
    for cell in range(count):
        table[_slot_of(table, cells, cells[cell].column, cells[cell].row)] = cell


@compiled
def cell_at(grid: Grid, column: int, row: int) -> int:
    """Cell with these indices, made if there is none yet.

    Parameters
    ----------
    grid : Grid
        With room for one cell more.
    column, row : int
        Coordinates of the points divided by the cell's side, rounded down: x, y.
    """
    slot = _slot_of(grid.table, grid.cells, column, row)
    if grid.table[slot] >= 0:
        return int(grid.table[slot])
    made = int(grid.used[1])
    grid.used[1] += 1
    grid.table[slot] = made
    cell = grid.cells[made]
    cell.column = column
    cell.row = row
    cell.points = 0
    cell.waiting = NONE
    cell.core = NONE
    cell.tree = NONE
    cell.planted = NONE
    cell.depth = 1
    cell.low_x = cell.low_y = cell.low_sum = cell.low_difference = np.inf
    cell.high_x = cell.high_y = cell.high_sum = cell.high_difference = -np.inf
    grid.parent[made] = NONE
    for place in range(AROUND):
        near_column = column + place // SPAN - SPAN // 2
        near_row = row + place % SPAN - SPAN // 2
        near = grid.table[_slot_of(grid.table, grid.cells, near_column, near_row)]
        grid.around[made, place] = near
        if near >= 0:
            grid.around[near, AROUND - 1 - place] = made
    return made


@compiled
def root_of(parent: NDArray[np.int32], cell: int) -> int:
    """Root of the component of a cell with core points; halves the path to it."""
    while parent[cell] != cell:
        parent[cell] = parent[parent[cell]]
        cell = int(parent[cell])
    return cell


@compiled
def joined(grid: Grid, left: int, right: int) -> int:
    """Root of two components made one: that of the one with the first core point.

    Parameters
    ----------
    grid : Grid
    left, right : int
        Roots of two different components, in any order.
    """
    cells = grid.cells
    if cells[right].first < cells[left].first:
        left, right = right, left
    grid.parent[right] = left
    cells[left].number = min(cells[left].number, cells[right].number)
    return left


@compiled
def neighbours(point: Any, x: float, y: float, radius: Radius) -> bool:
    """Whether a point is a neighbour of another one.

    Parameters
    ----------
    point : record
        One of ``POINT``.
    x, y : float
        Coordinates of the other point.
    radius : Radius
    """
    dx, dy = point.x - x, point.y - y
    return bool(dx * dx + dy * dy <= radius.squared)


@compiled
def bounds_reach(cell: Any, x: float, y: float, radius: Radius) -> bool:
    """Whether a neighbour of a point may lie within the bounds of a cell's core points; False is certain.

    Parameters
    ----------
    cell : record
        One of ``CELL``.
    x, y : float
        Coordinates of the point.
    radius : Radius
    """
    over_x = max(cell.low_x - x, x - cell.high_x, 0.0)
    over_y = max(cell.low_y - y, y - cell.high_y, 0.0)
    if over_x * over_x + over_y * over_y > radius.squared:
        return False
    total, difference = x + y, x - y
    over = max(cell.low_sum - total, total - cell.high_sum, cell.low_difference - difference)
    return bool(max(over, difference - cell.high_difference) <= radius.diagonal)


@compiled
def widen_bounds(cell: Any, x: float, y: float) -> None:
    """Take a core point into the bounds of its cell.

    Parameters
    ----------
    cell : record
        One of ``CELL``; written.
    x, y : float
        Coordinates of the core point.
    """
    cell.low_x = min(cell.low_x, x)
    cell.high_x = max(cell.high_x, x)
    cell.low_y = min(cell.low_y, y)
    cell.high_y = max(cell.high_y, y)
    cell.low_sum = min(cell.low_sum, x + y)
    cell.high_sum = max(cell.high_sum, x + y)
    cell.low_difference = min(cell.low_difference, x - y)
    cell.high_difference = max(cell.high_difference, x - y)
