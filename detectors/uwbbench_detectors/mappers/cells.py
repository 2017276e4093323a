"""A grid of log-odds that grows with the area that was seen."""

from __future__ import annotations

import numpy as np

from uwbbench.api import FloatArray, Grid, IntArray

BLOCK = 64
"""Cells by which the grid grows at a time, so that it is not copied in every step."""


class Cells:
    """Log-odds of square cells, kept only where something was seen.

    Cell (row, column) covers ``[column, column + 1) x [row, row + 1)`` sides from the origin of the map's frame: where
    cells lie does not hang on what was seen first.

    Parameters
    ----------
    cell_m : float
        Side of a cell.
    clamp : tuple of float
        Least and largest log-odds that a cell can have.
    extent_m : float
        Nothing further from the origin than this, in x or in y, is kept: the bound on memory.
    """

    def __init__(self, cell_m: float, clamp: tuple[float, float], extent_m: float) -> None:
        self.cell_m, self.clamp, self.extent_m = cell_m, clamp, extent_m
        self._most = int(np.ceil(extent_m / cell_m))
        self._first = np.zeros(2, np.int64)
        self._log_odds = np.zeros((0, 0))

    def holds(self, low_m: FloatArray, high_m: FloatArray) -> bool:
        """Whether a box with these corners (2,) lies within the extent."""
        return bool(max(np.abs(low_m).max(), np.abs(high_m).max()) <= self.extent_m)

    def around(self, low_m: FloatArray, high_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Centres (columns,) in x and (rows,) in y of the cells that a box touches; none beyond the extent.

        Parameters
        ----------
        low_m, high_m : (2,) arrays
            Corners of the box, x and y.
        """
        ends = np.clip(np.floor(np.stack([low_m, high_m + self.cell_m]) / self.cell_m), -self._most, self._most)
        columns, rows = (np.arange(low, high) for low, high in ends.T)
        return (columns + 0.5) * self.cell_m, (rows + 0.5) * self.cell_m

    def add(self, x_m: FloatArray, y_m: FloatArray, evidence: FloatArray) -> None:
        """Add log-odds to a box of cells, and keep the sums within their bounds.

        Parameters
        ----------
        x_m, y_m : (columns,) and (rows,) arrays
            Centres of the cells, as :meth:`around` gives them.
        evidence : (rows, columns) array
        """
        if not evidence.size:
            return
        first = np.floor(np.array([y_m[0], x_m[0]]) / self.cell_m).astype(np.int64)
        self._grow(first, first + evidence.shape)
        row, column = first - self._first
        box = self._log_odds[row : row + len(y_m), column : column + len(x_m)]
        np.clip(box + evidence, *self.clamp, out=box)

    def _grow(self, first: IntArray, last: IntArray) -> None:
        """Make room for the cells from ``first`` to before ``last``, by row and column."""
        shape = self._log_odds.shape
        low, high = first // BLOCK * BLOCK, -(-last // BLOCK) * BLOCK
        if self._log_odds.size:
            low, high = np.minimum(low, self._first), np.maximum(high, self._first + shape)
        if (low == self._first).all() and (high - low == shape).all():
            return
        grown = np.zeros(high - low)
        if self._log_odds.size:
            row, column = self._first - low
            grown[row : row + shape[0], column : column + shape[1]] = self._log_odds
        self._first, self._log_odds = low, grown

    def grid(self) -> Grid:
        """The cells of which anything is known, and those between them."""
        known = self._log_odds != 0
        rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
        if not len(rows):
            return Grid(np.zeros(2), self.cell_m, np.zeros((0, 0)))
        low = np.array([rows[0], columns[0]])
        inner = self._log_odds[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        return Grid((self._first + low)[::-1] * self.cell_m, self.cell_m, inner)
