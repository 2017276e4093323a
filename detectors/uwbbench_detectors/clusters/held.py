"""Detections held back until clustering has decided about them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from uwbbench.api import Detections, FloatArray, IntArray


class HeldRows:
    """Rows of detections in a table that grows, each known by its place in the order of arrival.

    To take in and to release a row costs the same however many are held; memory follows the number of rows held. A
    ``cluster`` that rows may have had before is dropped.
    """

    def __init__(self) -> None:
        self._names: tuple[str, ...] = ("frame",)  # of the columns of the table
        self._rows = np.empty((0, 1))  # frames are whole numbers, whose bits are kept
        self._places = np.empty(0, np.int64)  # known beyond the rows in use: the next ones in order
        self._released = np.empty(0, np.bool_)
        self._used = 0

    def add(self, arrived: Detections) -> None:
        """Take in rows; a column that only some of them have is NaN in the others."""
        if arrived.names != self._names:
            arrived = self._completed(arrived)
        if self._used + len(arrived) > len(self._places):
            self._make_room(len(arrived))
        start, stop = self._used, self._used + len(arrived)
        self._rows[start:stop] = arrived.table
        self._used = stop

    def points_m(self, count: int) -> FloatArray:
        """Positions (count, 2) of the newest rows."""
        return self._rows[self._used - count : self._used, [self._names.index("x_m"), self._names.index("y_m")]]

    def release(self, places: IntArray) -> dict[str, Any]:
        """Return columns of the rows that arrived at these places, and hold them no longer."""
        rows = np.searchsorted(self._places[: self._used], places)
        self._released[rows] = True
        table = self._rows[rows]
        columns: dict[str, NDArray[Any]] = dict(zip(self._names, table.T, strict=True))
        whole: dict[str, Any] = {name: columns[name].view(np.int64) for name in ("frame", "track") if name in columns}
        return columns | whole

    def release_all(self) -> dict[str, Any]:
        """Return columns of all rows that are held, in their order of arrival, and hold none."""
        return self.release(self._places[: self._used][~self._released[: self._used]])

    def _completed(self, arrived: Detections) -> Detections:
        """Rows with all columns that others have, in their order; columns that are new get a place in the table."""
        new = [name for name in arrived.names if name not in (*self._names, "cluster")]
        self._names = (*self._names, *new)
        self._rows = np.concatenate([self._rows, np.full((len(self._rows), len(new)), np.nan)], axis=1)
        columns: dict[str, Any] = {name: arrived[name] for name in self._names[1:]}
        return Detections(arrived.frame, processed=(), **columns)

    def _make_room(self, count: int) -> None:
        """Drop the released rows, and have room for so many more, and for as many as are held."""
        held = np.flatnonzero(~self._released[: self._used])
        size = max(len(held) + count, 2 * len(held))
        arrived = self._places[self._used - 1] + 1 if self._used else 0
        places = np.arange(arrived - len(held), arrived - len(held) + size)
        places[: len(held)] = self._places[held]
        rows = np.empty((size, len(self._names)))
        rows[: len(held)] = self._rows[held]
        self._rows, self._places, self._released = rows, places, np.zeros(size, np.bool_)
        self._used = len(held)
