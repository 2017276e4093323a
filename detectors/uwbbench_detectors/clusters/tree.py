"""Search trees over the core points of a cell, for cells that come close to each other and are not joined.

Without them a wall that runs just beyond the radius from another one would cost every point of a cell a look at all
points of the other. A node is a core point and has a child in each quarter of its square, as in a digital search
tree; so that the order of arrival does not matter for the depth.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uwbbench.api import compiled
from uwbbench_detectors.clusters.grid import NONE, Grid, Radius, bounds_reach, neighbours

SCANNED = 32
"""Points of a cell that are compared one by one rather than searched."""

# Squares are rounded by a few units in the last place of their coordinates.
_ROUNDED = 2.0**-49


class _Square(NamedTuple):
    x: float
    y: float
    half: float


@compiled
def core_point_near(grid: Grid, cell: int, x: float, y: float, radius: Radius) -> bool:
    """Whether a core point of a cell is a neighbour of a point outside the cell.

    Parameters
    ----------
    grid : Grid
        Written where the search tree of the cell lacks core points.
    cell : int
        The cell that is searched.
    x, y : float
        Coordinates of the point.
    radius : Radius
    """
    if not bounds_reach(grid.cells[cell], x, y, radius):
        return False
    if grid.cells[cell].points >= SCANNED:
        _bring_up_to_date(grid, cell, radius)
        return _tree_holds_neighbour(grid, cell, x, y, radius)
    point = grid.cells[cell].core
    while point >= 0:
        if neighbours(grid.points[point], x, y, radius):
            return True
        point = grid.points[point].next
    return False


@compiled
def _square_of(cell: int, grid: Grid, radius: Radius) -> _Square:
    column, row = grid.cells[cell].column, grid.cells[cell].row
    return _Square((column + 0.5) * radius.side, (row + 0.5) * radius.side, radius.side / 2)


@compiled
def _quarter(square: _Square, place: int) -> _Square:
    half = square.half / 2
    return _Square(
        square.x + half if place & 1 else square.x - half, square.y + half if place & 2 else square.y - half, half
    )


@compiled
def _bring_up_to_date(grid: Grid, cell: int, radius: Radius) -> None:
    """Put the core points into the tree that came since this was last done."""
    point = grid.cells[cell].core
    while point != grid.cells[cell].planted:
        _plant(grid, cell, point, radius)
        point = grid.points[point].next
    grid.cells[cell].planted = grid.cells[cell].core


@compiled
def _plant(grid: Grid, cell: int, point: int, radius: Radius) -> None:
    grid.branches[point] = NONE
    if grid.cells[cell].tree < 0:
        grid.cells[cell].tree = point
        return
    x, y = grid.points[point].x, grid.points[point].y
    node = grid.cells[cell].tree
    square = _square_of(cell, grid, radius)
    depth = 1
    while x != grid.points[node].x or y != grid.points[node].y:
        place = (1 if x >= square.x else 0) | (2 if y >= square.y else 0)
        square = _quarter(square, place)
        depth += 1
        if grid.branches[node, place] < 0:
            grid.branches[node, place] = point
            grid.cells[cell].depth = max(grid.cells[cell].depth, depth)
            return
        node = grid.branches[node, place]


@compiled
def _tree_holds_neighbour(grid: Grid, cell: int, x: float, y: float, radius: Radius) -> bool:
    """Whether the tree holds a neighbour of a point; squares beyond the radius are passed over."""
    limit = np.sqrt(radius.squared) + (abs(x) + abs(y) + radius.side) * _ROUNDED
    nodes = np.empty(4 * grid.cells[cell].depth + 4, np.int32)  # to visit, and their squares
    squares = np.empty((len(nodes), 3))
    square = _square_of(cell, grid, radius)
    nodes[0] = grid.cells[cell].tree
    squares[0, 0], squares[0, 1], squares[0, 2] = square.x, square.y, square.half
    left = 1
    while left:
        left -= 1
        node = nodes[left]
        if neighbours(grid.points[node], x, y, radius):
            return True
        square = _Square(squares[left, 0], squares[left, 1], squares[left, 2])
        for place in range(4):
            if grid.branches[node, place] < 0:
                continue
            quarter = _quarter(square, place)
            over_x = max(abs(x - quarter.x) - quarter.half, 0.0)
            over_y = max(abs(y - quarter.y) - quarter.half, 0.0)
            if over_x * over_x + over_y * over_y <= limit * limit:
                nodes[left] = grid.branches[node, place]
                squares[left, 0], squares[left, 1], squares[left, 2] = quarter.x, quarter.y, quarter.half
                left += 1
    return False
